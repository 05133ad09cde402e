//! Times, which may have another unit than their register, and the times of MAX_ON.

use modio_description::Unit;
use register_map::stage::{MINUTES, max_on_ms};
use serde_json::json;

use super::{Shown, number, quantities, unit_name};

/// Units of time, in seconds. `s` is last, because others end with it.
const TIMES: [(&str, f64); 4] = [("ms", 0.001), ("min", 60.0), ("h", 3600.0), ("s", 1.0)];

/// Largest difference between a quantity and a step, in steps.
const NEAR: f64 = 1e-6;

/// Returns a quantity in steps of the unit; `None` when it is not a number, has another unit, or lies between two
/// steps. A time may have any of [`TIMES`].
pub fn steps(text: &str, unit: &Unit) -> Option<i64> {
    let steps = quantity(text, unit)?;
    let whole = steps.round();
    let near = (steps - whole).abs() < NEAR && whole.abs() < 1e9;
    near.then_some(whole as i64 - i64::from(unit.offset))
}

/// Returns `, in steps of 0.1 s` for a quantity that lies between two steps, and nothing for any other text.
pub fn between(text: &str, unit: &Unit) -> String {
    let is_between = |steps: f64| (steps - steps.round()).abs() >= NEAR;
    if !quantity(text, unit).is_some_and(is_between) {
        return String::new();
    }
    let step = Unit {
        offset: 0,
        ..unit.clone()
    };
    format!(", in steps of {}", number(1, &step))
}

fn quantity(text: &str, unit: &Unit) -> Option<f64> {
    let shown = unit_name(&unit.code);
    let text = text.trim();
    let time_of = |code: &str| TIMES.iter().find(|(time, _)| *time == code);
    let (number, factor) = match time_of(&unit.code) {
        Some((_, own)) => {
            let given = TIMES.iter().find(|(time, _)| text.ends_with(time));
            given.map_or((text, 1.0), |(time, factor)| {
                (text.strip_suffix(time).unwrap_or(text), factor / own)
            })
        }
        None => {
            let number = text.strip_suffix(shown).or(text.strip_suffix(&unit.code));
            (number.unwrap_or(text), 1.0)
        }
    };
    let quantity: f64 = number.trim().parse().ok()?;
    Some(quantity * factor / 10_f64.powi(unit.exponent.into()))
}

/// The values of MAX_ON, for people.
pub const LONGEST_ON: &str = "0, 0.1 to 3276.7 s in steps of 0.1 s, or 1 to 32767 whole minutes";

/// The unit of MAX_ON below [`MINUTES`], and of the time of a pulse.
fn tenths() -> Unit {
    Unit {
        code: "s".to_owned(),
        exponent: -1,
        offset: 0,
    }
}

/// Formats a value of MAX_ON. For programs it is in seconds.
pub fn longest_on(word: u16) -> Shown {
    match word {
        1..MINUTES => number(word.into(), &tenths()),
        _ => Shown {
            json: json!(max_on_ms(word) / 1000),
            ..super::text(&match word {
                0 => "0".to_owned(),
                _ => format!("{} min", word - MINUTES),
            })
        },
    }
}

/// Returns the word of the time of a pulse: a time in seconds, or with its unit. The error contains the allowed times.
pub fn time_of_pulse(text: &str) -> Result<u16, String> {
    let time = steps(text, &tenths()).and_then(|time| u16::try_from(time).ok());
    time.filter(|time| *time > 0).ok_or_else(|| {
        let takes = quantities(1, u16::MAX.into(), &tenths());
        let step = between(text, &tenths());
        format!("the time of a pulse is {takes}{step}, not {text:?}")
    })
}

/// Returns the word of MAX_ON for a text: a time in seconds, or with its unit.
pub fn longest_on_of(text: &str) -> Option<u16> {
    let tenths = steps(text, &tenths())?;
    let in_minutes = ["min", "h"].iter().any(|unit| text.trim().ends_with(unit));
    let minutes = (tenths % 600 == 0).then_some(tenths / 600);
    match u16::try_from(tenths) {
        Ok(0) => Some(0),
        Ok(word @ ..MINUTES) if !in_minutes || minutes.is_none() => Some(word),
        _ => {
            let minutes = u16::try_from(minutes?).ok();
            minutes
                .filter(|minutes| (1..MINUTES).contains(minutes))
                .map(|minutes| MINUTES + minutes)
        }
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

    use super::*;
    use crate::names;
    use crate::value::{parse, show};

    #[test]
    fn times_may_have_another_unit_of_time() {
        let book = names::book(&MODIO_08, Module::Do4, (0, 0));
        for (name, text, word) in [
            ("p1.1.dead_time", "500ms", 50),
            ("p1.1.dead_time", "0.5", 50),
            ("p1.1.min_off", "3 min", 1800),
            ("p1.1.min_off", "1h", 36_000),
            ("COMM_TIMEOUT", "1500 ms", 15),
            ("RESPONSE_DELAY", "0.5s", 500),
            ("RESPONSE_DELAY", "20", 20),
        ] {
            let words = parse(&book.find(name).unwrap(), text, false);
            assert_eq!(words, Ok(vec![word]), "{name} = {text}");
        }
    }

    #[test]
    fn value_between_two_steps_is_rejected_with_the_step() {
        let book = names::book(&MODIO_08, Module::Do4, (0, 0));
        for (name, text, takes) in [
            ("dead_time", "10ms", "it takes 0.02 to 10.00 s, or 0"),
            ("dead_time", "15ms", "or 0, in steps of 0.01 s"),
            ("min_off", "0.05", "0.0 to 6553.5 s, in steps of 0.1 s"),
            ("max_on", "90.5min", "or 1 to 32767 whole minutes"),
        ] {
            let item = book.find(&format!("p1.1.{name}")).unwrap();
            let wrong = parse(&item, text, false).unwrap_err().to_string();
            assert!(wrong.ends_with(takes), "{text}: {wrong}");
        }
    }

    #[test]
    fn longest_time_on_is_in_tenths_of_a_second_or_in_minutes() {
        let book = names::book(&MODIO_08, Module::Do4, (0, 0));
        let item = book.find("p1.1.max_on").unwrap();
        for (text, word, as_shown) in [
            ("0", 0, "0"),
            ("90s", 900, "90.0 s"),
            ("0.1", 1, "0.1 s"),
            ("3276.7", 0x7FFF, "3276.7 s"),
            ("600", 6000, "600.0 s"),
            ("10min", 0x800A, "10 min"),
            ("1.5 h", 0x805A, "90 min"),
            ("1.5 min", 900, "90.0 s"),
            ("3600 s", 0x803C, "60 min"),
            ("32767 min", 0xFFFF, "32767 min"),
            ("0x800A", 0x800A, "10 min"),
        ] {
            assert_eq!(parse(&item, text, false), Ok(vec![word]), "{text}");
            assert_eq!(show(&item, &[word], false).to_string(), as_shown);
            assert_eq!(parse(&item, as_shown, false), Ok(vec![word]), "{as_shown}");
        }
        assert_eq!(show(&item, &[0x800A], true).text, "32778");
        assert_eq!(show(&item, &[0x800A], false).json, json!(600));
        for text in ["3276.8", "0.05 s", "32768 min", "0x8000", "-1", "ten"] {
            let wrong = parse(&item, text, false).unwrap_err().to_string();
            assert!(wrong.ends_with(LONGEST_ON), "{text}: {wrong}");
        }
    }
}
