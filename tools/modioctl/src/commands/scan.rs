//! `modioctl scan`.

mod left;

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use modbus_line::Format;
use serde_json::json;

use super::info::{Unidentified, identity};
use crate::bus::adu::Framing;
use crate::bus::{
    Endpoint, Found, LONG, Lost, Master, Observer, PROBE, Place, REPORT, SHORT, sufficient,
};
use crate::cli::Scan;
use crate::device::{Device, known, place};
use crate::failure::Failure;
use crate::names::module_name;
use crate::output;
use left::{Left, list};

/// Why a unit may be silent although its line is right.
const DELAYED: &str = "a unit with a long RESPONSE_DELAY or over the air needs a longer";

/// Shortest time that is worth an announcement.
const LONG_SCAN: Duration = Duration::from_secs(10);

struct Unit {
    address: u8,
    line: Endpoint,
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
    line: Option<Endpoint>,
    echo: bool,
    /// Addresses that gateways had no time for.
    busy: Vec<u8>,
    /// Longest time of a gateway's late answer.
    late: Duration,
    /// Number of addresses that were silent.
    silent: usize,
    left: Left,
}

/// Looks for units at the requested rates and formats. Ctrl-C ends the scan, and keeps what was found. Returns whether
/// the scan has ended by itself. Fails when no unit was found.
pub async fn run(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &Scan,
    json: bool,
) -> Result<bool, Failure> {
    let serial = endpoint.place.is_serial();
    let framing = endpoint.framing;
    let lines = lines(&endpoint, options)?;
    if let Some(time) = announcement(&lines, options.units.len()) {
        eprintln!("modioctl: {time}");
    }
    let mut scanned = Scanned::default();
    let bar = progress();
    let result = tokio::select! {
        // Ctrl-C is handled before the scan begins.
        biased;
        _ = tokio::signal::ctrl_c() => Ok(false),
        result = search(lines, observer, &options.units, &bar, &mut scanned) => result.map(|()| true),
    };
    bar.finish_and_clear();
    if !matches!(result, Ok(true)) {
        scanned.keep_found();
    }
    if scanned.line.is_some() {
        print(&scanned, serial, json)?;
    }
    if !result.map_err(|failure| scanned.left.add_to(failure))? {
        return Ok(false);
    }
    if scanned.late > Duration::ZERO {
        return Err(Failure::NoAnswer(format!(
            "the gateway answers late: --timeout {}s waits for all its answers",
            sufficient(scanned.late)
        )));
    }
    if !scanned.busy.is_empty() {
        return Err(Failure::Busy(format!(
            "a gateway, or the units themselves, had no time for addresses {}: scan them again",
            list(scanned.busy.iter().copied())
        )));
    }
    let wait = match framing {
        // The gateway waits for the units.
        Framing::Mbap => "time-out in the gateway",
        Framing::Rtu | Framing::Ascii => "`--timeout`",
    };
    let garbled = !scanned.garbled.is_empty() || !scanned.never_silent.is_empty();
    match (scanned.units.is_empty(), !garbled) {
        (false, _) => {
            if scanned.silent > 0 {
                eprintln!("modioctl: silent addresses: {}; {DELAYED} {wait}", scanned.silent);
            }
            Ok(true)
        }
        (true, false) => Err(Failure::Garbled(
            "no unit could be read: wrong rate or format, two units with one address, or no termination".to_owned(),
        )),
        (true, true) => Err(Failure::NoAnswer(format!(
            "no unit found{}: check power, wiring (A and B swapped?) and rate (`--rates all`); a unit's address is its DIP switch; {DELAYED} {wait}",
            echo(scanned.echo)
        ))),
    }
}

/// Returns the lines to try: each rate with each format. RTU needs 8 data bits, so formats with 7 are tried in ASCII
/// mode.
pub fn lines(endpoint: &Endpoint, options: &Scan) -> Result<Vec<Endpoint>, Failure> {
    if !endpoint.place.is_serial() && (options.rates.is_some() || options.formats.is_some()) {
        return Err(Failure::usage(
            "--rates and --formats are for a serial port: over TCP the gateway has the line's settings",
        ));
    }
    let rates = options.rates.clone().unwrap_or(vec![endpoint.baud]);
    let formats = options.formats.clone().unwrap_or(vec![endpoint.format]);
    let line = |baud, format: Format| Endpoint {
        baud,
        format,
        framing: match format.data_bits {
            7 if endpoint.place.is_serial() => Framing::Ascii,
            _ => endpoint.framing,
        },
        ..endpoint.clone()
    };
    let of_rate = |baud| formats.iter().map(move |format| line(baud, *format));
    Ok(rates.into_iter().flat_map(of_rate).collect())
}

/// Returns what an adapter does that returns what it sends.
pub const fn echo(is_there: bool) -> &'static str {
    match is_there {
        true => ", and the adapter returns what it sends, which is not an answer",
        false => "",
    }
}

