//! A flow for Node-RED with the nodes of node-red-contrib-modbus.
//!
//! Consecutive points of one kind share one request. A function node creates an object of names and values from
//! each response. Each output has a write node that takes the value in `msg.payload`.

use modio_description::Table;
use serde_json::{Value as Json, json};

use super::{Scaling, Source, host_and_port, identifier, no_ascii_over_tcp};
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Place};
use crate::failure::Failure;
use crate::names::Item;

/// Vertical distance between nodes in the editor.
const ROW: usize = 60;

/// Returns the flow.
pub fn text(source: Source<'_>) -> Result<String, Failure> {
    let unit = source.unit_name()?;
    no_ascii_over_tcp("node-red-contrib-modbus", source.endpoint)?;
    let prefix = identifier(&unit);
    let ids = Ids {
        tab: format!("{prefix}_tab"),
        client: format!("{prefix}_client"),
        debug: format!("{prefix}_debug"),
        prefix,
    };
    let mut nodes = vec![
        json!({ "id": ids.tab, "type": "tab", "label": unit, "disabled": false, "info": "Written by `modioctl export node-red`." }),
        client(source.endpoint, &ids, &unit)?,
        json!({
            "id": ids.debug, "type": "debug", "z": ids.tab, "name": "values", "active": true, "tosidebar": true,
            "console": false, "tostatus": false, "complete": "payload", "targetType": "msg",
            "x": 700, "y": ROW, "wires": [],
        }),
    ];
    let mut row = 0;
    for run in runs(source.book.points()) {
        row += 1;
        nodes.extend(read(&run, &ids, source.endpoint, row, 1));
    }
    for run in runs(source.diagnostics()) {
        row += 1;
        nodes.extend(read(&run, &ids, source.endpoint, row, 60));
    }
    for item in source.book.points().filter(|item| item.writable) {
        row += 1;
        nodes.extend(write(item, &ids, source.endpoint, row));
    }
    let text = serde_json::to_string_pretty(&nodes).map_err(Failure::usage)?;
    Ok(text + "\n")
}

struct Ids {
    prefix: String,
    tab: String,
    client: String,
    debug: String,
}

fn client(endpoint: &Endpoint, ids: &Ids, name: &str) -> Result<Json, Failure> {
    let mut client = json!({
        "id": ids.client,
        "type": "modbus-client",
        "name": name,
        "clienttype": "tcp",
        "bufferCommands": true,
        "stateLogEnabled": false,
        "queueLogEnabled": false,
        "failureLogEnabled": true,
        "tcpHost": "127.0.0.1",
        "tcpPort": "502",
        "tcpType": "DEFAULT",
        "serialPort": "/dev/ttyUSB",
        "serialType": "RTU-BUFFERD",
        "serialBaudrate": endpoint.baud.to_string(),
        "serialDatabits": endpoint.format.data_bits.to_string(),
        "serialStopbits": endpoint.format.stop_bits.to_string(),
        "serialParity": match endpoint.format.parity {
            'E' => "even",
            'O' => "odd",
            _ => "none",
        },
        "serialConnectionDelay": "100",
        "unit_id": endpoint.unit,
        "commandDelay": 1,
        "clientTimeout": u64::try_from(endpoint.timeout.as_millis()).unwrap_or(1000),
        "reconnectOnTimeout": true,
        "reconnectTimeout": 2000,
        "parallelUnitIdsAllowed": true,
    });
    match &endpoint.place {
        Place::Serial(port) => {
            client["clienttype"] = json!("serial");
            client["parallelUnitIdsAllowed"] = json!(false);
            client["serialPort"] = json!(port);
            if endpoint.framing == Framing::Ascii {
                client["serialType"] = json!("ASCII");
            }
        }
        Place::Tcp(address) | Place::ModbusTcp(address) => {
            let (host, port) = host_and_port(address)?;
            client["tcpHost"] = json!(host);
            client["tcpPort"] = json!(port.to_string());
            if endpoint.framing == Framing::Rtu {
                // TELNET sends plain RTU frames. TCP-RTU-BUFFERED sends frames of Modbus TCP, despite its name.
                client["tcpType"] = json!("TELNET");
                // A serial line carries one request at a time.
                client["parallelUnitIdsAllowed"] = json!(false);
            }
        }
    }
    Ok(client)
}

/// Returns runs of items with consecutive addresses in one table, all writable or none.
fn runs<'a>(items: impl Iterator<Item = &'a Item>) -> Vec<Vec<&'a Item>> {
    let mut runs: Vec<Vec<&Item>> = Vec::new();
    for item in items {
        let joins = |run: &&mut Vec<&Item>| {
            run.last().is_some_and(|last| {
                (last.table, last.writable) == (item.table, item.writable)
                    && u32::from(last.address) + u32::from(last.words) == u32::from(item.address)
            })
        };
        match runs.last_mut().filter(joins) {
            Some(run) => run.push(item),
            None => runs.push(vec![item]),
        }
    }
    runs
}

