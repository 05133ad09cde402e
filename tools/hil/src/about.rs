//! The unit, the adapter, the computer and the date of a run, for the reports.

use std::fmt;
use std::path::Path;

use chrono::{SecondsFormat, Utc};
use register_map::state;
use serde_json::{Value, json};
use serialport::{SerialPortInfo, SerialPortType};

use conformance::bench::Bench;
use conformance::case::Check;
use conformance::target::{Modio, Span};

/// First version of the register map that has the registers of [`COMMIT`].
const MAP_WITH_COMMIT: u16 = 2;

/// Two registers with the first 32 bits of the commit that the image was built from, high word first, and one
/// whose bit 0 is set when the tree had uncommitted changes.
const COMMIT: u16 = 0x020C;

/// The circumstances of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Date and time of the begin in UTC, in the form of RFC 3339.
    pub date: String,
    /// Name, operating system and architecture of the computer.
    pub host: String,
    /// Version of this program.
    pub version: String,
    /// Commit that this program was built from.
    pub commit: String,
    /// The USB adapter of the port, if the port has one.
    pub adapter: Option<Adapter>,
    /// The unit, after it has answered.
    pub unit: Option<Unit>,
}

/// A USB serial adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// USB vendor and product identity, in hexadecimal: `0403:6001`.
    pub id: String,
    /// Name of the manufacturer and of the product, as far as the adapter reports them.
    pub name: String,
    /// Its serial number, if it has one.
    pub serial_number: Option<String>,
}

/// The unit, read from its registers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its address.
    pub address: u8,
    /// Version of its firmware.
    pub firmware: String,
    /// First 32 bits of the commit that its image was built from; `None` when its register map has no commit.
    pub commit: Option<String>,
    /// Its unique identity, in hexadecimal.
    pub identity: String,
    /// The modules in force in its slots.
    pub modules: Modio,
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

    /// Names and values, in the order in which they are reported.
    pub fn properties(&self) -> Vec<(&'static str, String)> {
        let mut all = vec![
            ("date", self.date.clone()),
            ("host", self.host.clone()),
            ("modio-hil", self.version.clone()),
            ("commit", self.commit.clone()),
        ];
        if let Some(adapter) = &self.adapter {
            all.push(("adapter", adapter.to_string()));
        }
        if let Some(unit) = &self.unit {
            all.push(("unit", unit.address.to_string()));
            all.push(("firmware", unit.firmware.clone()));
            all.extend(unit.commit.clone().map(|it| ("firmware commit", it)));
            all.push(("identity", unit.identity.clone()));
            all.push(("module", unit.modules.to_string()));
        }
        all
    }

    /// Returns the description in JSON. Unknown values are null.
    pub fn json(&self) -> Value {
        json!({
            "date": self.date,
            "host": self.host,
            "version": self.version,
            "commit": self.commit,
            "adapter": self.adapter.as_ref().map(|adapter| json!({
                "usb": adapter.id,
                "name": adapter.name,
                "serial_number": adapter.serial_number,
            })),
            "unit": self.unit.as_ref().map(|unit| json!({
                "address": unit.address,
                "firmware": unit.firmware,
                "commit": unit.commit,
                "identity": unit.identity,
                "module": unit.modules.to_string(),
            })),
        })
    }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.id, self.name)?;
        match &self.serial_number {
            Some(number) => write!(f, ", serial number {number}"),
            None => Ok(()),
        }
    }
}

impl Unit {
    /// Reads the registers of the unit, a modio with these modules.
    pub fn ask(bench: &mut Bench<'_>, modules: Modio) -> Check<Self> {
        let mut read = |first, count| bench.read_words(Span::of(first, count));
        let version = read(state::FIRMWARE_VERSION, 3)?;
        let [firmware, patch, map] = version[..] else {
            unreachable!("three registers were read");
        };
        let (commit, build) = if map < MAP_WITH_COMMIT {
            (None, 0)
        } else {
            let words = read(COMMIT, 3)?;
            let dirty = if words[2] & 1 == 0 { "" } else { "-dirty" };
            let commit = format!("{:04x}{:04x}{dirty}", words[0], words[1]);
            (Some(commit), words[2])
        };
        let identity = read(state::UNIQUE_ID, 6)?;
        Ok(Self {
            address: bench.unit(),
            firmware: state::version([firmware, patch], build).to_string(),
            commit,
            identity: identity.iter().map(|word| format!("{word:04X}")).collect(),
            modules,
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
        id: format!("{:04x}:{:04x}", usb.vid, usb.pid),
        name: names.join(" ").trim().to_owned(),
        serial_number: usb.serial_number.clone(),
    })
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

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
        for path in [&port, &link] {
            let shown = adapter(path, &ports).unwrap().to_string();
            let wanted = "0403:6001 FTDI FT232R USB UART, serial number A50285BI";
            assert_eq!(shown, wanted);
        }
        assert_eq!(adapter(Path::new("/dev/pts/3"), &ports), None);
    }

    #[test]
    fn run_is_described_in_json_and_in_properties() {
        let mut about = About::here(None, "89abcdef");
        assert!(about.date.ends_with('Z') && !about.host.is_empty());
        assert_eq!(about.json()["commit"], "89abcdef");
        about.unit = Some(Unit {
            address: 7,
            firmware: "1.2.3".to_owned(),
            commit: Some("0123abcd".to_owned()),
            identity: "00AA".to_owned(),
            modules: Modio {
                board: Some(&MODIO_08),
                modules: [Module::Do4; 8],
            },
        });
        let modules = "1=4do 2=4do 3=4do 4=4do";
        assert_eq!(about.json()["unit"]["module"], modules);
        let properties = about.properties();
        assert!(properties.contains(&("commit", "89abcdef".to_owned())));
        assert!(properties.contains(&("firmware commit", "0123abcd".to_owned())));
    }
}
