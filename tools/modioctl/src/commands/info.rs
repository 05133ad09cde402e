//! `modioctl info`.

use std::fmt;

use modbus_line::names;
use register_map::configuration::{BAUD, FRAME_GAP};
use register_map::state::update;
use register_map::update::State;
use register_map::{edges, fault, links, name, second, state};
use serde_json::{Map, Value as Json, json};

use crate::bus::{Lost, decode};
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::held::Held;
use crate::names::{Item, Meaning};
use crate::output;
use crate::update::state_text;
use crate::value::{Shown, show, text};

/// Names of the first objects of the device identification (V1.1b3, 6.21).
const OBJECTS: [&str; 7] = [
    "vendor",
    "product code",
    "revision",
    "address on the web",
    "product",
    "model",
    "application",
];

/// The groups of registers, in the order in which they are shown.
const GROUPS: [&str; 7] = [
    "identity", "line", "modules", "state", "faults", "counters", "others",
];

/// Name of the outputs that links hold, among the registers.
const HELD: &str = "outputs held by links";

const fn group(address: u16) -> &'static str {
    match address {
        BAUD..=FRAME_GAP | state::UNIT_ADDRESS => "line",
        state::RESET_CAUSE..=state::STACK_FREE | state::UPTIME_MS | state::UPDATE => "state",
        state::MODULE_IN_FORCE..state::UNIQUE_ID
        | state::CHANNEL_STATUS..fault::KIND
        | edges::LAST_EDGE..links::LINKS => "modules",
        state::BUS_MESSAGES..state::CHANNEL_STATUS | second::BUS_MESSAGES..=second::T15_GAPS => {
            "counters"
        }
        fault::KIND..=fault::RESERVED => "faults",
        name::NAME..=0x00DB
        | state::PRODUCT_CODE..=state::BOARD
        | state::COMMIT..=state::DESCRIPTION_CRC
        | state::UNIQUE_ID..state::BUS_MESSAGES => "identity",
        // Firmware that is newer than this program has them.
        _ => "others",
    }
}

/// Shows identity, state and counters of the unit.
pub async fn run(device: &mut Device, json: bool) -> Result<(), Failure> {
    let mut identity = match identity(device).await {
        Err(Unidentified::Lost(lost)) => return Err(device.lost(Some(&identify(0)), &lost)),
        objects => objects.unwrap_or_default(),
    };
    let book = fetch(device).await?.book;
    if book.description().is_some() {
        // The objects that the standard does not define are also registers.
        identity.retain(|(name, text)| OBJECTS.contains(&name.as_str()) && !text.is_empty());
    }
    let told = |item: &Item| identity.iter().any(|(name, _)| *name == item.name);
    let state = book
        .items()
        .iter()
        .filter(|item| is_state(item) && !told(item));
    let state: Vec<Item> = state.cloned().collect();
    let values = device.read_items(&state).await?;
    let held = device.held(&book, book.points()).await?;
    if json {
        let mut out: Map<String, Json> = identity
            .into_iter()
            .map(|(name, text)| (name, json!(text)))
            .collect();
        for (item, words) in state.iter().zip(&values) {
            out.insert(item.name.clone(), shown(item, words).json);
        }
        if !held.is_empty() {
            out.insert(HELD.to_owned(), json!(held));
        }
        return output::json(&out);
    }
    let identity = identity.into_iter();
    let identity = identity.map(|(name, text)| (GROUPS[0], [name, text]));
    let state = state.iter().zip(&values).map(|(item, words)| {
        let shown = shown(item, words).to_string();
        (group(item.address), [item.name.clone(), shown])
    });
    let held = held_row(&held).map(|row| ("state", row));
    let rows = identity.chain(state).chain(held);
    output::table(&grouped(&rows.collect::<Vec<_>>()))
}

/// Returns the row of the outputs that links hold, if there are any.
fn held_row(held: &Held) -> Option<[String; 2]> {
    let each = held.iter();
    let each = each.map(|(output, sources)| format!("{output} by {}", sources.join(" and ")));
    let all = each.collect::<Vec<_>>().join(", ");
    (!all.is_empty()).then(|| [HELD.to_owned(), all])
}

/// Returns a value as shown. Register UPDATE has parts that only this program names.
fn shown(item: &Item, words: &[u16]) -> Shown {
    match (item.address, words) {
        (state::UPDATE, [word]) => text(&slots(*word)),
        _ => show(item, words, false),
    }
}

/// Describes the value of register UPDATE: the slots, and which of them runs.
fn slots(word: u16) -> String {
    let (runs, other) = match word & update::SLOT {
        1 => ("A", "B"),
        2 => ("B", "A"),
        _ => return "no loader".to_owned(),
    };
    let is_set = |bit, yes, no| if word & bit == 0 { no } else { yes };
    let code = (word >> update::OTHER_SHIFT & 0b111) as u8;
    // A rejected image has a reason, which the register does not contain.
    let detail = if code == 6 { 1 } else { 0 };
    let other_state = State::from_code(code, detail).map_or("unknown", state_text);
    format!(
        "slot {runs} runs, {}{}; slot {other} {other_state}",
        is_set(update::TRIAL, "on trial", "confirmed"),
        is_set(update::SWITCHED, ", chosen by SW01 = 254", ""),
    )
}

