//! Compares exports with the files in `tests/export/`, and parses them.
//!
//! After an intended change run `MODIOCTL_WRITE_EXPORTS=1 cargo test -p modioctl --test export`, then check the
//! differences.

use std::path::Path;

use modio_description::{Description, Value, describe};
use modioctl::bus::adu::Framing;
use modioctl::bus::{Endpoint, Place};
use modioctl::export::{ExportFormat, Line, Source, text};
use modioctl::names::Book;
use proptest::prelude::*;
use register_map::Module;
use register_map::board::{MODIO_02, MODIO_08};

const FORMATS: [(ExportFormat, &str); 5] = [
    (ExportFormat::Csv, "unit.csv"),
    (ExportFormat::Json, "unit.json"),
    (ExportFormat::HomeAssistant, "home-assistant.yaml"),
    (ExportFormat::Telegraf, "telegraf.conf"),
    (ExportFormat::NodeRed, "node-red.json"),
];

fn serial() -> Endpoint {
    Endpoint::new(Place::Serial("/dev/ttyUSB0".to_owned()), Framing::Rtu)
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

/// A modio-02 with four digital inputs, which count pulses.
fn inputs() -> Book {
    let unit = describe(&MODIO_02, "0.1.0", |_| Module::Di4);
    Book::new(unit, vec![(0, 0); 32])
}

fn export(format: ExportFormat, book: &Book, endpoint: &Endpoint) -> Result<String, String> {
    several(format, None, &[(1, book)], endpoint)
}

fn several(
    format: ExportFormat,
    name: Option<&str>,
    books: &[(u8, &Book)],
    endpoint: &Endpoint,
) -> Result<String, String> {
    let units: Vec<_> = books
        .iter()
        .map(|(unit, book)| Source {
            unit: *unit,
            book: (*book).clone(),
            source: "this program's register map".to_owned(),
        })
        .collect();
    let line = Line {
        name,
        endpoint,
        units: &units,
    };
    text(format, line).map_err(|failure| failure.to_string())
}

fn yaml(text: &str) -> serde_yaml_ng::Value {
    serde_yaml_ng::from_str(text).unwrap()
}

fn toml(text: &str) -> toml::Table {
    text.parse().unwrap()
}

fn nodes(text: &str) -> Vec<serde_json::Value> {
    serde_json::from_str(text).unwrap()
}

#[test]
fn exports_equal_the_stored_files() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export");
    for (format, name) in FORMATS {
        let text = export(format, &analog(), &serial()).unwrap();
        let path = directory.join(name);
        if std::env::var_os("MODIOCTL_WRITE_EXPORTS").is_some() {
            std::fs::write(&path, &text).unwrap();
        }
        let stored = std::fs::read_to_string(&path).unwrap();
        assert!(text == stored, "{name} differs from the export:\n{text}");
    }
}

#[test]
fn exports_read_back_for_every_board_and_endpoint() {
    let places = [
        serial(),
        Endpoint::new(Place::Tcp("gateway:4196".to_owned()), Framing::Rtu),
        Endpoint::new(Place::ModbusTcp("[::1]:502".to_owned()), Framing::Mbap),
    ];
    for book in [analog(), digital()] {
        for endpoint in &places {
            let export = |format| export(format, &book, endpoint).unwrap();
            let json: serde_json::Value =
                serde_json::from_str(&export(ExportFormat::Json)).unwrap();
            assert_eq!(json["endpoint"]["unit"], 1);
            let flow = nodes(&export(ExportFormat::NodeRed));
            let ids: std::collections::BTreeSet<_> =
                flow.iter().map(|node| node["id"].to_string()).collect();
            assert_eq!(ids.len(), flow.len(), "the ids of nodes differ");
            let telegraf = toml(&export(ExportFormat::Telegraf));
            let fields = &telegraf["inputs"]["modbus"][0]["metric"][0]["fields"];
            assert!(fields.as_array().unwrap().len() > book.points().count());
            let yaml = yaml(&export(ExportFormat::HomeAssistant));
            assert!(yaml["modbus"][0]["sensors"].is_sequence());
            let rows = export(ExportFormat::Csv).lines().count();
            assert_eq!(rows, book.items().len() + 1);
        }
    }
}