/// Describes rate, format and mode of a line; nothing for one that is not serial.
pub fn settings(line: &Endpoint) -> String {
    let Endpoint { baud, format, .. } = line;
    match (line.place.is_serial(), line.framing) {
        (false, _) => String::new(),
        (true, Framing::Ascii) => format!("{baud} {format} ASCII"),
        (true, _) => format!("{baud} {format}"),
    }
}

/// Returns whether every address is asked only once, with the time-out of the line.
fn is_asked_once(line: &Endpoint) -> bool {
    // A gateway waits for its units itself, and reports when a unit is missing.
    line.framing == Framing::Mbap || line.timeout_given
}

/// Returns the time of a pass over this number of silent addresses.
fn pass(line: &Endpoint, units: usize, wait: Duration) -> Duration {
    let request = line.framing.frame(0, 1, &[REPORT]).len();
    let each = line.time_of(request) + line.frame_gap() + wait;
    each * u32::try_from(units).unwrap_or(u32::MAX)
}

/// Describes how long a scan takes; `None` for a short one.
fn announcement(lines: &[Endpoint], units: usize) -> Option<String> {
    let all = |wait: fn(&Endpoint) -> Duration| {
        let passes = lines.iter().map(|line| pass(line, units, wait(line)));
        passes.sum::<Duration>()
    };
    let mut more = String::new();
    let time = match lines {
        [first, ..] if is_asked_once(first) => all(|line| line.timeout),
        [only] => all(|_| SHORT) + pass(only, units, LONG),
        [first, ..] => {
            let second = shown(pass(first, units, LONG));
            more = format!(", and {second} more for each rate and format with an answer");
            all(|_| SHORT)
        }
        [] => return None,
    };
    let time = (time >= LONG_SCAN).then(|| shown(time))?;
    Some(format!(
        "the scan takes about {time}{more}; Ctrl-C ends it and keeps what was found"
    ))
}

fn shown(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds => format!("{} min", seconds.div_ceil(60)),
    }
}

async fn search(
    lines: Vec<Endpoint>,
    observer: Option<Observer>,
    units: &[u8],
    bar: &ProgressBar,
    scanned: &mut Scanned,
) -> Result<(), Failure> {
    let several = lines.len() > 1;
    bar.set_length((units.len() * lines.len()) as u64);
    let Some(first) = lines.first() else {
        return Ok(());
    };
    let mut master = Master::open(first.clone(), observer).await?;
    scanned.left.lines = lines.len();
    for line in lines {
        master.change_line(line.clone())?;
        scanned.found = Found::default();
        scanned.line = Some(line);
        scanned.left.lines -= 1;
        let Scanned { found, left, .. } = scanned;
        sweep(&mut master, units, several, bar, found, left).await?;
        if master.endpoint().framing == Framing::Mbap {
            scanned.late = master.lateness();
        }
        if !found.units.is_empty() && !found.never_silent {
            let answered = &found.units | &found.garbled;
            scanned.silent += units.len() - answered.union(&found.busy).count();
        }
        scanned.busy.extend(&scanned.found.busy);
        scanned.echo |= master.has_echo();
        master = look_at_found(master, scanned).await?;
    }
    Ok(())
}

/// Asks every address, and those that stay silent once more with more time. On one line of several that are tried
/// this is done only where something answers: it takes 40 s for all addresses.
async fn sweep(
    master: &mut Master,
    units: &[u8],
    is_one_of_several: bool,
    bar: &ProgressBar,
    found: &mut Found,
    left: &mut Left,
) -> Result<(), Failure> {
    let endpoint = master.endpoint().clone();
    let line = match &endpoint.place {
        Place::Serial(_) => format!("{} bit/s {}", endpoint.baud, endpoint.format),
        _ => String::new(),
    };
    bar.set_message(line.clone());
    let lost = |error| Failure::Port(format!("{} is lost ({error})", place(&endpoint)));
    let asked = left.begin(units, false, bar);
    if endpoint.framing == Framing::Mbap {
        let sweep = master.sweep_gateway(units, found, asked);
        return sweep.await.map_err(lost);
    }
    if is_asked_once(&endpoint) {
        let sweep = master.sweep(units, endpoint.timeout, found, asked);
        return sweep.await.map_err(lost);
    }
    let sweep = master.sweep(units, SHORT, found, asked);
    sweep.await.map_err(lost)?;
    let silent = |unit: &&u8| !found.units.contains(unit) && !found.garbled.contains(unit);
    let silent: Vec<_> = units.iter().filter(silent).copied().collect();
    let nothing = found.units.is_empty() && found.garbled.is_empty();
    if found.never_silent || (is_one_of_several && nothing) {
        return Ok(());
    }
    bar.inc_length(silent.len() as u64);
    let message = format!("{line} silent addresses, {LONG:?} each");
    bar.set_message(message.trim().to_owned());
    let asked = left.begin(&silent, true, bar);
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
            Ok(unit) => scanned.units.extend(unit),
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
            line: line.clone(),
            identity: "answers".to_owned(),
            modules: String::new(),
        });
        self.units.extend(units);
    }
}

