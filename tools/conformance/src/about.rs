//! The unit, the adapter, the computer and the date of a run, for the reports.

use std::path::Path;

use chrono::{SecondsFormat, Utc};
use register_map::state;
use serde::Serialize;
use serde_json::{Value, json};
use serialport::{SerialPortInfo, SerialPortType};

use crate::case::Stop;
use crate::endpoint::Broken;
use crate::target::{Modio, Span};
use crate::tester::Tester;

/// First version of the register map that has the registers of [`COMMIT`].
const MAP_WITH_COMMIT: u16 = 2;

/// Two registers with the first 32 bits of the commit that the image was built from, high word first, and one
/// whose bit 0 is set when the tree had uncommitted changes.
const COMMIT: u16 = 0x020C;

/// The circumstances of a run. Unknown values are null in JSON.
#[derive(Clone, Debug, Default, Serialize)]
pub struct About {
    /// Date and time of the begin in UTC, in the form of RFC 3339.
    date: String,
    /// Name, operating system and architecture of the computer.
    host: String,
    /// Version of this program.
    version: String,
    /// Commit that this program was built from.
    commit: String,
    /// The USB adapter of the port, if the port has one.
    adapter: Option<Adapter>,
    /// The unit, if it is a modio and has answered.
    pub unit: Option<Unit>,
}

/// A USB serial adapter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Adapter {
    /// USB vendor and product identity, in hexadecimal: `0403:6001`.
    usb: String,
    /// Name of the manufacturer and of the product, as far as the adapter reports them.
    name: String,
    serial_number: Option<String>,
}

/// The unit, read from its registers. `None` where its reply is wrong.
#[derive(Clone, Debug, Serialize)]
pub struct Unit {
    address: u8,
    /// Version of its firmware.
    firmware: Option<String>,
    /// First 32 bits of the commit that its image was built from; `None` when its register map has no commit.
    commit: Option<String>,
    /// Its unique identity, in hexadecimal.
    identity: Option<String>,
    /// The modules in force in its slots.
    module: String,
}

impl About {
    /// Describes this computer, this port, this instant, and the commit of this program. The unit is added later.
    pub fn here(port: Option<&Path>, commit: &str) -> Self {
        Self {
            date: Utc::now().to_rfc3339_opts(SecondsFormat::Secs, true),
            host: format!(
                "{}, {} {}",
                gethostname::gethostname().to_string_lossy(),
                std::env::consts::OS,
                std::env::consts::ARCH
            ),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: commit.to_owned(),
            // If the ports cannot be listed, the report names no adapter.
            adapter: port.and_then(|port| adapter(port, &serialport::available_ports().ok()?)),
            unit: None,
        }
    }

    /// Returns names and values for people, such as `unit firmware` and `1.2.3`.
    pub fn properties(&self) -> Vec<(String, String)> {
        let mut all = Vec::new();
        add("", &json!(self), &mut all);
        all
    }
}

/// Adds the known values below a name.
fn add(name: &str, value: &Value, all: &mut Vec<(String, String)>) {
    match value {
        Value::Null => {}
        Value::Object(inner) => {
            for (key, value) in inner {
                add(format!("{name} {key}").trim_start(), value, all);
            }
        }
        Value::String(text) => all.push((name.to_owned(), text.clone())),
        other => all.push((name.to_owned(), other.to_string())),
    }
}