#[test]
fn digital_points_are_switches_and_binary_sensors() {
    let yaml = yaml(&export_of(ExportFormat::HomeAssistant, &digital()));
    let count = |kind: &str| yaml["modbus"][0][kind].as_sequence().map_or(0, Vec::len);
    assert_eq!((count("binary_sensors"), count("switches")), (4, 12));
    assert!(yaml.get("template").is_none());
}

#[test]
fn endpoint_that_a_system_cannot_use_is_rejected() {
    let ascii = Endpoint::new(Place::Tcp("gateway:4196".to_owned()), Framing::Ascii);
    for format in [ExportFormat::HomeAssistant, ExportFormat::NodeRed] {
        let error = export(format, &analog(), &ascii).unwrap_err();
        assert!(error.contains("ASCII"), "{error}");
    }
    assert!(export(ExportFormat::Telegraf, &analog(), &ascii).is_ok());
    let no_port = Endpoint::new(Place::ModbusTcp("gateway".to_owned()), Framing::Mbap);
    let error = export(ExportFormat::HomeAssistant, &analog(), &no_port).unwrap_err();
    assert!(error.contains("port"), "{error}");
    assert!(export(ExportFormat::Csv, &Book::default(), &serial()).is_err());
}

#[test]
fn units_of_a_line_share_one_hub_client_and_input() {
    let (analog, digital, inputs) = (analog(), digital(), inputs());
    let units = [(1, &analog), (2, &digital), (3, &inputs)];
    let export = |format| several(format, Some("Hall 2"), &units, &serial()).unwrap();

    let yaml = yaml(&export(ExportFormat::HomeAssistant));
    assert_eq!(yaml["modbus"].as_sequence().unwrap().len(), 1);
    let hub = &yaml["modbus"][0];
    assert_eq!(hub["name"], "hall_2");
    let inputs = hub["binary_sensors"].as_sequence().unwrap();
    let of = |unit: u8| inputs.iter().filter(|input| input["slave"] == unit).count();
    assert_eq!((of(1), of(2), of(3)), (0, 4, 4));
    assert_eq!(inputs[4]["name"], "Hall 2 modio-02 3 p5.1");
    assert_eq!(inputs[4]["unique_id"], "hall_2_modio_02_3_p5_1");
    let number = &yaml["template"][0]["number"][0];
    assert_eq!(number["set_value"][0]["data"]["hub"], "hall_2");
    let state = "{{ states('sensor.hall_2_modio_02_1_p5_3') }}";
    assert_eq!(number["state"], state);

    let nodes = nodes(&export(ExportFormat::NodeRed));
    let of_type = |name: &str| nodes.iter().filter(|node| node["type"] == name).count();
    assert_eq!((of_type("modbus-client"), of_type("tab")), (1, 3));
    let servers = nodes.iter().filter_map(|node| node.get("server"));
    assert!(servers.clone().count() > 10 && servers.clone().all(|id| id == "hall_2_client"));
    let ids: std::collections::BTreeSet<_> = nodes.iter().map(|node| node["id"].as_str()).collect();
    assert_eq!(ids.len(), nodes.len());
    let coil = |unit: &str| {
        let is_coil =
            |node: &&serde_json::Value| node["type"] == "modbus-write" && node["unitid"] == unit;
        nodes.iter().filter(is_coil).count()
    };
    assert_eq!((coil("1"), coil("2"), coil("3")), (2, 12, 0));

    let toml = toml(&export(ExportFormat::Telegraf));
    let inputs = toml["inputs"]["modbus"].as_array().unwrap();
    assert_eq!(
        (inputs.len(), inputs[0]["name"].as_str()),
        (1, Some("Hall 2"))
    );
    let metrics = inputs[0]["metric"].as_array().unwrap();
    let ids: Vec<_> = metrics
        .iter()
        .map(|metric| metric["slave_id"].as_integer().unwrap())
        .collect();
    assert_eq!(ids, [1, 2, 3]);
    assert_eq!(metrics[1]["tags"]["board"].as_str(), Some("modio-08"));

    let rows = export(ExportFormat::Csv);
    assert!(
        rows.lines().last().unwrap().ends_with(",Hall 2,3"),
        "{rows}"
    );
    let json: serde_json::Value = serde_json::from_str(&export(ExportFormat::Json)).unwrap();
    let addresses = [0, 1, 2].map(|n| json[n]["endpoint"]["unit"].as_u64().unwrap());
    assert_eq!(
        (addresses, json[2]["line"].as_str()),
        ([1, 2, 3], Some("Hall 2"))
    );
}

