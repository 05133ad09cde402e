//! Compares exports with the files in `tests/export/`, and parses them.
//!
//! After an intended change run `MODIOCTL_WRITE_EXPORTS=1 cargo test -p modioctl --test export`, then check the
//! differences.

use std::path::Path;
use std::time::Duration;

use modio_description::describe;
use modioctl::bus::adu::Framing;
use modioctl::bus::{Endpoint, Place};
use modioctl::cli::ExportFormat;
use modioctl::export::{Source, text};
use modioctl::names::Book;
use register_map::Module;
use register_map::board::{MODIO_02, MODIO_08};

const FORMATS: [(ExportFormat, &str); 5] = [
    (ExportFormat::Csv, "unit.csv"),
    (ExportFormat::Json, "unit.json"),
    (ExportFormat::HomeAssistant, "home-assistant.yaml"),
    (ExportFormat::Telegraf, "telegraf.conf"),
    (ExportFormat::NodeRed, "node-red.json"),
];

fn endpoint(place: Place, framing: Framing) -> Endpoint {
    Endpoint {
        place,
        baud: 9600,
        format: modioctl::bus::format::Format::default(),
        framing,
        unit: 1,
        timeout: Duration::from_secs(1),
        retries: 2,
        timeout_given: false,
    }
}

fn serial() -> Endpoint {
    endpoint(Place::Serial("/dev/ttyUSB0".to_owned()), Framing::Rtu)
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

fn export(format: ExportFormat, book: &Book, endpoint: &Endpoint) -> Result<String, String> {
    let source = Source {
        book,
        endpoint,
        source: "this program's register map",
    };
    text(format, source).map_err(|failure| failure.to_string())
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
        endpoint(Place::Tcp("gateway:4196".to_owned()), Framing::Rtu),
        endpoint(Place::ModbusTcp("[::1]:502".to_owned()), Framing::Mbap),
    ];
    for book in [analog(), digital()] {
        for endpoint in &places {
            let export = |format| export(format, &book, endpoint).unwrap();
            let json: serde_json::Value =
                serde_json::from_str(&export(ExportFormat::Json)).unwrap();
            assert_eq!(json["endpoint"]["unit"], 1);
            let flow: Vec<serde_json::Value> =
                serde_json::from_str(&export(ExportFormat::NodeRed)).unwrap();
            let ids: std::collections::BTreeSet<_> =
                flow.iter().map(|node| node["id"].to_string()).collect();
            assert_eq!(ids.len(), flow.len(), "the ids of nodes differ");
            let telegraf: toml::Table = export(ExportFormat::Telegraf).parse().unwrap();
            let fields = &telegraf["inputs"]["modbus"][0]["metric"][0]["fields"];
            assert!(fields.as_array().unwrap().len() > book.points().count());
            let yaml: serde_yaml_ng::Value =
                serde_yaml_ng::from_str(&export(ExportFormat::HomeAssistant)).unwrap();
            assert!(yaml["modbus"][0]["sensors"].is_sequence());
            let rows = export(ExportFormat::Csv).lines().count();
            assert_eq!(rows, book.items().len() + 1);
        }
    }
}

#[test]
fn digital_points_are_switches_and_binary_sensors() {
    let text = export(ExportFormat::HomeAssistant, &digital(), &serial()).unwrap();
    let yaml: serde_yaml_ng::Value = serde_yaml_ng::from_str(&text).unwrap();
    let count = |kind: &str| yaml["modbus"][0][kind].as_sequence().map_or(0, Vec::len);
    assert_eq!((count("binary_sensors"), count("switches")), (4, 12));
    assert!(yaml.get("template").is_none());
}

#[test]
fn endpoint_that_a_system_cannot_use_is_rejected() {
    let ascii = endpoint(Place::Tcp("gateway:4196".to_owned()), Framing::Ascii);
    for format in [ExportFormat::HomeAssistant, ExportFormat::NodeRed] {
        let error = export(format, &analog(), &ascii).unwrap_err();
        assert!(error.contains("ASCII"), "{error}");
    }
    assert!(export(ExportFormat::Telegraf, &analog(), &ascii).is_ok());
    let no_port = endpoint(Place::ModbusTcp("gateway".to_owned()), Framing::Mbap);
    let error = export(ExportFormat::HomeAssistant, &analog(), &no_port).unwrap_err();
    assert!(error.contains("port"), "{error}");
    assert!(export(ExportFormat::Csv, &Book::default(), &serial()).is_err());
}