impl Unit {
    /// Reads the registers of the unit, a modio with these modules. A wrong reply is for the cases to find.
    pub fn ask(tester: &mut Tester<'_>, modules: Modio) -> Result<Self, Broken> {
        let mut read = |first, count| match tester.read_words(Span::of(first, count)) {
            Ok(words) => Ok(Some(words)),
            Err(Stop::Broken(broken)) => Err(broken),
            Err(Stop::Fail(_) | Stop::Skip(_)) => Ok(None),
        };
        let version = read(state::FIRMWARE_VERSION, 3)?;
        let has_commit = version.as_ref().is_some_and(|v| v[2] >= MAP_WITH_COMMIT);
        let commit = if has_commit { read(COMMIT, 3)? } else { None };
        let build = commit.as_ref().map_or(0, |words| words[2]);
        let identity = read(state::UNIQUE_ID, 6)?;
        Ok(Self {
            address: tester.unit(),
            firmware: version.map(|v| state::version([v[0], v[1]], build).to_string()),
            commit: commit.map(|words| {
                let dirty = if words[2] & 1 == 0 { "" } else { "-dirty" };
                format!("{:04x}{:04x}{dirty}", words[0], words[1])
            }),
            identity: identity.map(|words| words.iter().map(|w| format!("{w:04X}")).collect()),
            module: modules.to_string(),
        })
    }
}

/// Returns the adapter of this port. The path may be a link to the port.
fn adapter(port: &Path, ports: &[SerialPortInfo]) -> Option<Adapter> {
    let name = port.canonicalize().unwrap_or_else(|_| port.to_owned());
    let found = ports.iter().find(|one| Path::new(&one.port_name) == name)?;
    let SerialPortType::UsbPort(usb) = &found.port_type else {
        return None;
    };
    let names = [&usb.manufacturer, &usb.product].map(|name| name.clone().unwrap_or_default());
    Some(Adapter {
        usb: format!("{:04x}:{:04x}", usb.vid, usb.pid),
        name: names.join(" ").trim().to_owned(),
        serial_number: usb.serial_number.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    fn usb(port_name: &str, serial_number: Option<&str>) -> SerialPortInfo {
        SerialPortInfo {
            port_name: port_name.to_owned(),
            port_type: SerialPortType::UsbPort(serialport::UsbPortInfo {
                vid: 0x0403,
                pid: 0x6001,
                serial_number: serial_number.map(str::to_owned),
                manufacturer: Some("FTDI".to_owned()),
                product: Some("FT232R USB UART".to_owned()),
            }),
        }
    }

    #[cfg(unix)]
    #[test]
    fn adapter_is_found_by_its_port_and_by_a_link_to_the_port() {
        let directory = tempfile::tempdir().unwrap();
        let directory = directory.path().canonicalize().unwrap();
        let (port, link) = (directory.join("ttyUSB0"), directory.join("by-id"));
        std::fs::write(&port, "").unwrap();
        std::os::unix::fs::symlink(&port, &link).unwrap();
        let ports = [
            usb("/dev/ttyUSB7", None),
            usb(&port.to_string_lossy(), Some("A50285BI")),
        ];
        let wanted = Adapter {
            usb: "0403:6001".to_owned(),
            name: "FTDI FT232R USB UART".to_owned(),
            serial_number: Some("A50285BI".to_owned()),
        };
        for path in [&port, &link] {
            assert_eq!(adapter(path, &ports), Some(wanted.clone()));
        }
        assert_eq!(adapter(Path::new("/dev/pts/3"), &ports), None);
    }

    #[test]
    fn run_is_described_in_json_and_in_properties() {
        let mut about = About::here(None, "89abcdef");
        assert!(about.date.ends_with('Z') && !about.host.is_empty());
        about.unit = Some(Unit {
            address: 7,
            firmware: Some("1.2.3".to_owned()),
            commit: None,
            identity: Some("00AA".to_owned()),
            module: "4do".to_owned(),
        });
        let json = json!(about);
        assert_eq!(
            (&json["commit"], &json["unit"]["address"]),
            (&json!("89abcdef"), &json!(7))
        );
        assert!(json["adapter"].is_null() && json["unit"]["commit"].is_null());
        let properties = about.properties();
        for wanted in [
            ("commit", "89abcdef"),
            ("unit address", "7"),
            ("unit firmware", "1.2.3"),
        ] {
            let right =
                |(name, value): &(String, String)| (name.as_str(), value.as_str()) == wanted;
            assert!(properties.iter().any(right), "{wanted:?}: {properties:?}");
        }
        assert!(
            properties.iter().all(|(name, _)| name != "unit commit"),
            "{properties:?}"
        );
    }
}