#[test]
fn lines_with_names_have_no_ids_in_common() {
    let ids = |name| {
        let export = |format| several(format, name, &[(1, &analog())], &serial()).unwrap();
        let nodes = nodes(&export(ExportFormat::NodeRed));
        let mut ids: Vec<_> = nodes.iter().map(|node| node["id"].to_string()).collect();
        let yaml = yaml(&export(ExportFormat::HomeAssistant));
        let sensors = yaml["modbus"][0]["sensors"].as_sequence().unwrap();
        ids.extend(
            sensors
                .iter()
                .map(|s| s["unique_id"].as_str().unwrap().to_owned()),
        );
        ids.push(yaml["modbus"][0]["name"].as_str().unwrap().to_owned());
        let toml = toml(&export(ExportFormat::Telegraf));
        ids.push(toml["inputs"]["modbus"][0]["name"].to_string());
        ids
    };
    let names = [None, Some("a"), Some("b")];
    let all: std::collections::BTreeSet<_> = names.into_iter().flat_map(ids).collect();
    assert_eq!(all.len(), 3 * ids(None).len());
}

#[test]
fn pulses_of_inputs_are_counters() {
    let export = |format| export(format, &inputs(), &serial()).unwrap();
    let yaml = yaml(&export(ExportFormat::HomeAssistant));
    let sensors = yaml["modbus"][0]["sensors"].as_sequence().unwrap();
    let is_counter = |sensor: &&serde_yaml_ng::Value| sensor["state_class"] == "total_increasing";
    let counters: Vec<_> = sensors.iter().filter(is_counter).collect();
    assert_eq!(counters.len(), 4);
    assert_eq!(counters[1]["name"], "modio-02 1 p5.2.pulses");
    assert_eq!(counters[1]["address"], 0x0322);
    assert_eq!(counters[1]["data_type"], "uint32");

    let nodes = nodes(&export(ExportFormat::NodeRed));
    let of_type = |node: &&serde_json::Value| node["type"] == "modbus-read" && node["adr"] == "800";
    let read = nodes.iter().find(of_type).unwrap();
    assert_eq!(
        (&read["quantity"], &read["rate"]),
        (&"8".into(), &"10".into())
    );

    let toml = toml(&export(ExportFormat::Telegraf));
    let fields = toml["inputs"]["modbus"][0]["metric"][0]["fields"]
        .as_array()
        .unwrap();
    let names = fields
        .iter()
        .filter(|field| field["name"].as_str().unwrap().ends_with("_pulses"));
    assert!(
        names
            .clone()
            .all(|field| field["type"].as_str() == Some("UINT32"))
    );
    assert_eq!(names.count(), 4);
    // Outputs and analog points have registers for pulses, too, which stay at 0.
    assert!(!export_of(ExportFormat::Telegraf, &analog()).contains("pulses"));
}

fn export_of(format: ExportFormat, book: &Book) -> String {
    export(format, book, &serial()).unwrap()
}

#[test]
fn node_red_reads_each_port_with_its_own_request() {
    let nodes = nodes(&export_of(ExportFormat::NodeRed, &digital()));
    let coils =
        |node: &&serde_json::Value| node["type"] == "modbus-read" && node["dataType"] == "Coil";
    let names: Vec<_> = nodes
        .iter()
        .filter(coils)
        .map(|node| node["name"].as_str())
        .collect();
    assert_eq!(
        names,
        [
            Some("p2.1 to p2.4"),
            Some("p3.1 to p3.4"),
            Some("p4.1 to p4.4")
        ]
    );
}

