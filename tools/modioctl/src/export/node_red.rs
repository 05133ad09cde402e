//! A flow for Node-RED with the nodes of node-red-contrib-modbus.
//!
//! All units share one client, because two clients cannot use one port. Consecutive points of one kind and port share
//! one request. A function node creates an object of names and values from each response. Each output has a function
//! node that checks the value in `msg.payload`, and a write node.

use modbus_line::Parity;
use modio_description::Table;
use serde_json::{Value as Json, json};

use super::{Line, Scaling, Source, identifier, no_ascii_over_tcp, plain};
use crate::bus::Place;
use crate::bus::adu::Framing;
use crate::bus::endpoint::host_and_port;
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::value::quantities;

/// Vertical distance between nodes in the editor.
const ROW: usize = 60;

/// Seconds between two readings of the points, of the counters and of the diagnostic values.
const SECONDS: [u8; 3] = [1, 10, 60];

/// Returns the flow, with a tab for each unit.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    no_ascii_over_tcp("node-red-contrib-modbus", line.endpoint)?;
    let title = line.title()?;
    let id = format!("{}_client", identifier(&title));
    let mut nodes = Vec::new();
    for source in line.units {
        nodes.extend(tab(source, &line.unit_name(source)?, &id));
    }
    nodes.insert(1, client(line, &id, &title)?);
    let text = serde_json::to_string_pretty(&nodes).map_err(Failure::usage)?;
    Ok(text + "\n")
}

/// A unit, and the ids of nodes that others refer to.
struct Unit<'a> {
    address: u8,
    prefix: String,
    tab: String,
    debug: String,
    client: &'a str,
}

/// Returns the tab of a unit, followed by its nodes.
fn tab(source: &Source, name: &str, client: &str) -> Vec<Json> {
    let prefix = identifier(name);
    let unit = Unit {
        address: source.unit,
        tab: format!("{prefix}_tab"),
        debug: format!("{prefix}_debug"),
        prefix,
        client,
    };
    let mut nodes = vec![
        json!({ "id": unit.tab, "type": "tab", "label": name, "disabled": false, "info": "Written by `modioctl export node-red`." }),
        json!({
            "id": unit.debug, "type": "debug", "z": unit.tab, "name": "values", "active": true, "tosidebar": true,
            "console": false, "tostatus": false, "complete": "payload", "targetType": "msg",
            "x": 700, "y": ROW, "wires": [],
        }),
    ];
    let mut row = 0;
    let [fast, slower, slow] = SECONDS;
    for (runs, seconds) in [
        (runs(source.book.points()), fast),
        (runs(source.counters()), slower),
        (runs(source.diagnostics()), slow),
    ] {
        for run in runs {
            row += 1;
            nodes.extend(read(&run, &unit, row, seconds));
        }
    }
    let outputs = source.book.points().filter(|item| source.can_set(item));
    for item in outputs {
        row += 1;
        nodes.extend(write(item, &unit, row));
    }
    nodes
}

