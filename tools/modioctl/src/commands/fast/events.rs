//! `modioctl events`.

use std::collections::BTreeMap;

use chrono::{Local, SecondsFormat};
use modbus_line::fast::{Event, Fetcher, Packet, Priority, Scan, Setting, are_on, kind, settings};
use modio_description::Table;
use serde_json::{Value as Json, json};

use crate::bus::{Lost, check_line, shared};
use crate::cli::{Events, High};
use crate::device::{Device, fetch, place};
use crate::failure::Failure;
use crate::names::Item;
use crate::output;
use crate::value::{Shown, show, text};

/// Id of the event of a unit that has started.
const STARTED: u16 = 0;
/// Most points of one request to switch events on.
const MOST: usize = 40;
/// Number of requests without a reply after which the line counts as lost.
const TRIES: u8 = 3;

/// The points of each unit, by type and address.
type Points = BTreeMap<u8, Vec<(u8, Item)>>;

/// Prints events until it is stopped. Waits for units that are lost.
pub async fn run(mut device: Device, options: &Events, json: bool) -> Result<(), Failure> {
    check_line(device.master.endpoint())?;
    let units = match &options.units {
        Some(units) => units.clone(),
        None => units(&mut device).await?,
    };
    let mut points = Points::new();
    for unit in units {
        let of_unit = switch_on(&mut device, unit, options).await?;
        points.insert(unit, of_unit);
    }
    let mut fetcher = Fetcher::default();
    let mut failed = 0;
    let mut printed = 0;
    loop {
        let reply = match device.master.ask_fast(&fetcher.request()).await {
            Ok(reply) => reply,
            Err(Lost::Broken(error)) => return Err(lost(&device, &Lost::Broken(error))),
            Err(why) => {
                failed += 1;
                if failed == TRIES {
                    eprintln!("modioctl: {}; waiting", lost(&device, &why));
                }
                failed = failed.min(TRIES);
                continue;
            }
        };
        if std::mem::take(&mut failed) == TRIES {
            eprintln!("modioctl: units answer again");
        }
        let Some(packet) = fetcher.take(reply) else {
            continue;
        };
        printed += print(
            &packet,
            &points,
            json,
            options.count.map(|count| count - printed),
        )?;
        if options.count.is_some_and(|count| printed >= count) {
            return Ok(());
        }
        if packet.events.iter().any(has_started) {
            // All that was switched on is off, and the unit may have other modules now.
            match switch_on(&mut device, packet.unit, options).await {
                Ok(of_unit) => drop(points.insert(packet.unit, of_unit)),
                // The next packet of the unit says again that it has started.
                Err(failure) if failure.may_pass() => eprintln!("modioctl: {failure}"),
                Err(failure) => return Err(failure),
            }
        }
    }
}

/// Returns the addresses of all units that a scan finds.
async fn units(device: &mut Device) -> Result<Vec<u8>, Failure> {
    let mut scan = Scan::default();
    while let Some(request) = scan.next() {
        let step = device.master.scan_step(&mut scan, &request).await;
        step.map_err(|error| lost(device, &Lost::Broken(error)))?;
    }
    if let [unit, ..] = shared(scan.units())[..] {
        return Err(Failure::Garbled(format!(
            "several units have address {unit}, so they cannot report events: `modioctl scan --fast` lists them; change the address of all but one"
        )));
    }
    let units = scan.units().values().copied();
    let units: Vec<_> = units.filter(|unit| (1..=247).contains(unit)).collect();
    if units.is_empty() {
        return Err(lost(device, &Lost::Silent));
    }
    Ok(units)
}

/// Returns the failure when no unit replies.
fn lost(device: &Device, lost: &Lost) -> Failure {
    let place = place(device.master.endpoint());
    match lost {
        Lost::Silent | Lost::Absent(_) => Failure::NoAnswer(format!(
            "no unit with Fast Modbus (function 70) answers at {place}: check power, wiring, rate and format; `modioctl scan` also finds units that do not have it"
        )),
        Lost::Garbled(_) => Failure::Garbled(format!(
            "units answer at {place}, but garbled: two units with one address, no termination, or units of several makers"
        )),
        broken @ Lost::Broken(_) => device.lost(None, broken),
    }
}

/// Switches on the events of all points of a unit, and off the event that the unit has started. Returns the points.
async fn switch_on(
    device: &mut Device,
    unit: u8,
    options: &Events,
) -> Result<Vec<(u8, Item)>, Failure> {
    device.unit = unit;
    let points = points_of(device, options).await?;
    let of_points = points.iter().map(|(kind, item)| Setting {
        kind: *kind,
        id: item.address,
        priority: match options.high {
            High::All => Priority::High,
            High::Inputs if *kind == kind::DISCRETE_INPUT => Priority::High,
            High::Inputs | High::None => Priority::Low,
        },
    });
    let start = Setting {
        kind: kind::UNIT,
        id: STARTED,
        priority: Priority::Off,
    };
    let all: Vec<_> = of_points.chain([start]).collect();
    for some in all.chunks(MOST) {
        let about = "switching events on (Fast Modbus, function 70)";
        let reply = device.ask(&settings(some), about).await?;
        let Some(on) = are_on(some, &reply) else {
            return Err(Failure::Garbled(format!(
                "{about}: the answer of unit {unit} has a wrong length"
            )));
        };
        let refused = some
            .iter()
            .zip(on)
            .filter(|(setting, on)| *on != (setting.priority != Priority::Off));
        for (setting, _) in refused {
            eprintln!(
                "modioctl: unit {unit} does not switch the events of point {:#06X} as requested",
                setting.id
            );
        }
    }
    Ok(points)
}

