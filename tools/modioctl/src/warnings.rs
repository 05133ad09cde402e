//! Warnings about settings that are allowed and probably not what the user wants, one line each.

pub mod stage;

use std::collections::BTreeSet;

use register_map::codes::{LinkAction, Scale, Signal};

use crate::links::{action_of, acts, is_alone};
use crate::names::{Book, Item, Meaning};
use crate::value::point_name;

/// Returns the warnings about these links, given as their words, of a unit with this COMM_TIMEOUT.
pub fn of_links(book: &Book, links: &[Vec<u16>], comm_timeout: u16) -> Vec<String> {
    let mut warnings = Vec::new();
    let links: Vec<_> = links.iter().filter(|words| acts(words)).collect();
    if comm_timeout == 0 && links.iter().any(|words| is_alone(words[1])) {
        warnings.push("COMM_TIMEOUT is 0, so a link with `if alone` never acts: set the time after which the master counts as gone, such as `modioctl config set COMM_TIMEOUT=5`".to_owned());
    }
    let is_level = |words: &&&Vec<u16>| {
        let action = action_of(words[1]);
        matches!(action, Some(LinkAction::Follow | LinkAction::Invert))
    };
    let sources = links.iter().filter(is_level);
    let sources = sources.filter_map(|words| book.item(&point_name(words[0])));
    let sources: Vec<_> = sources.collect();
    let volts = sources.iter().copied();
    if let Some(names) =
        names(volts.filter(|point| reads(point, |range, _| range == Signal::Voltage.code())))
    {
        warnings.push(format!(
            "{names}: a 0-10 V input has no wire-break detection, so for a link a cut wire is a voltage"
        ));
    }
    if let Some(names) = raw(sources) {
        warnings.push(format!(
            "{names}: SCALE is 0, so the thresholds are raw codes, 0 to 4095: set SCALE to 1 and write the link again"
        ));
    }
    warnings
}

/// Returns the warning about an export of a unit whose analog points are raw codes.
pub fn of_export(book: &Book, unit: u8) -> Option<String> {
    let names = raw(book.points())?;
    Some(format!(
        "unit {unit}, {names}: SCALE is 0, so the values are raw codes, 0 to 4095: set SCALE to 1 and export again"
    ))
}

/// Returns the names of those points whose words are raw codes; `None` when there is none.
fn raw<'a>(points: impl IntoIterator<Item = &'a Item>) -> Option<String> {
    let points = points.into_iter();
    names(points.filter(|point| reads(point, |_, scale| scale == Scale::Raw.code())))
}

/// Returns whether RANGE and SCALE of an analog point are so.
fn reads(point: &Item, is: impl Fn(u16, u16) -> bool) -> bool {
    matches!(&point.meaning, Meaning::Analog(reading) if is(reading.range, reading.scale))
}

fn names<'a>(points: impl Iterator<Item = &'a Item>) -> Option<String> {
    let names: BTreeSet<_> = points.map(|point| point.name.as_str()).collect();
    let names: Vec<_> = names.into_iter().collect();
    (!names.is_empty()).then(|| names.join(", "))
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

    use super::*;
    use crate::names::book;

    #[test]
    fn links_and_exports_that_surprise_are_warned_of() {
        let of = |range, scale, links: &[[u16; 4]], timeout| {
            let book = book(&MODIO_08, Module::Ai4, (range, scale));
            let links: Vec<_> = links.iter().map(|words| words.to_vec()).collect();
            of_links(&book, &links, timeout)
        };
        let level = [8, 1, 180, 150];
        let none = Vec::<String>::new();
        assert_eq!(of(2, 1, &[level], 0), none);
        let alone = of(2, 1, &[[8, 0x101, 180, 150], level], 0);
        assert!(matches!(&alone[..], [text] if text.starts_with("COMM_TIMEOUT is 0")));
        assert_eq!(of(2, 1, &[[8, 0x101, 180, 150]], 50), none);
        let volts = of(0, 1, &[level, level, [9, 2, 180, 150]], 0);
        assert!(matches!(&volts[..], [text] if text.starts_with("p3.1, p3.2: a 0-10 V input")));
        let raw = of(1, 0, &[level], 0);
        assert!(matches!(&raw[..], [text] if text.starts_with("p3.1: SCALE is 0")));
        // Links without a source or an action.
        assert_eq!(of(0, 0, &[[0xFFFF, 1, 0, 0], [8, 0x100, 0, 0]], 0), none);

        let export = |scale| of_export(&book(&MODIO_08, Module::Ai2Ao2, (0, scale)), 7);
        assert!(export(0).unwrap().starts_with("unit 7, p1.1, p1.2, p1.3"));
        assert_eq!(export(1), None);
    }
}