/// Reads the identity of a unit. Returns `None` for the address of an absent unit. Fails when its answers are garbled, as
/// those of two units with one address are, or when the port is lost.
async fn look_at(device: &mut Device) -> Result<Option<Unit>, Failure> {
    // Use what the unit does answer, even if it does not answer every request.
    fn answered<T: Default>(result: Result<T, Failure>) -> Result<T, Failure> {
        match result {
            Err(Failure::Refused(_) | Failure::Busy(_) | Failure::NoAnswer(_)) => Ok(T::default()),
            other => other,
        }
    }
    let identity = match identity(device).await {
        Ok(objects) => {
            let object = |name: &str| {
                let found = objects.iter().find(|(known, _)| known == name);
                found.map(|(_, text)| text.as_str()).unwrap_or_default()
            };
            let texts = ["vendor", "product", "revision"].map(object);
            texts.join(" ").trim().to_owned()
        }
        Err(Unidentified::Lost(lost @ (Lost::Garbled(_) | Lost::Broken(_)))) => {
            return Err(device.lost(None, &lost));
        }
        // Some gateways reject functions that they do not pass, also for an absent unit. Function 03 they pass.
        Err(Unidentified::Exception(_))
            if matches!(
                device.master.ask(device.unit, &PROBE).await,
                Err(Lost::Absent(_))
            ) =>
        {
            return Ok(None);
        }
        Err(reason) => format!("no identification: {reason}"),
    };
    let description = answered(known(device).await)?;
    let mut modules = Vec::new();
    if let Some(unit) = &description {
        let ports = unit.ports.iter();
        let named = ports.map(|port| (port.number, module_name(unit, port.module)));
        modules.extend(named.map(|(port, name)| format!("p{port} {name}")));
    }
    Ok(Some(Unit {
        address: device.unit,
        line: device.master.endpoint().clone(),
        identity,
        modules: modules.join(", "),
    }))
}

fn print(scanned: &Scanned, serial: bool, json: bool) -> Result<(), Failure> {
    let (garbled, never_silent) = (&scanned.garbled, &scanned.never_silent);
    if json {
        let units = scanned.units.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "baud": serial.then_some(unit.line.baud),
                "format": serial.then(|| unit.line.format.to_string()),
                "mode": serial.then_some(unit.line.framing),
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
            let (identity, modules) = (unit.identity.clone(), unit.modules.clone());
            [
                unit.address.to_string(),
                settings(&unit.line),
                identity,
                modules,
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
        let what = "something answers, but garbled, at address";
        output::line(format_args!("{what} {at}"))?;
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    /// Returns the lines of a scan with these options, and the number of addresses.
    fn lines_of(words: &str) -> (Vec<Endpoint>, usize) {
        let words = format!("modioctl {words}");
        let cli = Cli::try_parse_from(words.split(' ')).unwrap();
        let Command::Scan(options) = cli.command else {
            panic!("not a scan");
        };
        let endpoint = cli.endpoint.endpoint(None, None).unwrap();
        (lines(&endpoint, &options).unwrap(), options.units.len())
    }

    #[test]
    fn all_formats_are_seven_and_those_with_7_data_bits_are_ascii() {
        let (lines, _) = lines_of("--port a scan --formats all");
        let lines: Vec<_> = lines
            .iter()
            .map(|line| (line.format.to_string(), line.framing))
            .collect();
        let (rtu, ascii) = (Framing::Rtu, Framing::Ascii);
        let eight = ["8N2", "8E1", "8O1", "8N1"].map(|format| (format.to_owned(), rtu));
        let seven = ["7E1", "7O1", "7N2"].map(|format| (format.to_owned(), ascii));
        assert_eq!(lines, [&eight[..], &seven].concat());
    }

    #[test]
    fn time_of_a_scan_is_known_before_it_begins() {
        let time = |words: &str| {
            let (lines, units) = lines_of(words);
            announcement(&lines, units).unwrap_or_default()
        };
        // 247 addresses, 4 characters and t3.5 at 9600 bit/s, 25 and 150 ms.
        assert!(time("--port a scan").starts_with("the scan takes about 47 s;"));
        let all = time("--port a scan --formats all --rates all");
        let times =
            "the scan takes about 13 min, and 54 s more for each rate and format with an answer;";
        assert!(all.starts_with(times), "{all}");
        let slow = time("--tcp a:1 --timeout 1s scan");
        assert!(slow.starts_with("the scan takes about 5 min;"), "{slow}");
        assert_eq!(time("--port a scan --units 1-20"), "");
    }
}
