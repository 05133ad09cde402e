//! `modioctl ports`.

use serde_json::json;
use serialport::{SerialPortInfo, SerialPortType, available_ports};

use crate::adapter::lasting_name;
use crate::failure::Failure;
use crate::output;

/// Lists the serial ports with the known data of their adapters, and the names that stay the same.
pub fn run(json: bool) -> Result<(), Failure> {
    let ports = available_ports().map_err(|error| {
        Failure::Port(format!(
            "the system does not list its serial ports: {error}"
        ))
    })?;
    if json {
        let each = ports.iter().map(|port| {
            json!({
                "port": port.port_name,
                "adapter": adapter(port),
                "serial": serial(port),
                "lasting_name": lasting_name(&port.port_name),
            })
        });
        return output::json(&each.collect::<Vec<_>>());
    }
    if ports.is_empty() {
        return output::line("no serial ports: is the adapter plugged in?");
    }
    let rows: Vec<_> = ports
        .iter()
        .map(|port| {
            let lasting = lasting_name(&port.port_name).unwrap_or_default();
            [port.port_name.clone(), adapter(port), serial(port), lasting]
        })
        .collect();
    output::table(&rows)
}

fn adapter(port: &SerialPortInfo) -> String {
    match &port.port_type {
        SerialPortType::UsbPort(usb) => {
            let name = [&usb.manufacturer, &usb.product];
            let name: Vec<_> = name.into_iter().flatten().map(String::as_str).collect();
            format!("USB {:04x}:{:04x} {}", usb.vid, usb.pid, name.join(" "))
        }
        SerialPortType::PciPort => "on board".to_owned(),
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::Unknown => "unknown".to_owned(),
    }
}

fn serial(port: &SerialPortInfo) -> String {
    match &port.port_type {
        SerialPortType::UsbPort(usb) => usb.serial_number.clone().unwrap_or_default(),
        _ => String::new(),
    }
}
