//! `modioctl scan`.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::info::identity;
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Found, LONG, Master, Observer, Place, SHORT};
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

/// What has been found, also when Ctrl-C ends the scan.
#[derive(Default)]
struct Scanned {
    units: Vec<Unit>,
    garbled: Vec<String>,
    /// Lines on which bytes were received all the time.
    never_silent: Vec<String>,
    /// Units that answered at the rate and format of `place` and have not been looked at.
    found: Found,
    /// The present line.
    line: Option<Endpoint>,
    echo: bool,
}

/// Looks for units at the requested rates and formats. Ctrl-C ends the scan, and keeps what was found. Returns whether
/// the scan has ended by itself.
///
/// # Errors
///
/// When no unit was found, or when only garbled answers were received.
pub async fn run(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &Scan,
    json: bool,
) -> Result<bool, Failure> {
    let serial = endpoint.place.is_serial();
    if !serial && (options.rates.is_some() || options.formats.is_some()) {
        return Err(Failure::usage(
            "--rates and --formats are for a serial port: over TCP the gateway has the line's settings",
        ));
    }
    let mut scanned = Scanned::default();
    let bar = progress();
    let complete = tokio::select! {
        // Ctrl-C is handled before the scan begins.
        biased;
        _ = tokio::signal::ctrl_c() => false,
        result = search(endpoint, observer, options, &bar, &mut scanned) => {
            result?;
            true
        }
    };
    bar.finish_and_clear();
    if !complete {
        scanned.keep_found();
    }
    print(&scanned, serial, json)?;
    let garbled = !scanned.garbled.is_empty() || !scanned.never_silent.is_empty();
    match (scanned.units.is_empty(), !garbled) {
        _ if !complete => Ok(false),
        (false, _) => Ok(true),
        (true, false) => Err(Failure::Garbled(
            "no unit could be read: wrong rate or format, two units with one address, or no termination".to_owned(),
        )),
        (true, true) => Err(Failure::NoAnswer(format!(
            "no unit found{}: check power, wiring (A and B swapped?) and rate (`--rates all`); a unit's address is its DIP switch; a unit with a long RESPONSE_DELAY or over the air needs a longer `--timeout`",
            if scanned.echo {
                ", and the adapter returns what it sends, which is not an answer"
            } else {
                ""
            }
        ))),
    }
}

async fn search(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &Scan,
    bar: &ProgressBar,
    scanned: &mut Scanned,
) -> Result<(), Failure> {
    let rates = options.rates.as_ref();
    let rates = rates.map_or(vec![endpoint.baud], |rates| rates.0.clone());
    let formats = options.formats.as_ref();
    let formats = formats.map_or(vec![endpoint.format], |formats| formats.0.clone());
    let units = &options.units.0;
    let lines = rates.len() * formats.len();
    bar.set_length((units.len() * lines) as u64);
    let mut master = Master::open(endpoint, observer).await?;
    for baud in rates {
        for format in &formats {
            let now = master.endpoint();
            if (now.baud, now.format) != (baud, *format) {
                let next = Endpoint {
                    baud,
                    format: *format,
                    ..now.clone()
                };
                master.change_line(next)?;
            }
            scanned.found = Found::default();
            scanned.line = Some(master.endpoint().clone());
            sweep(&mut master, units, lines > 1, bar, &mut scanned.found).await?;
            scanned.echo |= master.has_echo();
            master = look_at_found(master, scanned).await?;
        }
    }
    Ok(())
}

/// Asks every address, and those that stay silent once more with more time. On one line of several that are tried
/// this is done only where something answers: it takes 40 s for all addresses.
async fn sweep(
    master: &mut Master,
    units: &[u8],
    one_of_several: bool,
    bar: &ProgressBar,
    found: &mut Found,
) -> Result<(), Failure> {
    let endpoint = master.endpoint().clone();
    let line = match &endpoint.place {
        Place::Serial(_) => format!("{} bit/s {}", endpoint.baud, endpoint.format),
        _ => String::new(),
    };
    bar.set_message(line.clone());
    let lost = |error| Failure::Port(format!("{} is lost ({error})", place(&endpoint)));
    let asked = |_| bar.inc(1);
    // A gateway waits for its units itself, and reports when a unit is missing.
    if endpoint.framing == Framing::Mbap || endpoint.timeout_given {
        let wait = endpoint.timeout;
        let sweep = master.sweep(units, wait, found, asked);
        return sweep.await.map_err(lost);
    }
    let sweep = master.sweep(units, SHORT, found, asked);
    sweep.await.map_err(lost)?;
    let silent = |unit: &&u8| !found.units.contains(unit) && !found.garbled.contains(unit);
    let silent: Vec<_> = units.iter().filter(silent).copied().collect();
    let nothing = found.units.is_empty() && found.garbled.is_empty();
    if found.never_silent || (one_of_several && nothing) {
        return Ok(());
    }
    bar.inc_length(silent.len() as u64);
    bar.set_message(
        format!("{line} silent addresses, {LONG:?} each")
            .trim()
            .to_owned(),
    );
    let sweep = master.sweep(&silent, LONG, found, asked);
    sweep.await.map_err(lost)
}

/// Looks at every unit that was found at the present line.
async fn look_at_found(mut master: Master, scanned: &mut Scanned) -> Result<Master, Failure> {
    let at = place(master.endpoint());
    if scanned.found.never_silent {
        scanned.never_silent.push(at.clone());
    }
    for address in &scanned.found.garbled {
        scanned.garbled.push(format!("{address} ({at})"));
    }
    while let Some(address) = scanned.found.units.first().copied() {
        let mut device = Device {
            master,
            unit: address,
            refresh: false,
        };
        let unit = look_at(&mut device).await;
        master = device.master;
        match unit {
            Ok(unit) => scanned.units.push(unit),
            Err(Failure::Garbled(_)) if !scanned.found.garbled.contains(&address) => {
                scanned.garbled.push(format!("{address} ({at})"));
            }
            Err(Failure::Garbled(_)) => {}
            Err(failure) => return Err(failure),
        }
        scanned.found.units.remove(&address);
    }
    Ok(master)
}

impl Scanned {
    /// Adds the units that have answered and have not been looked at.
    fn keep_found(&mut self) {
        let Some(line) = &self.line else { return };
        let units = self.found.units.iter().map(|address| Unit {
            address: *address,
            baud: line.baud,
            format: line.format.to_string(),
            identity: "answers".to_owned(),
            modules: String::new(),
        });
        self.units.extend(units);
    }
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

fn print(scanned: &Scanned, serial: bool, json: bool) -> Result<(), Failure> {
    let (garbled, never_silent) = (&scanned.garbled, &scanned.never_silent);
    if json {
        let units = scanned.units.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "baud": serial.then_some(unit.baud),
                "format": serial.then_some(&unit.format),
                "identity": unit.identity,
                "modules": unit.modules,
            })
        });
        return output::json(
            &json!({ "units": units.collect::<Vec<_>>(), "garbled": garbled, "never_silent": never_silent }),
        );
    }
    let rows: Vec<_> = scanned
        .units
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
    for at in never_silent {
        output::line(format_args!("the line is never silent at {at}"))?;
    }
    for at in garbled {
        output::line(format_args!(
            "something answers, but garbled, at address {at}"
        ))?;
    }
    Ok(())
}

/// Returns a progress bar on standard error, hidden when that is not a terminal.
fn progress() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg} {eta}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