/// Returns the points whose events are to be switched on, with their types.
async fn points_of(device: &mut Device, options: &Events) -> Result<Vec<(u8, Item)>, Failure> {
    let unit = device.unit;
    let chosen = options.units.as_ref();
    if chosen.is_some_and(|units| !units.contains(&unit)) {
        return Ok(Vec::new());
    }
    let book = fetch(device).await?.book;
    let points = book.ports().into_iter().flat_map(|port| port.points);
    let points: Vec<_> = points.map(|item| (kind_of(&item), item)).collect();
    if book.description().is_none() {
        eprintln!(
            "modioctl: unit {unit} is not a modio: its events are printed, but not switched on"
        );
    } else if points.is_empty() {
        eprintln!("modioctl: unit {unit} has no points: `modioctl module set` sets its modules");
    }
    Ok(points)
}

/// Returns the type of a point's events.
const fn kind_of(item: &Item) -> u8 {
    match (item.table, item.writable) {
        (Table::Bit, true) => kind::COIL,
        (Table::Bit, false) => kind::DISCRETE_INPUT,
        (Table::Word, true) => kind::HOLDING_REGISTER,
        (Table::Word, false) => kind::INPUT_REGISTER,
    }
}

const fn has_started(event: &Event) -> bool {
    event.kind == kind::UNIT && event.id == STARTED
}

/// Prints the events of a packet, `most` at most. Returns their number.
fn print(packet: &Packet, points: &Points, json: bool, most: Option<u64>) -> Result<u64, Failure> {
    let now = Local::now();
    let most = most.and_then(|most| usize::try_from(most).ok());
    let events = packet.events.iter().take(most.unwrap_or(usize::MAX));
    let count = events.len() as u64;
    for event in events {
        let (name, shown) = told(event, points.get(&packet.unit));
        if json {
            output::line(json!({
                "time": now.to_rfc3339_opts(SecondsFormat::Millis, false),
                "unit_address": packet.unit,
                "name": name,
                "value": shown.json,
                "unit": shown.unit,
            }))?;
        } else {
            let text = format!("{name} {shown}");
            output::line(format_args!(
                "{}  unit {}  {}",
                now.format("%H:%M:%S%.3f"),
                packet.unit,
                text.trim_end()
            ))?;
        }
    }
    Ok(count)
}

/// Returns the name of what an event is about, and its value.
fn told(event: &Event, points: Option<&Vec<(u8, Item)>>) -> (String, Shown) {
    let nothing = || Shown {
        json: Json::Null,
        ..text("")
    };
    let table = match (event.kind, event.id) {
        (kind::UNIT, STARTED) => return ("started".to_owned(), nothing()),
        (kind::LOST, _) => return ("edges lost".to_owned(), nothing()),
        (kind::COIL, _) => "coil",
        (kind::DISCRETE_INPUT, _) => "discrete input",
        (kind::HOLDING_REGISTER, _) => "holding register",
        (kind::INPUT_REGISTER, _) => "input register",
        _ => "event",
    };
    let bytes = event.data.iter().rev().take(8);
    let value = bytes.fold(0_u64, |value, byte| value << 8 | u64::from(*byte));
    let of_event = |(kind, item): &&(u8, Item)| (*kind, item.address) == (event.kind, event.id);
    if let Some((_, item)) = points.into_iter().flatten().find(of_event)
        && let Ok(word) = u16::try_from(value)
    {
        return (item.name.clone(), show(item, &[word], false));
    }
    let shown = Shown {
        json: json!(value),
        ..text(&value.to_string())
    };
    (format!("{table} {}", event.id), shown)
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_02;

    use super::*;
    use crate::names;

    fn told_of(kind: u8, id: u16, data: &[u8]) -> String {
        let book = names::book(&MODIO_02, Module::Ai2Ao2, (2, 1));
        let points = book.ports().remove(0).points;
        let points: Vec<_> = points
            .into_iter()
            .map(|item| (kind_of(&item), item))
            .collect();
        let data = data.to_vec();
        let (name, shown) = told(&Event { kind, id, data }, Some(&points));
        format!("{name} {shown}").trim_end().to_owned()
    }

    #[test]
    fn events_have_the_names_and_units_of_points() {
        assert_eq!(
            told_of(kind::INPUT_REGISTER, 0x10, &[0x83, 0xFF]),
            "p5.1 -12.5 °C"
        );
        assert_eq!(told_of(kind::HOLDING_REGISTER, 0x12, &[5, 0]), "p5.3 5");
    }

    #[test]
    fn events_without_a_point_have_their_number() {
        let long = [1, 2, 3, 4, 5, 6, 7, 8, 9];
        for (kind, id, data, text) in [
            (kind::COIL, 0x10, &[1][..], "coil 16 1"),
            (
                kind::INPUT_REGISTER,
                9,
                &[1, 0, 1, 0],
                "input register 9 65537",
            ),
            (
                kind::INPUT_REGISTER,
                0x10,
                &[0, 0, 1],
                "input register 16 65536",
            ),
            (7, 1, &long, "event 1 650777868590383874"),
            (kind::UNIT, 0, &[], "started"),
            (kind::LOST, 0, &[], "edges lost"),
            (kind::UNIT, 1, &[], "event 1 0"),
        ] {
            assert_eq!(told_of(kind, id, data), text);
        }
    }
}
