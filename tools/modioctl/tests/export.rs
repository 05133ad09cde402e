//! Compares exports with the files in `tests/export/`, and parses them.
//!
//! After an intended change run `MODIOCTL_WRITE_EXPORTS=1 cargo test -p modioctl --test export`, then check the
//! differences.

use std::collections::BTreeSet;
use std::path::Path;

use modio_description::{Description, Value, describe};
use modioctl::bus::adu::Framing;
use modioctl::bus::{Endpoint, Place};
use modioctl::export::ExportFormat::{self, Csv, HomeAssistant, NodeRed, Telegraf};
use modioctl::export::{Line, Source, text};
use modioctl::names::Book;
use proptest::prelude::*;
use register_map::Module;
use register_map::board::{MODIO_02, MODIO_08};
use serde_json::{Value as Json, json};

const FORMATS: [ExportFormat; 5] = [Csv, ExportFormat::Json, HomeAssistant, Telegraf, NodeRed];

fn serial() -> Endpoint {
    Endpoint::new(Place::Serial("/dev/ttyUSB0".to_owned()), Framing::Rtu)
}

fn rtu_over_tcp() -> Endpoint {
    Endpoint::new(Place::Tcp("gateway:4196".to_owned()), Framing::Rtu)
}

fn modbus_tcp() -> Endpoint {
    Endpoint::new(Place::ModbusTcp("[::1]:502".to_owned()), Framing::Mbap)
}

/// A modio-02 with module 2ai2ao in engineering units: NTC, 4-20 mA, 0-10 V and 4-20 mA.
fn analog() -> Book {
    let mut readings = vec![(0, 0); 32];
    readings[0x10..0x14].copy_from_slice(&[(2, 1), (1, 1), (0, 1), (1, 1)]);
    Book::new(describe(&MODIO_02, "0.1.0", |_| Module::Ai2Ao2), readings)
}

/// A modio-08 with digital inputs and outputs.
fn digital() -> Book {
    let module = |port| if port == 1 { Module::Di4 } else { Module::Do4 };
    Book::new(describe(&MODIO_08, "0.1.0", module), vec![(0, 0); 32])
}

/// The first two ports of a modio-08: relays, and three points, an NTC, 0-10 V and an output with 4-20 mA. A link holds the
/// coil of relay 1: it is a sensor that nothing writes.
fn mixed() -> Source {
    let module = |port| [Module::Relay2, Module::Ai2Ao2][usize::from(port > 1)];
    let mut description = describe(&MODIO_08, "0.1.0", module);
    description.ports.truncate(2);
    description.ports[1].lacks = 1;
    let mut readings = vec![(0, 0); 32];
    readings[4..7].copy_from_slice(&[(2, 1), (0, 1), (1, 1)]);
    let held = [("p1.3".to_owned(), vec!["p2.1".to_owned()])];
    Source {
        held: held.into(),
        ..source(1, &Book::new(description, readings))
    }
}

/// A modio-02 with this module.
fn modio_02(module: Module) -> Book {
    Book::new(describe(&MODIO_02, "0.1.0", |_| module), vec![(0, 0); 32])
}

fn export(format: ExportFormat, book: &Book, endpoint: &Endpoint) -> Result<String, String> {
    several(format, None, &[(1, book)], endpoint)
}

fn export_of(format: ExportFormat, book: &Book) -> String {
    export(format, book, &serial()).unwrap()
}

fn several(
    format: ExportFormat,
    name: Option<&str>,
    books: &[(u8, &Book)],
    endpoint: &Endpoint,
) -> Result<String, String> {
    let units: Vec<_> = books
        .iter()
        .map(|(unit, book)| source(*unit, book))
        .collect();
    let line = Line {
        name,
        endpoint,
        units: &units,
    };
    text(format, line).map_err(|failure| failure.to_string())
}

/// A unit without outputs that links hold.
fn source(unit: u8, book: &Book) -> Source {
    Source {
        unit,
        book: book.clone(),
        source: "this program's register map".to_owned(),
        held: Default::default(),
    }
}

