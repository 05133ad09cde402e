//! `modioctl scan`.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::info::identity;
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Found, Master, Observer, SHORT};
use crate::cli::Scan;
use crate::device::{Device, known, place};
use crate::failure::Failure;
use crate::output;

/// A unit that was found.
struct Unit {
    address: u8,
    baud: u32,
    format: String,
    identity: String,
    modules: String,
}

/// Looks for units at the requested rates and formats.
///
/// # Errors
///
/// When no unit was found, or when only garbled answers were received.
pub async fn run(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &Scan,
    json: bool,
) -> Result<(), Failure> {
    let serial = endpoint.place.is_serial();
    if !serial && (options.rates.is_some() || options.formats.is_some()) {
        return Err(Failure::usage(
            "--rates and --formats are for a serial port: over TCP the gateway has the line's settings",
        ));
    }
    let rates = options
        .rates
        .as_ref()
        .map_or(vec![endpoint.baud], |rates| rates.0.clone());
    let formats = options
        .formats
        .as_ref()
        .map_or(vec![endpoint.format], |formats| formats.0.clone());
    let units = &options.units.0;
    let bar = progress(units.len() * rates.len() * formats.len());
    let mut master = Master::open(endpoint, observer).await?;
    let mut all = Vec::new();
    let mut garbled = Vec::new();
    for baud in rates {
        for format in &formats {
            let now = master.endpoint();
            if (now.baud, now.format) != (baud, *format) {
                let next = Endpoint {
                    baud,
                    format: *format,
                    ..now.clone()
                };
                master = master.reopen(next).await?;
            }
            if serial {
                bar.set_message(format!("{baud} bit/s {format}"));
            }
            let found = sweep(&mut master, units, &bar).await?;
            for address in &found.garbled {
                garbled.push(format!("{address} ({})", place(master.endpoint())));
            }
            for address in found.units {
                let mut device = Device {
                    master,
                    unit: address,
                    refresh: false,
                };
                let unit = look_at(&mut device).await;
                master = device.master;
                match unit {
                    Ok(unit) => all.push(unit),
                    Err(Failure::Garbled(_)) if !found.garbled.contains(&address) => {
                        garbled.push(format!("{address} ({})", place(master.endpoint())));
                    }
                    Err(Failure::Garbled(_)) => {}
                    Err(failure) => return Err(failure),
                }
            }
        }
    }
    bar.finish_and_clear();
    print(&all, &garbled, serial, json)?;
    match (all.is_empty(), garbled.is_empty()) {
        (false, _) => Ok(()),
        (true, false) => Err(Failure::Garbled(
            "no unit could be read: wrong rate or format, two units with one address, or no termination".to_owned(),
        )),
        (true, true) => Err(Failure::NoAnswer(
            "no unit found: check power, wiring (A and B swapped?) and rate (`--rates all`); a unit's address is its DIP switch".to_owned(),
        )),
    }
}

async fn sweep(master: &mut Master, units: &[u8], bar: &ProgressBar) -> Result<Found, Failure> {
    let endpoint = master.endpoint();
    // A gateway waits for its units itself, and reports when a unit is missing.
    let wait = match endpoint.framing {
        Framing::Mbap => endpoint.timeout,
        _ if endpoint.timeout_given => endpoint.timeout,
        _ => SHORT,
    };
    let place = place(endpoint);
    master
        .sweep(units, wait, |_| bar.inc(1))
        .await
        .map_err(|error| Failure::Port(format!("{place} is lost ({error})")))
}

/// Reads the identity of a unit.
///
/// # Errors
///
/// When its answers are garbled, as those of two units with one address are, or when the port is lost.
async fn look_at(device: &mut Device) -> Result<Unit, Failure> {
    // Use what the unit does answer, even if it does not answer every request.
    fn answered<T: Default>(result: Result<T, Failure>) -> Result<T, Failure> {
        match result {
            Err(Failure::Refused(_) | Failure::NoAnswer(_)) => Ok(T::default()),
            other => other,
        }
    }
    let objects = answered(identity(device).await)?;
    let object = |name: &str| {
        let found = objects.iter().find(|(known, _)| known == name);
        found.map(|(_, text)| text.as_str()).unwrap_or_default()
    };
    let identity = ["vendor", "product", "revision"].map(object).join(" ");
    let identity = identity.trim();
    let description = answered(known(device).await)?;
    let modules = match description {
        None => String::new(),
        Some(description) => {
            let name = |code| {
                description
                    .modules
                    .iter()
                    .find(|module| module.code == code)
            };
            let ports = description.ports.iter().map(|port| {
                let name = name(port.module).map_or("unknown", |module| &module.name);
                format!("p{} {name}", port.number)
            });
            ports.collect::<Vec<_>>().join(", ")
        }
    };
    let endpoint = device.master.endpoint();
    Ok(Unit {
        address: device.unit,
        baud: endpoint.baud,
        format: endpoint.format.to_string(),
        identity: if identity.is_empty() {
            "no identification".to_owned()
        } else {
            identity.to_owned()
        },
        modules,
    })
}

fn print(all: &[Unit], garbled: &[String], serial: bool, json: bool) -> Result<(), Failure> {
    if json {
        let units = all.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "baud": serial.then_some(unit.baud),
                "format": serial.then_some(&unit.format),
                "identity": unit.identity,
                "modules": unit.modules,
            })
        });
        return output::json(&json!({ "units": units.collect::<Vec<_>>(), "garbled": garbled }));
    }
    let rows: Vec<_> = all
        .iter()
        .map(|unit| {
            let line = if serial {
                format!("{} {}", unit.baud, unit.format)
            } else {
                String::new()
            };
            [
                unit.address.to_string(),
                line,
                unit.identity.clone(),
                unit.modules.clone(),
            ]
        })
        .collect();
    if !rows.is_empty() {
        output::table(&rows)?;
    }
    for at in garbled {
        output::line(format_args!(
            "something answers, but garbled, at address {at}"
        ))?;
    }
    Ok(())
}

/// Returns a progress bar on standard error, hidden when that is not a terminal.
fn progress(steps: usize) -> ProgressBar {
    let bar = ProgressBar::new(steps as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg} {eta}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
