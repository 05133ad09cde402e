//! The cases, in groups. Each group begins with a table of its cases: name, section, demand, needs and function.
//! rustfmt would give each of these a line.

mod addressing;
mod ascii;
mod bus;
mod configuration;
mod damage;
mod diagnostics;
mod dispatch;
pub mod each_rate;
mod events;
mod fast;
mod files;
mod framing;
mod gaps;
mod heartbeat;
mod hurts;
mod identification;
mod line_counters;
mod mask;
mod outputs;
mod power;
mod read;
mod remote;
mod settings;
mod stage;
mod timing;
mod wires;
mod worked;
mod write_bits;
mod write_words;

use crate::case::{Case, Need};

/// Returns every case that does not need a bench, in the order in which they run. Cases that need a closed lock are first, because it takes a minute
/// to close. Cases that reset counters are late, and cases that restart the unit are last.
pub fn all() -> Vec<Case> {
    let mut all = [
        read::FC01,
        read::FC02,
        read::FC03,
        read::FC04,
        read::ALIKE,
        write_bits::CASES,
        write_words::CASES,
        mask::CASES,
        dispatch::CASES,
        files::CASES,
        identification::CASES,
        events::CASES,
        diagnostics::CASES,
        line_counters::CASES,
        addressing::CASES,
        framing::CASES,
        gaps::CASES,
        damage::CASES,
        bus::CASES,
        timing::CASES,
        ascii::CASES,
        fast::CASES,
        worked::CASES,
        hurts::CASES,
        outputs::CASES,
        heartbeat::CASES,
        configuration::CASES,
        power::CASES,
        settings::CASES,
        stage::CASES,
    ]
    .concat();
    all.sort_by_key(|case| !case.needs.contains(&Need::LockClosed));
    all
}

/// Returns the cases that need what the user or a bench file says about a bench.
pub fn of_bench() -> Vec<Case> {
    [each_rate::CASES, wires::CASES].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Kind;
    use std::collections::BTreeSet;

    #[test]
    fn case_about_the_modio_is_not_an_interpretation() {
        for case in all() {
            let about_modio = case.needs.contains(&Need::Modio) || case.section.starts_with("map");
            assert_eq!(case.kind == Kind::Modio, about_modio, "{}", case.name);
        }
        let interpretations = all()
            .iter()
            .filter(|c| c.kind == Kind::Interpretation)
            .count();
        assert!(interpretations > 20, "{interpretations}");
    }

    #[test]
    fn case_has_a_unique_name_a_source_and_a_demand() {
        let mut names = BTreeSet::new();
        for case in [all(), of_bench()].concat() {
            assert!(names.insert(case.name), "{} twice", case.name);
            assert!(case.name.contains('/') && !case.name.contains(' '));
            let known = ["V1.02 ", "V1.1b3 ", "Fast Modbus", "map", "manual"];
            assert!(
                known.iter().any(|source| case.section.starts_with(source)),
                "{}: {}",
                case.name,
                case.section
            );
            assert!(!case.about.is_empty() && !case.about.contains('|'));
        }
    }
}
