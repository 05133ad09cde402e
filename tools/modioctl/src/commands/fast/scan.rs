//! `modioctl scan --fast`.

use modbus_line::adu::{pdu, words_of};
use modbus_line::fast::Scan;
use register_map::{Row, state};
use serde_json::json;

use super::hex;
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Lost, Master, Observer, check_line, decode, shared};
use crate::cli;
use crate::commands::scan::{echo, lines, settings};
use crate::device::place;
use crate::failure::Failure;
use crate::output;

/// Number of registers from NAME on, where units of function 70 have their name, one letter in each.
const LETTERS: u16 = 20;

/// A unit that was found.
struct Unit {
    serial: u32,
    address: u8,
    line: Endpoint,
    /// Empty until the unit was asked.
    identity: String,
    note: &'static str,
}

#[derive(Default)]
struct Scanned {
    units: Vec<Unit>,
    /// Lines on which damaged bytes were received.
    garbled: Vec<String>,
    echo: bool,
}

/// Looks for units at the requested rates and formats. Ctrl-C ends the scan, and keeps what was found. Returns whether
/// the scan has ended by itself. Fails when no unit was found.
pub async fn run(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &cli::Scan,
    json: bool,
) -> Result<bool, Failure> {
    check_line(&endpoint)?;
    let serial = endpoint.place.is_serial();
    // Formats with 7 data bits are for ASCII.
    let is_rtu = |line: &Endpoint| line.framing == Framing::Rtu;
    let lines = lines(&endpoint, options)?.into_iter().filter(is_rtu);
    let lines = lines.collect();
    let mut scanned = Scanned::default();
    let result = tokio::select! {
        // Ctrl-C is handled before the scan begins.
        biased;
        _ = tokio::signal::ctrl_c() => Ok(false),
        result = search(lines, observer, &mut scanned) => result.map(|()| true),
    };
    if result.is_ok() || !scanned.units.is_empty() {
        print(&scanned, serial, json)?;
    }
    let complete = result?;
    match (scanned.units.is_empty(), scanned.garbled.is_empty()) {
        _ if !complete => Ok(false),
        (false, _) => Ok(true),
        (true, false) => Err(Failure::Garbled(
            "no unit could be read: wrong rate or format, two units with one serial number, or no termination".to_owned(),
        )),
        (true, true) => Err(Failure::NoAnswer(format!(
            "no unit with Fast Modbus (function 70) found{}: check power, wiring (A and B swapped?) and rate (`--rates all`); `modioctl scan` without --fast also finds units that do not have it",
            echo(scanned.echo)
        ))),
    }
}

async fn search(
    lines: Vec<Endpoint>,
    observer: Option<Observer>,
    scanned: &mut Scanned,
) -> Result<(), Failure> {
    let Some(first) = lines.first() else {
        return Err(Failure::usage("--fast needs a format with 8 data bits"));
    };
    let mut master = Master::open(first.clone(), observer).await?;
    for line in lines {
        master.change_line(line.clone())?;
        let before = scanned.units.len();
        let at = place(&line);
        let lost =
            |error| Failure::Port(format!("{at} is lost ({error}): the scan is not complete"));
        let mut scan = Scan::default();
        // Keep the units also when Ctrl-C ends the scan.
        while let Some(request) = scan.next() {
            master.scan_step(&mut scan, &request).await.map_err(lost)?;
            scanned.units.truncate(before);
            scanned.units.extend(found(&scan, &line));
        }
        scanned.echo |= master.has_echo();
        if scan.is_disturbed() {
            scanned.garbled.push(at.clone());
        }
        for unit in scanned.units.iter_mut().skip(before) {
            unit.identity = identity(&mut master, unit.serial).await.map_err(lost)?;
        }
    }
    Ok(())
}

/// Returns the units of a scan, in the order of their addresses.
fn found(scan: &Scan, line: &Endpoint) -> Vec<Unit> {
    let shared = shared(scan.units());
    let mut units: Vec<_> = scan
        .units()
        .iter()
        .map(|(serial, address)| Unit {
            serial: *serial,
            address: *address,
            line: line.clone(),
            identity: String::new(),
            note: match address {
                address if shared.contains(address) => "several units have this address",
                0 | 248..=254 => "this is no unit address",
                _ => "",
            },
        })
        .collect();
    units.sort_by_key(|unit| unit.address);
    units
}

/// Returns what a unit is, for people.
async fn identity(master: &mut Master, serial: u32) -> std::io::Result<String> {
    let first = state::PRODUCT_CODE;
    let count = state::BUILD - first + 1;
    let words = match words(master, serial, first, count).await {
        Ok(Some(words)) => words,
        Ok(None) => Vec::new(),
        Err(lost) => return unread(lost),
    };
    if let [high, low, version, patch, _, code, .., build] = words[..]
        && u32::from(high) << 16 | u32::from(low) == state::PRODUCT
    {
        let board = Row::from_code(code).map_or("with an unknown board", |board| board.name);
        let version = state::version([version, patch], build);
        return Ok(format!("modio {board} {version}"));
    }
    match self::words(master, serial, register_map::name::NAME, LETTERS).await {
        Ok(Some(words)) => Ok(name(&words)),
        Ok(None) => Ok("no identification: it has no name".to_owned()),
        Err(lost) => unread(lost),
    }
}

fn unread(lost: Lost) -> std::io::Result<String> {
    match lost {
        Lost::Silent | Lost::Absent(_) => Ok("no identification: no answer".to_owned()),
        Lost::Garbled(_) => Ok("no identification: a damaged answer".to_owned()),
        Lost::Broken(error) => Err(error),
    }
}

/// Reads registers; `None` for a unit that refuses.
async fn words(
    master: &mut Master,
    serial: u32,
    first: u16,
    count: u16,
) -> Result<Option<Vec<u16>>, Lost> {
    let reply = master.ask_serial(serial, &pdu(3, first, count)).await?;
    let words = words_of(&reply);
    Ok((words.len() == usize::from(count)).then_some(words))
}

/// Returns the text in the low bytes of these registers.
fn name(words: &[u16]) -> String {
    let letters = words.iter().map(|word| *word as u8);
    let letters: Vec<_> = letters.take_while(|letter| *letter != 0).collect();
    decode::text(&letters).trim().to_owned()
}

fn print(scanned: &Scanned, serial: bool, json: bool) -> Result<(), Failure> {
    if json {
        let units = scanned.units.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "serial": hex(unit.serial),
                "baud": serial.then_some(unit.line.baud),
                "format": serial.then(|| unit.line.format.to_string()),
                "mode": serial.then_some(unit.line.framing),
                "identity": unit.identity,
                "note": unit.note,
            })
        });
        return output::json(
            &json!({ "units": units.collect::<Vec<_>>(), "garbled": scanned.garbled }),
        );
    }
    let row = |unit: &Unit| {
        let (identity, note) = (unit.identity.clone(), unit.note.to_owned());
        [
            unit.address.to_string(),
            settings(&unit.line),
            hex(unit.serial),
            identity,
            note,
        ]
    };
    let rows: Vec<_> = scanned.units.iter().map(row).collect();
    if !rows.is_empty() {
        output::table(&rows)?;
    }
    for at in &scanned.garbled {
        output::line(format_args!("damaged replies were received at {at}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::name;

    #[test]
    fn name_has_one_letter_in_each_register() {
        let words = [b'W', b'B', b'M', b'S', 0, b'X'].map(u16::from);
        assert_eq!(name(&words), "WBMS");
        assert_eq!(name(&[0x1B, 0x41]), "\\u{1b}A");
    }
}
