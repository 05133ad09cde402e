//! Reads the file of a scenario.
//!
//! ```toml
//! repeat = "20s"              # optional: begin again after this time
//!
//! [[step]]
//! at = "1.5s"                 # from the start of the round, in virtual time
//! board = "pump-house"        # optional: the first board without it
//! slot = 3                    # optional: the first slot without it
//! channel = 1
//! millivolts = 3300           # or energised = true, or manual = true
//! over = "5s"                 # optional, of millivolts: a ramp
//!
//! [[step]]
//! at = "9s"
//! power = "cycle"             # or "on", "off"; or dip = 7, module = "4do", faults = { noise_hz = 20.0 }
//! ```

use std::time::Duration;

use register_map::Module;
use serde::{Deserialize, Deserializer};
use sim::Time;
use sim::options::toml_error;

use super::super::action::{Action, Change};
use super::super::faults::Faults;
use super::super::pace::span;
use super::step::{Deed, Input, Ramp, Step};

/// Longest time in a scenario. The type [`Time`] ends at 213 days.
const LONGEST: Duration = Duration::from_secs(100 * 24 * 3600);
/// Shortest time after which a scenario can begin again.
const SHORTEST_ROUND: Time = Time::from_ms(10);

/// A board that a scenario can name.
#[derive(Clone, Debug)]
pub struct Known {
    /// Name of the board.
    pub name: String,
    /// Ports of the board's slots.
    pub ports: Vec<u8>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default, deserialize_with = "duration")]
    repeat: Option<Duration>,
    #[serde(default)]
    step: Vec<Table>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(default, deserialize_with = "duration")]
    at: Option<Duration>,
    board: Option<String>,
    slot: Option<u8>,
    channel: Option<usize>,
    energised: Option<bool>,
    manual: Option<bool>,
    millivolts: Option<u16>,
    #[serde(default, deserialize_with = "duration")]
    over: Option<Duration>,
    dip: Option<u8>,
    power: Option<Power>,
    module: Option<String>,
    faults: Option<Faults>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Power {
    On,
    Off,
    Cycle,
}

/// Parses a duration such as `1.5s` or `2m`.
fn duration<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Duration>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let parsed = humantime::parse_duration(&text);
    let parsed = parsed.map_err(|error| serde::de::Error::custom(format!("{text:?}: {error}")))?;
    if parsed > LONGEST {
        return Err(serde::de::Error::custom(format!(
            "{text:?}: the longest time is 100 days"
        )));
    }
    Ok(Some(parsed))
}

/// Returns the steps in a file, and the time after which they begin again.
///
/// # Errors
///
/// In one line, the first error and its place.
pub fn parse(text: &str, boards: &[Known]) -> Result<(Vec<Step>, Option<Time>), String> {
    let file: File = toml::from_str(text).map_err(|error| toml_error(text, &error))?;
    if file.step.is_empty() {
        return Err("the file has no [[step]]".to_owned());
    }
    let mut steps: Vec<Step> = Vec::new();
    let mut end = Time::ZERO;
    for (table, number) in file.step.into_iter().zip(1..) {
        let over = table.over.map_or(Time::ZERO, span);
        let step = step(table, boards).map_err(|what| format!("step {number}: {what}"))?;
        end = end.max(step.at + over);
        steps.push(step);
    }
    let repeat = file.repeat.map(span);
    let shortest = SHORTEST_ROUND.max(end);
    if let Some(repeat) = repeat.filter(|repeat| *repeat < shortest) {
        return Err(format!(
            "`repeat` is {repeat}, but a round takes {shortest}"
        ));
    }
    Ok((steps, repeat))
}

fn step(table: Table, boards: &[Known]) -> Result<Step, String> {
    let board = match &table.board {
        None => 0,
        Some(name) => {
            let mut boards = boards.iter();
            boards
                .position(|board| board.name == *name)
                .ok_or_else(|| format!("no board has the name '{name}'"))?
        }
    };
    let ports = &boards[board].ports;
    if let Some(port) = table.slot.filter(|port| !ports.contains(port)) {
        return Err(sim::Error::Slot(port).to_string());
    }
    let at = table.at.map_or(Time::ZERO, span);
    let deed = deed(table)?;
    Ok(Step { at, board, deed })
}

/// Returns the only thing that a step does.
fn deed(table: Table) -> Result<Deed, String> {
    let changes = [
        table.energised.map(Change::Energised),
        table.manual.map(Change::Manual),
        table.millivolts.map(Change::Millivolts),
    ];
    let changes: Vec<Change> = changes.into_iter().flatten().collect();
    let rest = [
        table.dip.is_some(),
        table.power.is_some(),
        table.module.is_some(),
        table.faults.is_some(),
    ];
    let things = changes.len() + rest.iter().filter(|named| **named).count();
    if things != 1 {
        return Err(
            "a step needs exactly one of energised, manual, millivolts, dip, power, module and faults"
                .to_owned(),
        );
    }
    let port = table.slot;
    if port.is_some() && changes.is_empty() && table.module.is_none() {
        return Err("`slot` can stand only with `channel` or `module`".to_owned());
    }
    if table.channel.is_some() == changes.is_empty() {
        return Err(
            "`channel` is needed with energised, manual and millivolts, and only there".to_owned(),
        );
    }
    if table.over.is_some() && table.millivolts.is_none() {
        return Err("`over` can stand only with `millivolts`".to_owned());
    }
    if let (Some(channel), &[change]) = (table.channel, &changes[..]) {
        if !(1..=4).contains(&channel) {
            return Err("channels are numbered 1 to 4".to_owned());
        }
        return match (change, table.over) {
            (Change::Millivolts(3301..), _) => Err("`millivolts` must be 0 to 3300".to_owned()),
            (Change::Millivolts(to), Some(over)) => Ok(Deed::Ramp(Ramp {
                input: Input { port, channel },
                to,
                over: span(over),
                begun: None,
            })),
            _ => Ok(Deed::Act(Action::Channel {
                port,
                channel,
                change,
            })),
        };
    }
    Ok(Deed::Act(match (table.dip, table.power, table.module) {
        (Some(dip), ..) => Action::Dip(dip),
        (_, Some(Power::Cycle), _) => return Ok(Deed::Cycle),
        (_, Some(Power::On), _) => Action::PowerOn,
        (_, Some(Power::Off), _) => Action::PowerOff,
        (.., Some(name)) => {
            let module: Module = name.parse().map_err(|why| format!("'{name}' is {why}"))?;
            Action::Module { port, module }
        }
        _ => {
            let faults = table.faults.unwrap_or_default();
            if faults.is_empty() {
                return Err("`faults` names no fault".to_owned());
            }
            faults.check()?;
            Action::Faults(faults)
        }
    }))
}