fn client(line: Line<'_>, id: &str, name: &str) -> Result<Json, Failure> {
    let endpoint = line.endpoint;
    let mut client = json!({
        "id": id,
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
            Parity::None => "none",
            Parity::Even => "even",
            Parity::Odd => "odd",
        },
        "serialConnectionDelay": "100",
        "unit_id": line.units.first().map_or(endpoint.unit, |source| source.unit),
        "commandDelay": line.silence().unwrap_or(1),
        "clientTimeout": u64::try_from(endpoint.timeout.as_millis()).unwrap_or(1000),
        "reconnectOnTimeout": true,
        "reconnectTimeout": 500,
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
            let (host, port) = host_and_port(address).map_err(Failure::usage)?;
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

/// Returns runs of items with consecutive addresses in one table, all writable or none. Points of two ports are in
/// two runs, because a unit refuses the whole request when the module of one port does not answer.
fn runs<'a>(items: impl Iterator<Item = &'a Item>) -> Vec<Vec<&'a Item>> {
    let mut runs: Vec<Vec<&Item>> = Vec::new();
    for item in items {
        let port = |item: &Item| match item.meaning {
            Meaning::Bit | Meaning::Analog(_) => Some(item.address / 4),
            _ => None,
        };
        let joins = |run: &&mut Vec<&Item>| {
            run.last().is_some_and(|last| {
                (last.table, last.writable, port(last)) == (item.table, item.writable, port(item))
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
fn read(run: &[&Item], unit: &Unit<'_>, row: usize, seconds: u8) -> Vec<Json> {
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
        [only] => plain(&only.name),
        [first, .., last] => plain(&format!("{} to {}", first.name, last.name)),
        [] => String::new(),
    };
    let id = format!("{}_{}", unit.prefix, identifier(&first.name));
    let mut lines = vec!["const w = msg.payload;".to_owned()];
    lines.push("msg.payload = {".to_owned());
    let mut at = 0;
    for item in run {
        lines.push(format!(
            "  {}: {},",
            json!(plain(&item.name)),
            expression(item, at)
        ));
        at += item.words;
    }
    lines.push("};".to_owned());
    lines.push("return msg;".to_owned());
    vec![
        json!({
            "id": format!("{id}_read"), "type": "modbus-read", "z": unit.tab, "name": name, "topic": "",
            "showStatusActivities": true, "logIOActivities": false, "showErrors": true,
            "showWarnings": true, "unitid": unit.address.to_string(),
            "dataType": function, "adr": first.address.to_string(), "quantity": quantity.to_string(),
            "rate": seconds.to_string(), "rateUnit": "s", "delayOnStart": false, "startDelayTime": "",
            "server": unit.client, "useIOFile": false, "ioFile": "", "useIOForPayload": false,
            "emptyMsgOnFail": false, "x": 160, "y": row * ROW, "wires": [[format!("{id}_values")], []],
        }),
        json!({
            "id": format!("{id}_values"), "type": "function", "z": unit.tab, "name": name,
            "func": lines.join("\n"), "outputs": 1, "timeout": 0, "noerr": 0, "initialize": "",
            "finalize": "", "libs": [], "x": 430, "y": row * ROW, "wires": [[unit.debug]],
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

/// The function of an output that is a bit. Other software also sends texts, and JavaScript takes every text that is
/// not empty for true.
const BIT: &str = r#"const states = new Map([["on", true], ["true", true], ["1", true], ["off", false], ["false", false], ["0", false]]);
const text = typeof msg.payload === "object" ? "an object" : String(msg.payload);
const state = states.get(text.trim().toLowerCase());
if (state === undefined) {
  node.error(`${output.name}: ${JSON.stringify(text)} is not ${output.takes}`, msg);
  return null;
}
msg.payload = state;
return msg;"#;

/// The function of an output that is a word.
const WORD: &str = r#"const text = typeof msg.payload === "object" ? "an object" : String(msg.payload);
const decimal = /^\s*[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?\s*$/i;
const steps = decimal.test(text) ? Number(text) / output.step : NaN;
const n = Math.round(steps) - output.offset;
if (!(Math.abs(steps - Math.round(steps)) < 1e-6 && n >= output.min && n <= output.max)) {
  node.error(`${output.name}: ${JSON.stringify(text)} is not ${output.takes}`, msg);
  return null;
}
msg.payload = n & 0xFFFF;
return msg;"#;

/// Returns the function that checks a value and converts it to the register's number, or to a bit. Like `modioctl
/// write` it refuses every value that the output does not have exactly.
fn check(item: &Item) -> String {
    let name = plain(&item.name);
    let (output, body) = match item.table {
        Table::Bit => (
            json!({ "name": name, "takes": "on, true, 1, off, false or 0" }),
            BIT,
        ),
        Table::Word => {
            let scaling = Scaling::of(item);
            let (min, max) = scaling.range.unwrap_or((0, 0xFFFF));
            let range = quantities(min.into(), max.into(), &scaling.unit);
            let step = scaling.factor();
            let output = json!({
                "name": name, "min": min, "max": max, "step": step, "offset": scaling.unit.offset,
                "takes": format!("{range} in steps of {step}"),
            });
            (output, WORD)
        }
    };
    // JSON is also JavaScript.
    format!("const output = {output};\n{body}")
}

/// Returns a write node for an output, and the function node in front of it.
fn write(item: &Item, unit: &Unit<'_>, row: usize) -> Vec<Json> {
    let id = format!("{}_{}", unit.prefix, identifier(&item.name));
    let name = plain(&format!("set {}", item.name));
    let code = check(item);
    let function = match item.table {
        Table::Bit => "Coil",
        Table::Word => "HoldingRegister",
    };
    vec![
        json!({
            "id": format!("{id}_set"), "type": "function", "z": unit.tab, "name": name, "func": code,
            "outputs": 1, "timeout": 0, "noerr": 0, "initialize": "", "finalize": "", "libs": [],
            "x": 160, "y": row * ROW, "wires": [[format!("{id}_write")]],
        }),
        json!({
            "id": format!("{id}_write"), "type": "modbus-write", "z": unit.tab, "name": plain(&item.name),
            "showStatusActivities": true, "showErrors": true, "showWarnings": true,
            "unitid": unit.address.to_string(), "dataType": function,
            "adr": item.address.to_string(), "quantity": "1", "server": unit.client,
            "emptyMsgOnFail": false, "keepMsgProperties": false,
            "x": 430, "y": row * ROW, "wires": [[], []],
        }),
    ]
}