/// Returns a read node for a run, and the function node that names and scales its values.
fn read(run: &[&Item], ids: &Ids, endpoint: &Endpoint, row: usize, seconds: u8) -> Vec<Json> {
    let [first, ..] = run else {
        return Vec::new();
    };
    let function = match (first.table, first.writable) {
        (Table::Bit, false) => "Input",
        (Table::Bit, true) => "Coil",
        (Table::Word, false) => "InputRegister",
        (Table::Word, true) => "HoldingRegister",
    };
    let quantity: u16 = run.iter().map(|item| item.words).sum();
    let name = match run {
        [only] => only.name.clone(),
        [first, .., last] => format!("{} to {}", first.name, last.name),
        [] => String::new(),
    };
    let id = format!("{}_{}", ids.prefix, identifier(&first.name));
    let mut lines = vec!["const w = msg.payload;".to_owned()];
    lines.push("msg.payload = {".to_owned());
    let mut at = 0;
    for item in run {
        lines.push(format!("  {}: {},", json!(item.name), expression(item, at)));
        at += item.words;
    }
    lines.push("};".to_owned());
    lines.push("return msg;".to_owned());
    vec![
        json!({
            "id": format!("{id}_read"), "type": "modbus-read", "z": ids.tab, "name": name, "topic": "",
            "showStatusActivities": true, "logIOActivities": false, "showErrors": true,
            "showWarnings": true, "unitid": endpoint.unit.to_string(),
            "dataType": function, "adr": first.address.to_string(), "quantity": quantity.to_string(),
            "rate": seconds.to_string(), "rateUnit": "s", "delayOnStart": false, "startDelayTime": "",
            "server": ids.client, "useIOFile": false, "ioFile": "", "useIOForPayload": false,
            "emptyMsgOnFail": false, "x": 160, "y": row * ROW, "wires": [[format!("{id}_values")], []],
        }),
        json!({
            "id": format!("{id}_values"), "type": "function", "z": ids.tab, "name": name,
            "func": lines.join("\n"), "outputs": 1, "timeout": 0, "noerr": 0, "initialize": "",
            "finalize": "", "libs": [], "x": 430, "y": row * ROW, "wires": [[ids.debug]],
        }),
    ]
}

/// Returns the expression for an item's value, from the words `w` of a response.
fn expression(item: &Item, at: u16) -> String {
    let scaling = Scaling::of(item);
    let number = match (item.table, item.words, scaling.signed) {
        (Table::Bit, ..) => return format!("Boolean(w[{at}])"),
        (Table::Word, 2, _) => format!("(w[{at}] * 65536 + w[{}])", at + 1),
        // Shifting left and right by 16 bits extends the sign.
        (Table::Word, _, true) => format!("(w[{at}] << 16 >> 16)"),
        (Table::Word, _, false) => format!("w[{at}]"),
    };
    let number = match scaling.unit.offset {
        0 => number,
        offset => format!("({number} + {offset})"),
    };
    match scaling.unit.exponent {
        0 => number,
        // Division by a whole power of ten gives the nearest decimal fraction.
        exponent @ ..0 => format!("{number} / {}", super::power(exponent.saturating_neg())),
        exponent => format!("{number} * {}", super::power(exponent)),
    }
}

/// Returns a write node for an output. A function node in front of it converts the quantity to the register's
/// number.
fn write(item: &Item, ids: &Ids, endpoint: &Endpoint, row: usize) -> Vec<Json> {
    let scaling = Scaling::of(item);
    let id = format!("{}_{}", ids.prefix, identifier(&item.name));
    let name = format!("set {}", item.name);
    let (function, code) = match item.table {
        Table::Bit => (
            "Coil",
            "msg.payload = Boolean(msg.payload);\nreturn msg;".to_owned(),
        ),
        Table::Word => {
            let (min, max) = scaling.range.unwrap_or((0, 0xFFFF));
            let factor = scaling.factor();
            let offset = scaling.unit.offset;
            let lines = [
                match (factor, offset) {
                    (1.0, 0) => "const n = Math.round(msg.payload);".to_owned(),
                    _ => format!("const n = Math.round(msg.payload / {factor}) - {offset};"),
                },
                format!("if (!(n >= {min} && n <= {max})) {{"),
                format!(
                    "  node.error(\"{}: value is out of range\", msg);",
                    item.name
                ),
                "  return null;".to_owned(),
                "}".to_owned(),
                "msg.payload = n & 0xFFFF;".to_owned(),
                "return msg;".to_owned(),
            ];
            ("HoldingRegister", lines.join("\n"))
        }
    };
    vec![
        json!({
            "id": format!("{id}_set"), "type": "function", "z": ids.tab, "name": name, "func": code,
            "outputs": 1, "timeout": 0, "noerr": 0, "initialize": "", "finalize": "", "libs": [],
            "x": 160, "y": row * ROW, "wires": [[format!("{id}_write")]],
        }),
        json!({
            "id": format!("{id}_write"), "type": "modbus-write", "z": ids.tab, "name": item.name,
            "showStatusActivities": true, "showErrors": true, "showWarnings": true,
            "unitid": endpoint.unit.to_string(), "dataType": function,
            "adr": item.address.to_string(), "quantity": "1", "server": ids.client,
            "emptyMsgOnFail": false, "keepMsgProperties": false,
            "x": 430, "y": row * ROW, "wires": [[], []],
        }),
    ]
}