/// Returns the rows of each group under its name, with an empty row between groups.
fn grouped(rows: &[(&str, [String; 2])]) -> Vec<[String; 2]> {
    let mut shown = Vec::new();
    for group in GROUPS {
        let of_group = rows.iter().filter(|(of, _)| *of == group);
        let of_group: Vec<_> = of_group
            .map(|(_, [name, text])| [format!("  {name}"), text.clone()])
            .collect();
        if of_group.is_empty() {
            continue;
        }
        if !shown.is_empty() {
            shown.push([String::new(), String::new()]);
        }
        shown.push([group.to_owned(), String::new()]);
        shown.extend(of_group);
    }
    shown
}

/// Returns whether an item is shown: a read-only register with a meaning, or a setting of the line.
fn is_state(item: &Item) -> bool {
    let is_read_only = !item.writable && matches!(item.meaning, Meaning::Value(_));
    let is_of_line = item.setting && (BAUD..=FRAME_GAP).contains(&item.address);
    // The board's name in letters is for other programs: register BOARD has it, too.
    let is_shown = !item.name.starts_with("reserved") && item.address != name::NAME;
    (is_read_only || is_of_line) && is_shown
}

/// Reason why a unit has no device identification.
pub enum Unidentified {
    /// The unit refuses with this exception.
    Exception(u8),
    /// The answer contains no objects, or wrong lengths.
    Damaged,
    Lost(Lost),
}

impl fmt::Display for Unidentified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exception(code) => {
                let name = names::exception(*code).unwrap_or("unknown exception");
                write!(f, "exception {code:02X}, {name}")
            }
            Self::Damaged | Self::Lost(Lost::Garbled(_)) => f.write_str("damaged answer"),
            Self::Lost(Lost::Silent | Lost::Absent(_) | Lost::Broken(_)) => {
                f.write_str("no answer")
            }
        }
    }
}

/// Returns the request for the device identification from this object on (V1.1b3, 6.21).
const fn identify(object: u8) -> [u8; 4] {
    [0x2B, 0x0E, 0x03, object]
}

/// Returns the objects of the device identification.
pub async fn identity(device: &mut Device) -> Result<Vec<(String, String)>, Unidentified> {
    let mut found = Vec::new();
    let mut object = 0;
    // Extended stream from an object on. A unit with few objects needs only one answer.
    for _ in 0..16 {
        let answer = device.master.ask(device.unit, &identify(object)).await;
        let answer = answer.map_err(Unidentified::Lost)?;
        let objects = match answer[..] {
            [function, code] if function & 0x80 != 0 => Err(Unidentified::Exception(code)),
            _ => decode::objects(&answer).ok_or(Unidentified::Damaged),
        };
        let objects = match objects {
            Err(_) if !found.is_empty() => break,
            objects => objects?,
        };
        for (id, text) in objects {
            let name = OBJECTS.get(usize::from(id));
            let name = name.map_or_else(|| format!("object {id:02X}"), |name| (*name).to_owned());
            found.push((name, text));
        }
        match (answer.get(4), answer.get(5)) {
            (Some(0xFF), Some(next)) if *next > object => object = *next,
            _ => break,
        }
    }
    if found.is_empty() {
        return Err(Unidentified::Damaged);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

    use super::*;
    use crate::names::book;

    #[test]
    fn every_register_has_a_group_and_reserved_ones_are_not_shown() {
        let book = book(&MODIO_08, Module::Ai4, (0, 0));
        let shown = |name: &str| {
            let item = book.find(name).unwrap();
            is_state(&item).then(|| group(item.address))
        };
        for (name, group) in [
            ("board", "identity"),
            ("unique_device_identity", "identity"),
            ("unit_address", "line"),
            ("BAUD", "line"),
            ("p1.module_in_force", "modules"),
            ("p1.1.channel_status", "modules"),
            ("p1.1.last_edge", "modules"),
            ("uptime", "state"),
            ("uptime_ms", "state"),
            ("update", "state"),
            ("fault_kind", "faults"),
            ("line_repairs", "faults"),
            ("bus_messages", "counters"),
            ("line2_busy", "counters"),
        ] {
            assert_eq!(shown(name), Some(group), "{name}");
        }
        let state = || book.items().iter().filter(|item| is_state(item));
        assert!(state().all(|item| group(item.address) != "others"));
        assert!(state().all(|item| !item.name.contains("reserved")));
    }

    #[test]
    fn register_update_is_shown_in_words() {
        assert_eq!(slots(0), "no loader");
        assert_eq!(slots(0b1_0110), "slot B runs, confirmed; slot A confirmed");
        assert_eq!(slots(0b11_1001), "slot A runs, on trial; slot B rejected");
        let switched = "slot A runs, confirmed, chosen by SW01 = 254; slot B empty";
        assert_eq!(slots(0b100_0001), switched);
    }

    #[test]
    fn groups_have_a_heading_and_an_empty_row_between_them() {
        let row = |name: &str| [name.to_owned(), "1".to_owned()];
        let rows = [
            ("state", row("b")),
            ("identity", row("a")),
            ("state", row("c")),
        ];
        let names: Vec<_> = grouped(&rows).into_iter().map(|[name, _]| name).collect();
        assert_eq!(names, ["identity", "  a", "", "state", "  b", "  c"]);
    }

    #[test]
    fn reasons_name_the_exception() {
        let shown = |reason: Unidentified| reason.to_string();
        assert_eq!(
            shown(Unidentified::Exception(1)),
            "exception 01, illegal function"
        );
        assert_eq!(
            shown(Unidentified::Exception(7)),
            "exception 07, negative acknowledge"
        );
        assert_eq!(shown(Unidentified::Damaged), "damaged answer");
        assert_eq!(shown(Unidentified::Lost(Lost::Silent)), "no answer");
    }
}
