//! Warnings about DEAD_TIME, MAX_ON and MIN_OFF of digital outputs.

use std::collections::BTreeSet;

use register_map::codes::LinkAction;
use register_map::configuration::AS_IT_WAS;
use register_map::stage::max_on_ms;

use crate::links::{action_of, acts};
use crate::names::{Book, Item, Meaning};
use crate::value::{point_name, point_of};

/// The settings that [`warnings`] compares, by the ends of their names.
const SETTINGS: [&str; 7] = [
    "dead_time",
    "max_on",
    "min_off",
    "start",
    "safe",
    "link1",
    "link2",
];

/// Returns the first point of the two channels that can be a pair, for a setting that [`warnings`] compares.
pub fn pair_of(item: &Item) -> Option<u16> {
    let (point, setting) = item.name.rsplit_once('.')?;
    let number = SETTINGS.contains(&setting).then(|| point_of(point))?;
    number.map(|number| number & !1)
}

/// Returns the setting DEAD_TIME of each two outputs that can be a pair.
pub fn pairs(book: &Book) -> Vec<Item> {
    let outputs = book.points().filter_map(|point| point_of(&point.name));
    let pairs = outputs.filter(|point| point & 1 == 0 && can_be_pair(book, *point));
    let names = pairs.map(|first| format!("{}.dead_time", point_name(first)));
    names.filter_map(|name| book.item(&name).cloned()).collect()
}

fn can_be_pair(book: &Book, first: u16) -> bool {
    is_output(book, &point_name(first)) && is_output(book, &point_name(first | 1))
}

fn is_output(book: &Book, point: &str) -> bool {
    let point = book.item(point);
    point.is_some_and(|point| point.meaning == Meaning::Bit && point.writable)
}

/// Returns the settings to compare after these settings were written, of a unit that has DEAD_TIME.
pub fn items<'a>(book: &Book, written: impl Iterator<Item = &'a Item>) -> Vec<Item> {
    let has_stage = |first: &u16| {
        let name = format!("{}.dead_time", point_name(*first));
        book.item(&name).is_some()
    };
    let concerned: BTreeSet<_> = written.filter_map(pair_of).filter(has_stage).collect();
    let is_concerned = |item: &&Item| pair_of(item).is_some_and(|pair| concerned.contains(&pair));
    let items = book.items().iter();
    items.filter(is_concerned).cloned().collect()
}

/// Returns the warnings about the settings of [`items`] with these words.
pub fn warnings(book: &Book, items: &[Item], values: &[Vec<u16>]) -> Vec<String> {
    let words = |name: String| {
        let mut all = items.iter().zip(values);
        let found = all.find(|(item, _)| item.name == name);
        found.map_or(&[][..], |(_, words)| &words[..])
    };
    let word = |point: &str, setting| {
        let words = words(format!("{point}.{setting}"));
        words.first().copied().unwrap_or_default()
    };
    let mut warnings = Vec::new();
    let firsts: BTreeSet<_> = items.iter().filter_map(pair_of).collect();
    for first in firsts {
        let points = [first, first | 1].map(point_name);
        let [lower, upper] = &points;
        let can_be_pair = can_be_pair(book, first);
        for point in &points {
            if word(point, "dead_time") != 0 && !(can_be_pair && point == lower) {
                let why = match can_be_pair {
                    true => format!("DEAD_TIME of {lower} and {upper} is {lower}.dead_time"),
                    false => format!("{lower} and {upper} are not two digital outputs"),
                };
                warnings.push(format!("{point}.dead_time has no effect: {why}"));
            }
            for setting in ["max_on", "min_off"] {
                if word(point, setting) != 0 && !is_output(book, point) {
                    warnings.push(format!(
                        "{point}.{setting} has no effect: {point} is no digital output"
                    ));
                }
            }
        }
        let dead = match can_be_pair {
            true => word(lower, "dead_time"),
            false => 0,
        };
        for (setting, name, when) in [
            ("start", "START", "after a power cut"),
            ("safe", "SAFE", "when the master is silent"),
        ] {
            let values = [lower, upper].map(|point| word(point, setting));
            if dead != 0 && values == [1, 1] {
                warnings.push(format!(
                    "{lower} and {upper} are a pair, and {name} of both is 1: neither goes on {when}"
                ));
                continue;
            }
            for (point, value) in points.iter().zip(values) {
                if dead != 0 && matches!(value, 1 | AS_IT_WAS) {
                    warnings.push(format!(
                        "{point} is one of a pair, and its {name} is not 0: a motor there drives off by itself {when}; `modioctl write {point}.{setting}=0`"
                    ));
                }
            }
        }
        for point in &points {
            let max_on = max_on_ms(word(point, "max_on"));
            let rests = [
                ("MIN_OFF", u32::from(word(point, "min_off")) * 100),
                ("DEAD_TIME", u32::from(dead) * 10),
            ];
            for link in ["link1", "link2"] {
                let name = format!("{point}.{link}");
                of_pulse(&name, words(name.clone()), max_on, rests, &mut warnings);
            }
        }
    }
    warnings
}