#[test]
fn telegraf_reads_inputs_apart_only_where_connections_do_not_collide() {
    let tcp = Endpoint::new(Place::ModbusTcp("[::1]:502".to_owned()), Framing::Mbap);
    let plugins = |book: &Book, endpoint: &Endpoint| -> Vec<Vec<String>> {
        let toml = toml(&export(ExportFormat::Telegraf, book, endpoint).unwrap());
        let names = |plugin: &toml::Value| {
            let fields = plugin["metric"][0]["fields"].as_array().unwrap();
            fields
                .iter()
                .map(|field| field["name"].as_str().unwrap().to_owned())
                .collect()
        };
        toml["inputs"]["modbus"]
            .as_array()
            .unwrap()
            .iter()
            .map(names)
            .collect()
    };
    assert_eq!(plugins(&analog(), &serial()).len(), 1);
    let [rest, inputs] = &plugins(&analog(), &tcp)[..] else {
        panic!("two plugins");
    };
    assert_eq!(inputs, &["p5_1_celsius", "p5_2_uA"]);
    assert!(
        ["p5_3_mV", "status", "uptime_s"]
            .iter()
            .all(|name| rest.contains(&(*name).to_owned()))
    );
    let outputs = Book::new(
        describe(&MODIO_02, "0.1.0", |_| Module::Do4),
        vec![(0, 0); 32],
    );
    assert_eq!(plugins(&outputs, &tcp).len(), 1);
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
        let toml = toml(&export(ExportFormat::Telegraf, &analog(), &endpoint).unwrap());
        let modbus = &toml["inputs"]["modbus"][0];
        assert_eq!(modbus["controller"].as_str(), Some(controller));
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
            Value::Opaque => {}
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
    fn of(value: &serde_json::Value) -> String {
        match value {
            serde_json::Value::Object(map) => {
                let each = map
                    .iter()
                    .map(|(key, value)| format!("{key}:{}", of(value)));
                format!("{{{}}}", each.collect::<Vec<_>>().join(","))
            }
            serde_json::Value::Array(list) => {
                format!("[{}]", list.iter().map(of).collect::<Vec<_>>().join(","))
            }
            _ => "_".to_owned(),
        }
    }
    let json = match format {
        ExportFormat::Csv => {
            // Every second part is outside of quotes.
            let outside: String = text.split('"').step_by(2).collect();
            return outside.chars().filter(|c| ",\n\r".contains(*c)).collect();
        }
        ExportFormat::Json | ExportFormat::NodeRed => serde_json::from_str(text).unwrap(),
        ExportFormat::HomeAssistant => serde_json::to_value(yaml(text)).unwrap(),
        ExportFormat::Telegraf => serde_json::to_value(toml(text)).unwrap(),
    };
    of(&json)
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
        for (format, _) in FORMATS {
            let harmless = export_of(format, &unit(&["x".to_owned()]));
            let text = export_of(format, &unit(&texts));
            prop_assert_eq!(shape(&text, format), shape(&harmless, format));
            if matches!(format, ExportFormat::HomeAssistant | ExportFormat::Telegraf) {
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
    let pauses = |endpoint: &Endpoint| {
        let export = |format| export(format, &analog(), endpoint).unwrap();
        let hub = &yaml(&export(ExportFormat::HomeAssistant))["modbus"][0];
        let nodes = nodes(&export(ExportFormat::NodeRed));
        let delay = nodes
            .iter()
            .find_map(|node| node.get("commandDelay")?.as_u64());
        let input = &toml(&export(ExportFormat::Telegraf))["inputs"]["modbus"][0];
        let pause = input
            .get("workarounds")
            .map(|w| w["pause_between_requests"].to_string());
        (hub["message_wait_milliseconds"].as_u64(), delay, pause)
    };
    let pause = |millis: u64| Some(format!("\"{millis}ms\""));
    let at = |place: &str, baud| Endpoint {
        baud,
        ..Endpoint::new(Place::Tcp(place.to_owned()), Framing::Rtu)
    };
    assert_eq!(
        pauses(&at("gateway:4196", 9600)),
        (Some(6), Some(6), pause(6))
    );
    assert_eq!(
        pauses(&at("gateway:4196", 115_200)),
        (Some(3), Some(3), pause(3))
    );
    assert_eq!(pauses(&serial()), (None, Some(6), pause(6)));
    let slow = Endpoint {
        baud: 1200,
        ..serial()
    };
    assert_eq!(pauses(&slow), (Some(34), Some(34), pause(34)));
    let tcp = Endpoint::new(Place::ModbusTcp("[::1]:502".to_owned()), Framing::Mbap);
    assert_eq!(pauses(&tcp), (None, Some(1), None));
}