/// Reads an export.
fn parsed(format: ExportFormat, text: &str) -> Json {
    match format {
        HomeAssistant => serde_yaml_ng::from_str(text).unwrap(),
        Telegraf => serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap(),
        _ => serde_json::from_str(text).unwrap(),
    }
}

/// Returns the list at this place, such as `/modbus/0/sensors`.
fn list(json: &Json, place: &str) -> Vec<Json> {
    let list = json.pointer(place).and_then(Json::as_array);
    list.cloned().unwrap_or_default()
}

/// Returns the parts of a list that have these texts.
fn with<'a>(list: &'a [Json], texts: &[(&str, &str)]) -> Vec<&'a Json> {
    let has = |part: &&Json| texts.iter().all(|(key, text)| part[key] == *text);
    list.iter().filter(has).collect()
}

/// Returns a text of each part of a list.
fn texts_of(list: &[Json], key: &str) -> Vec<String> {
    let text = |part: &Json| part[key].as_str().map(str::to_owned);
    list.iter().filter_map(text).collect()
}

/// Compares a text with a file in `tests/export/`.
fn is_stored(text: &str, name: &str) {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export");
    let path = directory.join(name);
    if std::env::var_os("MODIOCTL_WRITE_EXPORTS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let stored = std::fs::read_to_string(&path).unwrap();
    assert!(text == stored, "{name} differs from the export:\n{text}");
}

#[test]
fn exports_equal_the_stored_files() {
    let line = Line {
        name: None,
        endpoint: &serial(),
        units: &[mixed()],
    };
    let export = |format| text(format, line).unwrap();
    is_stored(&export(HomeAssistant), "home-assistant.yaml");
    is_stored(&export(Telegraf), "telegraf.conf");
    let nodes = list(&parsed(NodeRed, &export(NodeRed)), "");
    let nodes: Vec<_> = nodes.iter().map(Json::to_string).collect();
    // A node in each line.
    is_stored(&format!("[\n{}\n]\n", nodes.join(",\n")), "node-red.json");
}

#[test]
fn table_has_a_row_for_each_kind_of_item() {
    let rows = [
        (
            digital(),
            "p1.1,0,bit,01 02,1,bool,1,0,,read,off | on,digital input,,1",
        ),
        (
            digital(),
            "p2.1,4,bit,01 02 05 0F,1,bool,1,0,,read write,off | on,digital output,,1",
        ),
        (
            analog(),
            "p5.1,16,word,03 04,1,int16,0.1,0,°C,read,°C,analog input,,1",
        ),
        (
            analog(),
            "p5.3,18,word,03 04 06 10,1,uint16,1,0,mV,read write,mV,analog output,,1",
        ),
        (
            analog(),
            "LORA_CHANNEL,322,word,03 04 06 10,1,uint16,1,410,MHz,read write restart,410 to 441 MHz,Channel of the LoRa module,,1",
        ),
        (
            analog(),
            "FRAME_GAP,262,word,03 04 06 10,1,uint16,0.1,0,ms,read write restart,\"0.2 to 100.0 ms, or 0\",Silence that ends a frame; 0 = t3.5,,1",
        ),
        (
            analog(),
            "uptime,520,word,03 04,2,uint32,1,0,s,read,s,Time since the start,,1",
        ),
        (
            analog(),
            "unique device identity,544,word,03 04,6,bytes,1,0,,read,,96 bits,,1",
        ),
        (
            analog(),
            "p5.1.pulses,800,word,03 04 10,2,uint32,1,0,,read write,only 0,Rising edges. Write 0 to both registers to clear,,1",
        ),
    ];
    for (book, row) in rows {
        let text = export_of(Csv, &book);
        assert!(text.starts_with("name,address,table,function,words,type,scale,offset,unit,access,values,about,line,unit_address\n"));
        assert!(text.lines().any(|line| line == row), "{row}: {text}");
    }
}

#[test]
fn json_has_the_endpoint_and_every_item() {
    let book = analog();
    let mut unit = parsed(ExportFormat::Json, &export_of(ExportFormat::Json, &book));
    let items = list(&unit, "/items");
    let names: Vec<_> = book.items().iter().map(|item| &item.name).collect();
    assert!(texts_of(&items, "name").iter().eq(names));
    unit.as_object_mut().unwrap().remove("items");
    assert_eq!(
        unit,
        json!({
            "board": "modio-02",
            "model": "LLD-ModbusIO-02",
            "firmware": "0.1.0",
            "map_version": 2,
            "source": "this program's register map",
            "endpoint": {
                "unit": 1, "port": "/dev/ttyUSB0", "baud": 9600, "format": "8N2", "mode": "rtu",
            },
        })
    );
    for item in [
        json!({
            "name": "p5.1", "address": 16, "table": "word", "words": 1, "unit": "°C",
            "values": "°C", "about": "analog input",
            "writable": false, "setting": false, "restart": false,
        }),
        json!({
            "name": "FORMAT", "address": 258, "table": "word", "words": 1, "unit": "",
            "values": "8N2 | 8E1 | 8O1 | 8N1 | 7E1 | 7O1 | 7N2",
            "about": "Data, parity and stop bits. 7 bits need MODE 1",
            "writable": true, "setting": true, "restart": true,
        }),
        json!({
            "name": "p5.1.beta", "address": 368, "table": "word", "words": 1, "unit": "K",
            "values": "it takes 2000 to 5000 K", "about": "Constant of an NTC",
            "writable": true, "setting": true, "restart": false,
        }),
        json!({
            "name": "uptime", "address": 520, "table": "word", "words": 2, "unit": "s",
            "values": "s", "about": "Time since the start",
            "writable": false, "setting": false, "restart": false,
        }),
    ] {
        assert!(items.contains(&item), "{item}");
    }
}

#[test]
fn exports_read_back_for_every_board_and_endpoint() {
    for book in [analog(), digital()] {
        for endpoint in [serial(), rtu_over_tcp(), modbus_tcp()] {
            let export = |format| export(format, &book, &endpoint).unwrap();
            let read = |format| parsed(format, &export(format));
            assert_eq!(read(ExportFormat::Json)["endpoint"]["unit"], 1);
            let flow = list(&read(NodeRed), "");
            let ids: BTreeSet<_> = texts_of(&flow, "id").into_iter().collect();
            assert_eq!(ids.len(), flow.len(), "the ids of nodes differ");
            let fields = list(&read(Telegraf), "/inputs/modbus/0/metric/0/fields");
            assert!(fields.len() > book.points().count());
            assert!(!list(&read(HomeAssistant), "/modbus/0/sensors").is_empty());
            assert_eq!(export(Csv).lines().count(), book.items().len() + 1);
        }
    }
}

#[test]
fn digital_points_are_switches_and_binary_sensors() {
    let yaml = parsed(HomeAssistant, &export_of(HomeAssistant, &digital()));
    let count = |kind: &str| list(&yaml["modbus"][0][kind], "").len();
    assert_eq!((count("binary_sensors"), count("switches")), (4, 12));
    assert!(yaml.get("template").is_none());
}

#[test]
fn endpoint_that_a_system_cannot_use_is_rejected() {
    let ascii = Endpoint::new(Place::Tcp("gateway:4196".to_owned()), Framing::Ascii);
    for format in [HomeAssistant, NodeRed] {
        let error = export(format, &analog(), &ascii).unwrap_err();
        assert!(error.contains("ASCII"), "{error}");
    }
    assert!(export(Telegraf, &analog(), &ascii).is_ok());
    let no_port = Endpoint::new(Place::ModbusTcp("gateway".to_owned()), Framing::Mbap);
    let error = export(HomeAssistant, &analog(), &no_port).unwrap_err();
    assert!(error.contains("port"), "{error}");
    assert!(export(Csv, &Book::default(), &serial()).is_err());
}

#[test]
fn units_of_a_line_share_one_hub_client_and_input() {
    let (analog, digital, inputs) = (analog(), digital(), modio_02(Module::Di4));
    let units = [(1, &analog), (2, &digital), (3, &inputs)];
    let export = |format| several(format, Some("Hall 2"), &units, &serial()).unwrap();
    let read = |format| parsed(format, &export(format));

    let yaml = read(HomeAssistant);
    assert_eq!(list(&yaml, "/modbus").len(), 1);
    assert_eq!(yaml["modbus"][0]["name"], "hall_2");
    let inputs = list(&yaml, "/modbus/0/binary_sensors");
    let of = |unit: u8| inputs.iter().filter(|input| input["slave"] == unit).count();
    assert_eq!((of(1), of(2), of(3)), (0, 4, 4));
    assert_eq!(inputs[4]["name"], "Hall 2 modio-02 3 p5.1");
    assert_eq!(inputs[4]["unique_id"], "hall_2_modio_02_3_p5_1");
    let number = &yaml["template"][0]["number"][0];
    let written = &number["set_value"][0]["data"]["value"];
    assert_eq!(written, "{{ value | round | int }}");
    assert_eq!(number["set_value"][0]["data"]["hub"], "hall_2");
    let state = "{{ states('sensor.hall_2_modio_02_1_p5_3') }}";
    assert_eq!(number["state"], state);

    let nodes = list(&read(NodeRed), "");
    let of_type = |name: &str| with(&nodes, &[("type", name)]).len();
    assert_eq!((of_type("modbus-client"), of_type("tab")), (1, 3));
    let servers = texts_of(&nodes, "server");
    assert!(servers.len() > 10 && servers.iter().all(|id| id == "hall_2_client"));
    let ids: BTreeSet<_> = texts_of(&nodes, "id").into_iter().collect();
    assert_eq!(ids.len(), nodes.len());
    let coils = |unit| with(&nodes, &[("type", "modbus-write"), ("unitid", unit)]).len();
    assert_eq!((coils("1"), coils("2"), coils("3")), (2, 12, 0));

    let inputs = list(&read(Telegraf), "/inputs/modbus");
    assert_eq!(texts_of(&inputs, "name"), ["Hall 2"]);
    let metrics = list(&inputs[0], "/metric");
    let ids: Vec<_> = metrics.iter().map(|metric| &metric["slave_id"]).collect();
    assert_eq!(ids, [1, 2, 3]);
    assert_eq!(metrics[1]["tags"]["board"], "modio-08");

    let rows = export(Csv);
    assert!(rows.trim_end().ends_with(",Hall 2,3"), "{rows}");
    let json = read(ExportFormat::Json);
    let addresses = [0, 1, 2].map(|n| &json[n]["endpoint"]["unit"]);
    assert_eq!(addresses, [1, 2, 3]);
    assert_eq!(json[2]["line"], "Hall 2");
}

#[test]
fn lines_with_names_have_no_ids_in_common() {
    let ids = |name| {
        let read = |format| {
            let text = several(format, name, &[(1, &analog())], &serial());
            parsed(format, &text.unwrap())
        };
        let hubs = list(&read(HomeAssistant), "/modbus");
        [
            texts_of(&list(&read(NodeRed), ""), "id"),
            texts_of(&list(&hubs[0], "/sensors"), "unique_id"),
            texts_of(&hubs, "name"),
            // As JSON, because the hub has the same name.
            vec![read(Telegraf)["inputs"]["modbus"][0]["name"].to_string()],
        ]
        .concat()
    };
    let names = [None, Some("a"), Some("b")];
    let all: BTreeSet<_> = names.into_iter().flat_map(ids).collect();
    assert_eq!(all.len(), 3 * ids(None).len());
}

/// Readers of YAML 1.1, as Home Assistant has, take these for a boolean and for numbers, unless they are quoted.
#[test]
fn every_text_in_yaml_is_quoted() {
    let book = analog();
    for name in ["yes", "1.0", "1_000"] {
        let yaml = several(HomeAssistant, Some(name), &[(1, &book)], &serial()).unwrap();
        for line in yaml.lines().filter(|line| !line.starts_with('#')) {
            let (_, value) = line.split_once(": ").unwrap_or_default();
            let is_number = value.is_empty() || value.parse::<f64>().is_ok();
            assert!(is_number || value.starts_with('"'), "{name}: {line}");
        }
    }
}

#[test]
fn items_with_the_same_id_are_refused() {
    let mut description = describe(&MODIO_02, "0.1.0", |_| Module::Di4);
    let registers = &mut description.registers;
    let status = registers.iter().find(|register| register.name == "status");
    let twice = status.unwrap().clone();
    registers.push(twice);
    let book = Book::new(description, vec![(0, 0); 32]);
    for format in FORMATS {
        let error = export(format, &book, &serial()).unwrap_err();
        assert!(error.contains("modio_02_1_status"), "{error}");
    }
}

#[test]
fn node_red_reads_each_port_with_its_own_request() {
    let nodes = list(&parsed(NodeRed, &export_of(NodeRed, &digital())), "");
    let coils = with(&nodes, &[("type", "modbus-read"), ("dataType", "Coil")]);
    let names: Vec<_> = coils.iter().map(|node| &node["name"]).collect();
    assert_eq!(names, ["p2.1 to p2.4", "p3.1 to p3.4", "p4.1 to p4.4"]);
}

#[test]
fn telegraf_reads_inputs_apart_only_where_connections_do_not_collide() {
    let plugins = |book: &Book, endpoint: &Endpoint| -> Vec<Vec<String>> {
        let toml = parsed(Telegraf, &export(Telegraf, book, endpoint).unwrap());
        let fields = |plugin| list(plugin, "/metric/0/fields");
        let plugins = list(&toml, "/inputs/modbus");
        plugins
            .iter()
            .map(|plugin| texts_of(&fields(plugin), "name"))
            .collect()
    };
    assert_eq!(plugins(&analog(), &serial()).len(), 1);
    let [rest, inputs] = &plugins(&analog(), &modbus_tcp())[..] else {
        panic!("two plugins");
    };
    assert_eq!(inputs, &["p5_1_celsius", "p5_2_uA"]);
    for name in ["p5_3_mV", "status", "uptime_s"] {
        assert!(rest.iter().any(|field| field == name), "{name}");
    }
    assert_eq!(plugins(&modio_02(Module::Do4), &modbus_tcp()).len(), 1);
}

#[test]
fn telegraf_gets_the_device_name_of_ports_from_com10_on() {
    for (port, controller) in [
        ("COM9", "COM9"),
        ("COM10", r"\\.\COM10"),
        ("com123", r"\\.\com123"),
        (r"\\.\COM10", r"\\.\COM10"),
        ("/dev/ttyS10", "file:///dev/ttyS10"),
    ] {
        let endpoint = Endpoint::new(Place::Serial(port.to_owned()), Framing::Rtu);
        let toml = parsed(Telegraf, &export(Telegraf, &analog(), &endpoint).unwrap());
        assert_eq!(toml["inputs"]["modbus"][0]["controller"], controller);
    }
}

/// Texts that change a configuration if they are not quoted, and any others.
fn texts() -> impl Strategy<Value = String> {
    let known = prop::sample::select(vec![
        "modio-02\n[[inputs.exec]]\ncommands = [\"id\"]\ndata_format = \"influx\"\n#",
        "x\ncommand_line:\n- sensor:\n    command: id\n#",
        "{{ states | list }}{% for x in y %}",
        "!include secrets.yaml",
        "\"]}, {\"id\": \"x\", \"type\": \"exec\", \"command\": \"id\"}]",
        "`${process.exit()}`\"; process.exit(); //",
        "${HOME} $HOME @{store:key}",
        "=cmd|' /C calc'!A0",
        "\u{1B}]0;x\u{7}\r\n\u{2028}",
    ]);
    prop_oneof![known.prop_map(str::to_owned), ".{1,40}"]
}

fn with_texts(mut unit: Description, texts: &[String]) -> Description {
    let mut texts = texts.iter().cycle().cloned();
    let mut next = || texts.next().unwrap_or_default();
    (unit.board, unit.model, unit.firmware) = (next(), next(), next());
    for kind in &mut unit.kinds {
        kind.name = next();
        kind.readings
            .iter_mut()
            .for_each(|reading| reading.unit.code = next());
    }
    unit.modules
        .iter_mut()
        .for_each(|module| module.name = next());
    for register in &mut unit.registers {
        register.about = next();
        match &mut register.value {
            Value::Number(unit) | Value::Long(unit) => unit.code = next(),
            Value::Codes(names) => names.iter_mut().for_each(|(_, name)| *name = next()),
            Value::Bits(names) => names.iter_mut().for_each(|(_, name)| *name = next()),
            Value::Opaque | Value::Point | Value::Fields { .. } => {}
        }
        // The exports select registers by these names.
        let is_exported = [
            "status",
            "uptime",
            "module state",
            "channel status",
            "pulses",
        ];
        if !is_exported.contains(&register.name.as_str()) {
            register.name = next();
        }
    }
    unit
}

/// Returns the keys of an export with the number of elements of each list; texts are left out.
fn shape(text: &str, format: ExportFormat) -> String {
    fn of(value: &Json) -> String {
        let of_list = |list: &Vec<Json>| list.iter().map(of).collect::<Vec<_>>().join(",");
        match value {
            Json::Object(map) => {
                let keys: Vec<_> = map.keys().collect();
                format!("{keys:?}[{}]", of_list(&map.values().cloned().collect()))
            }
            Json::Array(list) => format!("[{}]", of_list(list)),
            _ => "_".to_owned(),
        }
    }
    if format == Csv {
        // Every second part is outside of quotes.
        let outside: String = text.split('"').step_by(2).collect();
        return outside.chars().filter(|c| ",\n\r".contains(*c)).collect();
    }
    of(&parsed(format, text))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_text_of_a_unit_changes_the_structure_of_an_export(texts in prop::collection::vec(texts(), 1..8)) {
        // A sensor with one of these units has a device class in Home Assistant.
        prop_assume!(texts.iter().all(|text| !["uA", "mV", "Cel", "s"].contains(&text.as_str())));
        let unit = |texts: &[String]| {
            let unit = describe(&MODIO_02, "0.1.0", |_| Module::Ai2Ao2);
            Book::new(with_texts(unit, texts), vec![(0, 1); 32])
        };
        for format in FORMATS {
            let harmless = export_of(format, &unit(&["x".to_owned()]));
            let text = export_of(format, &unit(&texts));
            prop_assert_eq!(shape(&text, format), shape(&harmless, format));
            if matches!(format, HomeAssistant | Telegraf) {
                let is_evaluated = ["{{ states |", "{%", "${"].iter().any(|code| text.contains(code));
                prop_assert!(!is_evaluated, "{}", text);
                let comments = |text: &str| text.lines().filter(|line| line.starts_with('#')).count();
                prop_assert_eq!(comments(&text), 1);
            }
        }
    }
}

#[test]
fn masters_leave_the_silence_of_the_rate_between_frames() {
    let at = |baud, endpoint| Endpoint { baud, ..endpoint };
    for (endpoint, home_assistant, node_red, telegraf) in [
        (at(9600, rtu_over_tcp()), Some(6), 6, Some("6ms")),
        (at(115_200, rtu_over_tcp()), Some(3), 3, Some("3ms")),
        (serial(), None, 6, Some("6ms")),
        (at(1200, serial()), Some(34), 34, Some("34ms")),
        (modbus_tcp(), None, 1, None),
    ] {
        let read = |format| parsed(format, &export(format, &analog(), &endpoint).unwrap());
        let wait = &read(HomeAssistant)["modbus"][0]["message_wait_milliseconds"];
        assert_eq!(wait.as_u64(), home_assistant, "{endpoint:?}");
        let nodes = list(&read(NodeRed), "");
        let delay = nodes.iter().find_map(|node| node.get("commandDelay"));
        assert_eq!(delay, Some(&node_red.into()), "{endpoint:?}");
        let workarounds = &read(Telegraf)["inputs"]["modbus"][0]["workarounds"];
        let pause = workarounds["pause_between_requests"].as_str();
        assert_eq!(pause, telegraf, "{endpoint:?}");
    }
}