/// Adds the warnings about a link whose pulse does not suit the times of its output, in milliseconds; 0 = none.
fn of_pulse(
    name: &str,
    words: &[u16],
    max_on: u32,
    rests: [(&str, u32); 2],
    warnings: &mut Vec<String>,
) {
    let [_, action, time, ..] = *words else {
        return;
    };
    if !acts(words) || action_of(action) != Some(LinkAction::Pulse) {
        return;
    }
    let pulse = u32::from(time) * 100;
    if max_on != 0 && pulse > max_on {
        warnings.push(format!(
            "{name}: the pulse is longer than MAX_ON, which ends it"
        ));
    }
    for (rest, time) in rests {
        if time != 0 && pulse <= time {
            warnings.push(format!(
                "{name}: the pulse is not longer than {rest}, so it can end before the output goes on"
            ));
        }
    }
}

/// Returns the warning that a DEAD_TIME that was set is 0.
pub fn of_lost_pair(dead_time: &Item) -> String {
    let lower = dead_time.name.trim_end_matches(".dead_time");
    let upper = point_name(point_of(lower).unwrap_or_default() | 1);
    format!(
        "{lower} and {upper} are no pair any more: their DEAD_TIME is 0, and nothing keeps them apart"
    )
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::names::book;

    /// Returns the warnings after these settings were written to a unit where all others are 0.
    fn of(module: Module, settings: &[(&str, &[u16])]) -> Vec<String> {
        let book = book(&MODIO_08, module, (0, 0));
        let written: Vec<_> = settings
            .iter()
            .map(|(name, _)| book.find(name).unwrap())
            .collect();
        let items = items(&book, written.iter());
        let values = items.iter().map(|item| {
            let set = settings.iter().find(|(name, _)| *name == item.name);
            set.map_or_else(|| vec![0; item.words.into()], |(_, words)| words.to_vec())
        });
        warnings(&book, &items, &values.collect::<Vec<_>>())
    }

    fn starts(warnings: &[String], starts: &[&str]) {
        assert_eq!(warnings.len(), starts.len(), "{warnings:?}");
        for (warning, start) in warnings.iter().zip(starts) {
            assert!(warning.starts_with(start), "{warning}");
        }
    }

    #[test]
    fn only_the_settings_of_the_two_channels_that_were_written_are_compared() {
        let compared = |board, name: &str| {
            let book = book(board, Module::Do4, (0, 0));
            let items = items(&book, std::iter::once(&book.find(name).unwrap()));
            items.into_iter().map(|item| item.name).collect::<Vec<_>>()
        };
        let all = compared(&MODIO_08, "p2.4.link2");
        assert_eq!(all.len(), 2 * SETTINGS.len());
        assert!(
            all.iter()
                .all(|name| name.starts_with("p2.3") || name.starts_with("p2.4"))
        );
        assert!(compared(&MODIO_08, "p2.1.range").is_empty());
        assert!(compared(&MODIO_02, "p5.1.safe").is_empty());
    }

    #[test]
    fn times_without_effect_are_warned_of() {
        let times: [(&str, &[u16]); 4] = [
            ("p2.1.dead_time", &[50]),
            ("p2.4.dead_time", &[50]),
            ("p2.1.max_on", &[1]),
            ("p2.2.min_off", &[1]),
        ];
        starts(
            &of(Module::Do4, &times),
            &["p2.4.dead_time has no effect: DEAD_TIME of p2.3 and p2.4 is p2.3.dead_time"],
        );
        starts(
            &of(Module::Relay2, &times),
            &[
                "p2.1.dead_time has no effect: p2.1 and p2.2 are not two digital outputs",
                "p2.1.max_on has no effect: p2.1 is no digital output",
                "p2.2.min_off has no effect: p2.2 is no digital output",
                "p2.4.dead_time has no effect: DEAD_TIME of p2.3",
            ],
        );
    }

    #[test]
    fn pair_that_starts_or_is_safe_with_an_output_on_is_warned_of() {
        let dead: (&str, &[u16]) = ("p2.1.dead_time", &[50]);
        let on = |name| (name, &[1][..]);
        let [start, safe] = [on("p2.1.start"), on("p2.2.safe")];
        starts(&of(Module::Do4, &[start, safe]), &[]);
        starts(&of(Module::Do4, &[dead, on("p2.3.start")]), &[]);
        starts(
            &of(
                Module::Do4,
                &[dead, start, ("p2.2.start", &[AS_IT_WAS]), safe],
            ),
            &[
                "p2.1 is one of a pair, and its START is not 0: a motor there drives off",
                "p2.2 is one of a pair, and its START is not 0",
                "p2.2 is one of a pair, and its SAFE is not 0",
            ],
        );
        starts(
            &of(
                Module::Do4,
                &[dead, start, on("p2.2.start"), safe, on("p2.1.safe")],
            ),
            &[
                "p2.1 and p2.2 are a pair, and START of both is 1: neither goes on after a power cut",
                "p2.1 and p2.2 are a pair, and SAFE of both is 1: neither",
            ],
        );
    }

    #[test]
    fn pulses_that_do_not_suit_the_times_are_warned_of() {
        let pulse: (&str, &[u16]) = ("p2.1.link1", &[0, 4, 900, 0]);
        starts(
            &of(
                Module::Do4,
                &[("p2.1.max_on", &[899]), ("p2.1.min_off", &[900]), pulse],
            ),
            &[
                "p2.1.link1: the pulse is longer than MAX_ON",
                "p2.1.link1: the pulse is not longer than MIN_OFF",
            ],
        );
        let short: (&str, &[u16]) = ("p2.2.link2", &[0, 4, 5, 0]);
        starts(
            &of(Module::Do4, &[("p2.1.dead_time", &[50]), pulse, short]),
            &["p2.2.link2: the pulse is not longer than DEAD_TIME"],
        );
        starts(
            &of(
                Module::Do4,
                &[("p2.1.max_on", &[0x8002]), ("p2.1.min_off", &[899]), pulse],
            ),
            &[],
        );
    }

    #[test]
    fn pairs_are_two_digital_outputs_of_a_unit_with_dead_time() {
        let names = |board, module| {
            let pairs = pairs(&book(board, module, (0, 0)));
            let warnings = pairs.iter().map(of_lost_pair);
            warnings.collect::<Vec<_>>()
        };
        let all = names(&MODIO_08, Module::Do4);
        assert_eq!(all.len(), 8);
        starts(&all[..1], &["p1.1 and p1.2 are no pair any more"]);
        let relays = names(&MODIO_08, Module::Relay2);
        assert_eq!(relays.len(), 4);
        starts(&relays[..1], &["p1.3 and p1.4 are no pair"]);
        starts(&names(&MODIO_02, Module::Do4), &[]);
    }
}
