//! Names of serial ports that stay the same. `/dev/ttyUSB0` is the adapter that Linux finds first, which can be another one
//! after a restart. The system has links to the port in `/dev/serial`: in `by-id` by the maker, the product and the
//! serial number of the adapter, and in `by-path` by its USB socket.

use std::fs::{canonicalize, read_dir};
use std::path::Path;

use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo, available_ports};

/// Directory of the links.
const LINKS: &str = "/dev/serial";

/// Returns the name of a port that stays the same; `None` when the system has none, or when the port already has such a
/// name.
pub fn lasting_name(port: &str) -> Option<String> {
    lasting(&available_ports().ok()?, port, LINKS.as_ref())
}

/// Returns whether the name of a port is a number that the system gives away anew.
pub fn is_numbered(port: &str) -> bool {
    let name = port.rsplit_once('/').map_or(port, |(_, name)| name);
    ["ttyUSB", "ttyACM"]
        .iter()
        .any(|kind| name.starts_with(kind))
}

/// Returns whether the name of a port is that of a USB socket.
pub fn is_socket(port: &str) -> bool {
    port.contains("/by-path/")
}

/// Returns the name in `by-id` for an adapter with a serial number, and else that in `by-path`: adapters of one kind without
/// serial numbers, or with the same, have one name in `by-id` together.
fn lasting(ports: &[SerialPortInfo], port: &str, links: &Path) -> Option<String> {
    if !is_numbered(port) {
        return None;
    }
    let by_id = |port: &str| link(&links.join("by-id"), port);
    let own = ports
        .iter()
        .find(|info| info.port_name == port)
        .and_then(usb);
    let is_twin = |info: &&SerialPortInfo| info.port_name != port && usb(info) == own;
    let mut twins = ports.iter().filter(is_twin);
    let has_own_id = own.is_some_and(|usb| usb.serial_number.is_some())
        && twins.all(|twin| by_id(&twin.port_name).is_some());
    let id = has_own_id.then(|| by_id(port)).flatten();
    id.or_else(|| link(&links.join("by-path"), port))
}

/// Returns the link to a port in this directory.
fn link(links: &Path, port: &str) -> Option<String> {
    let port = canonicalize(port).ok()?;
    let paths = read_dir(links).ok()?.flatten().map(|entry| entry.path());
    let path = paths
        .filter(|path| canonicalize(path).is_ok_and(|target| target == port))
        .min()?;
    path.into_os_string().into_string().ok()
}

fn usb(info: &SerialPortInfo) -> Option<&UsbPortInfo> {
    match &info.port_type {
        SerialPortType::UsbPort(usb) => Some(usb),
        _ => None,
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::{create_dir, write};
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn adapter_without_its_own_serial_number_has_the_name_of_its_socket() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
        let [by_id, by_path] = ["by-id", "by-path"].map(|name| {
            create_dir(path(name)).unwrap();
            move |link: &str| format!("{name}/{link}")
        });
        let mut ports = Vec::new();
        let mut plug = |name: &str, serial: Option<&str>, id: Option<&str>| {
            write(path(name), "").unwrap();
            let target = format!("../{name}");
            // The adapter that is plugged in last has the link.
            if let Some(id) = id {
                symlink(&target, path(&by_id(id))).unwrap();
            }
            symlink(&target, path(&by_path(name))).unwrap();
            ports.push(SerialPortInfo {
                port_name: path(name),
                port_type: SerialPortType::UsbPort(UsbPortInfo {
                    vid: 0x1A86,
                    pid: 0x7523,
                    serial_number: serial.map(str::to_owned),
                    manufacturer: None,
                    product: None,
                }),
            });
        };
        plug("ttyUSB0", Some("A1"), Some("usb-FTDI_A1-if00"));
        plug("ttyUSB1", None, None);
        plug("ttyUSB2", None, Some("usb-1a86-if00"));
        plug("ttyACM0", Some("0001"), Some("usb-0001-if00"));
        plug("ttyACM1", Some("0001"), None);
        // The four ports of one adapter.
        plug("ttyUSB3", Some("B"), Some("usb-FTDI_B-if00"));
        plug("ttyUSB4", Some("B"), Some("usb-FTDI_B-if01"));
        for (name, lasts) in [
            ("ttyUSB0", Some(by_id("usb-FTDI_A1-if00"))),
            ("ttyUSB1", Some(by_path("ttyUSB1"))),
            ("ttyUSB2", Some(by_path("ttyUSB2"))),
            ("ttyACM0", Some(by_path("ttyACM0"))),
            ("ttyACM1", Some(by_path("ttyACM1"))),
            ("ttyUSB4", Some(by_id("usb-FTDI_B-if01"))),
            ("ttyUSB9", None),
            ("by-id/usb-FTDI_A1-if00", None),
        ] {
            let lasting = lasting(&ports, &path(name), folder.path());
            assert_eq!(lasting, lasts.map(|link| path(&link)), "{name}");
        }
    }
}
