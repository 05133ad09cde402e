//! Values of points and registers, formatted for people and programs, and parsed from the user's input.

mod time;

use modio_description::{Field, Table, Unit, Value, Values};
use register_map::codes::LinkAction;
use register_map::stage::MINUTES;
use serde_json::{Value as Json, json};

use time::{LONGEST_ON, between};
pub use time::{steps, time_of_pulse};

use crate::failure::Failure;
use crate::names::{Item, Meaning, number_of};

/// A value as read: one or more registers, or a bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// For people, without the unit.
    pub text: String,
    /// The unit for people; empty when there is none.
    pub unit: String,
    /// For programs: a number, a bool or a text.
    pub json: Json,
}

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.unit.as_str() {
            "" => f.write_str(&self.text),
            unit => write!(f, "{} {unit}", self.text),
        }
    }
}

/// Formats the words of an item. With `raw` they are shown as numbers without meaning.
pub fn show(item: &Item, words: &[u16], raw: bool) -> Shown {
    let first = words.first().copied().unwrap_or_default();
    match &item.meaning {
        Meaning::Bit if raw => number(first.into(), &Unit::default()),
        Meaning::Bit => Shown {
            json: json!(first != 0),
            ..text(if first == 0 { "off" } else { "on" })
        },
        Meaning::Analog(reading) if !raw => number(signed(first, reading.min), &reading.unit),
        Meaning::Value(value) => register(value, words, raw),
        Meaning::LongestOn if !raw => time::longest_on(first),
        Meaning::Analog(_) | Meaning::LongestOn | Meaning::Unknown => {
            number(first.into(), &Unit::default())
        }
    }
}

/// Returns a word as a number, in two's complement when values below 0 are possible.
fn signed(word: u16, min: i32) -> i64 {
    if min < 0 {
        i64::from(word.cast_signed())
    } else {
        word.into()
    }
}

/// Returns the number in two words, high word first.
pub fn long(words: &[u16]) -> u32 {
    words
        .iter()
        .fold(0, |long, word| long << 16 | u32::from(*word))
}

fn register(value: &Value, words: &[u16], raw: bool) -> Shown {
    let first = words.first().copied().unwrap_or_default();
    let plain = Unit::default();
    match value {
        Value::Number(unit) => number(first.into(), if raw { &plain } else { unit }),
        Value::Long(unit) => number(long(words).into(), if raw { &plain } else { unit }),
        Value::Codes(names) if !raw => match names.iter().find(|(code, _)| *code == first) {
            Some((_, name)) => text(name),
            None => number(first.into(), &plain),
        },
        Value::Bits(names) if !raw => {
            let is_set = |bit: u8| bit < 16 && first >> bit & 1 == 1;
            let set = names.iter().filter(|(bit, _)| is_set(*bit));
            let set: Vec<_> = set.map(|(_, name)| name.as_str()).collect();
            let shown = set.join(", ");
            Shown {
                json: json!(set),
                ..text(if set.is_empty() { "-" } else { &shown })
            }
        }
        Value::Codes(_) | Value::Bits(_) => number(first.into(), &plain),
        Value::Opaque => {
            let digits: String = words.iter().map(|word| format!("{word:04X}")).collect();
            text(&digits)
        }
        Value::Point => match first {
            NO_POINT => text("none"),
            point => text(&point_name(point)),
        },
        Value::Fields { fields, .. } => text(&shown_fields(fields, words, raw)),
    }
}

/// The address that stands for no point.
const NO_POINT: u16 = 0xFFFF;

/// Returns the name of the point with this address.
pub fn point_name(address: u16) -> String {
    format!("p{}.{}", address / 4 + 1, address % 4 + 1)
}

/// Returns the values of fields, without those at the end that are the default; `none` when all are.
fn shown_fields(fields: &[Field], words: &[u16], raw: bool) -> String {
    let pairs = fields.iter().zip(words);
    let last = pairs
        .clone()
        .rposition(|(field, word)| *word != field.default);
    let Some(last) = last else {
        return "none".to_owned();
    };
    let shown = pairs.map(|(field, word)| register(&field.value, &[*word], raw).to_string());
    shown.take(last + 1).collect::<Vec<_>>().join(", ")
}

/// Returns the words of fields in `text`, which are separated by commas. Those that are missing at the end have their
/// defaults. `none` stands for the defaults of all. The time of a pulse is a number in 0.1 s, or has a unit.
fn fields_of(item: &Item, fields: &[Field], text: &str, raw: bool) -> Result<Vec<u16>, String> {
    let mut texts = text.split(',').map(str::trim).peekable();
    if text.trim().eq_ignore_ascii_case("none") {
        texts.next();
    }
    let mut all = Vec::new();
    for field in fields {
        let Some(text) = texts.next() else {
            all.push(field.default);
            continue;
        };
        let is_time = matches!(all[..], [_, action] if LinkAction::from_code(action & 0xFF) == Some(LinkAction::Pulse));
        if is_time && number_of(text).is_none() && text.ends_with(char::is_alphabetic) {
            all.push(time_of_pulse(text)?);
            continue;
        }
        let field_item = Item {
            name: field.name.clone(),
            words: 1,
            meaning: Meaning::Value(field.value.clone()),
            values: Some(field.values.clone()),
            ..item.clone()
        };
        let word = words(&field_item, text, raw);
        all.extend(word.map_err(|takes| format!("{}: {takes}", field.name))?);
    }
    match texts.next() {
        None => Ok(all),
        Some(_) => Err(format!(
            "it has {} parts, separated by commas",
            fields.len()
        )),
    }
}

/// Returns a text as a value.
pub fn text(text: &str) -> Shown {
    Shown {
        json: json!(text),
        text: text.to_owned(),
        unit: String::new(),
    }
}

fn number(number: i64, unit: &Unit) -> Shown {
    let text = decimal(number + i64::from(unit.offset), unit.exponent);
    Shown {
        json: match text.parse::<i64>() {
            Ok(whole) => json!(whole),
            Err(_) => json!(text.parse::<f64>().unwrap_or_default()),
        },
        text,
        unit: unit_name(&unit.code).to_owned(),
    }
}

/// Returns `number * 10^exponent` in decimal digits.
fn decimal(number: i64, exponent: i8) -> String {
    let places = usize::from(exponent.min(0).unsigned_abs());
    if places == 0 {
        let zeros = "0".repeat(exponent.unsigned_abs().into());
        return if number == 0 {
            "0".to_owned()
        } else {
            format!("{number}{zeros}")
        };
    }
    let digits = format!("{:0>width$}", number.unsigned_abs(), width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    let sign = if number < 0 { "-" } else { "" };
    format!("{sign}{whole}.{fraction}")
}

/// Returns the name of a UCUM unit for people.
pub fn unit_name(code: &str) -> &str {
    match code {
        "Cel" => "°C",
        "uA" => "µA",
        "By" => "bytes",
        code => code,
    }
}

/// Returns the words for the value in `text`. With `raw` it is a register's number. The error contains the allowed
/// values.
pub fn parse(item: &Item, text: &str, raw: bool) -> Result<Vec<u16>, Failure> {
    let name = &item.name;
    if !item.writable {
        return Err(Failure::usage(format!("{name} can only be read")));
    }
    words(item, text, raw)
        .map_err(|takes| Failure::usage(format!("{name} does not allow {text:?}: {takes}")))
}

/// Returns the words for the value in `text`, also for an item that can only be read. The error contains only the allowed
/// values.
pub fn words_of(item: &Item, text: &str) -> Result<Vec<u16>, String> {
    words(item, text, false)
}

/// As [`parse`], for an item that can be written. The error contains only the allowed values.
fn words(item: &Item, text: &str, raw: bool) -> Result<Vec<u16>, String> {
    let word = number_of(text);
    if raw && item.words == 1 {
        let word = word.ok_or("--raw needs a number from 0 to 65535")?;
        return check_raw(item, word).map(|()| vec![word]);
    }
    let word = match &item.meaning {
        Meaning::Bit => match text.to_lowercase().as_str() {
            "1" | "on" | "true" => 1,
            "0" | "off" | "false" => 0,
            _ => return Err("it is on or off".to_owned()),
        },
        Meaning::Analog(reading) => {
            let takes = || {
                let range = range(reading.min.into(), reading.max.into(), &reading.unit);
                range + &between(text, &reading.unit)
            };
            let number = steps(text, &reading.unit).ok_or_else(takes)?;
            let allowed = i64::from(reading.min)..=i64::from(reading.max);
            // A unit may describe a range that its register cannot have.
            let word = if reading.min < 0 {
                i16::try_from(number).map(i16::cast_unsigned)
            } else {
                u16::try_from(number)
            };
            let word = word.ok().filter(|_| allowed.contains(&number));
            word.ok_or_else(takes)?
        }
        Meaning::Value(Value::Codes(names)) => {
            let wanted = text.to_lowercase();
            let named = names.iter().find(|(_, name)| name.to_lowercase() == wanted);
            let code = named.map(|(code, _)| *code).or(word);
            code.filter(|code| item.allows(*code)).ok_or_else(|| {
                let takes = names.iter().filter(|(code, _)| item.allows(*code));
                let takes = takes.map(|(code, name)| format!("{code} = {name}"));
                format!("it takes {}", takes.collect::<Vec<_>>().join(", "))
            })?
        }
        Meaning::Value(Value::Number(unit)) => {
            // A value outside the unit's range, such as 0xFFFF for hold, is written unchanged.
            let word = match text.get(..2) {
                Some("0x" | "0X") => word.map(i64::from),
                _ => steps(text, unit),
            };
            let word = word.and_then(|word| u16::try_from(word).ok());
            word.filter(|word| item.allows(*word))
                .ok_or_else(|| match &item.values {
                    Some(values @ Values::OneOf(_)) => takes(values, unit),
                    Some(values) => takes(values, unit) + &between(text, unit),
                    None => "it takes 0 to 65535".to_owned(),
                })?
        }
        Meaning::Value(Value::Long(_)) => {
            // The only long value that can be written is 0, which clears a counter.
            return match text {
                "0" => Ok(vec![0; usize::from(item.words)]),
                _ => Err("it can only be cleared, by 0".to_owned()),
            };
        }
        Meaning::Value(Value::Bits(_)) => word.ok_or("it takes a number")?,
        Meaning::Value(Value::Point) if text.eq_ignore_ascii_case("none") => NO_POINT,
        Meaning::Value(Value::Point) => {
            let point = point_of(text).or(word);
            point.ok_or("it takes a point such as p1.1, or none")?
        }
        Meaning::Value(Value::Fields { fields, .. }) => {
            return fields_of(item, fields, text, raw);
        }
        Meaning::LongestOn => match text.get(..2) {
            Some("0x" | "0X") => word.filter(|word| *word != MINUTES),
            _ => time::longest_on_of(text),
        }
        .ok_or_else(|| format!("it takes {LONGEST_ON}"))?,
        Meaning::Value(Value::Opaque) => {
            return Err("it has no values that can be written".to_owned());
        }
        Meaning::Unknown => word.ok_or("it takes 0 to 65535")?,
    };
    Ok(vec![word])
}

/// Returns the address of a point, `p1.1` or `1.1`.
pub fn point_of(text: &str) -> Option<u16> {
    let (port, channel) = text
        .strip_prefix(['p', 'P'])
        .unwrap_or(text)
        .split_once('.')?;
    let (port, channel) = (number_of(port)?, number_of(channel)?);
    let known = (1..=8).contains(&port) && (1..=4).contains(&channel);
    known.then(|| (port - 1) * 4 + channel - 1)
}

fn check_raw(item: &Item, word: u16) -> Result<(), String> {
    match (&item.meaning, &item.values) {
        (Meaning::Bit, _) if word > 1 => Err("a bit is 0 or 1".to_owned()),
        (_, Some(values)) if !item.allows(word) => Err(takes(values, &Unit::default())),
        _ => Ok(()),
    }
}

/// Describes the values that a register allows, in its unit.
pub fn takes(values: &Values, unit: &Unit) -> String {
    match values {
        Values::Range(min, max) => range((*min).into(), (*max).into(), unit),
        // The value outside the range has a special meaning, unless it is 0.
        Values::RangeOr(also, min, max) => {
            let range = range((*min).into(), (*max).into(), unit);
            match also {
                0 => format!("{range}, or 0"),
                also => format!("{range}, or {also:#06X}"),
            }
        }
        Values::OneOf(values) => {
            let each = values.iter().map(|value| number((*value).into(), unit));
            let each: Vec<_> = each.map(|shown| shown.text).collect();
            let takes = format!("it takes {} {}", each.join(", "), unit_name(&unit.code));
            takes.trim_end().to_owned()
        }
    }
}

fn range(min: i64, max: i64, unit: &Unit) -> String {
    if min == max {
        // A single allowed value is a key, or a 0 that clears something, and not a quantity.
        return match min {
            0..10 => format!("it takes only {min}"),
            _ => format!("it takes only {min:#06X}"),
        };
    }
    format!("it takes {}", quantities(min, max, unit))
}

/// Describes the quantities of a range of numbers, such as `0 to 10000 mV`.
pub fn quantities(min: i64, max: i64, unit: &Unit) -> String {
    format!("{} to {}", number(min, unit).text, number(max, unit))
}

/// Returns the name of a table, for people.
pub const fn table_name(table: Table) -> &'static str {
    match table {
        Table::Bit => "bit",
        Table::Word => "word",
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::names::{self, Book};

    fn book(range: u16, scale: u16) -> Book {
        names::book(&MODIO_02, Module::Ai2Ao2, (range, scale))
    }

    fn shown(name: &str, words: &[u16]) -> String {
        show(&book(2, 1).find(name).unwrap(), words, false).to_string()
    }

    fn parsed(book: &Book, name: &str, text: &str) -> Result<u16, String> {
        let words = parse(&book.find(name).unwrap(), text, false);
        words
            .map(|words| words[0])
            .map_err(|failure| failure.to_string())
    }

    #[test]
    fn values_have_their_units_and_names() {
        assert_eq!(shown("p5.1", &[0xFF83]), "-12.5 °C");
        assert_eq!(shown("p5.1", &[5]), "0.5 °C");
        assert_eq!(shown("BAUD", &[1152]), "115200 bit/s");
        assert_eq!(shown("FORMAT", &[1]), "8E1");
        assert_eq!(shown("FRAME_GAP", &[12]), "1.2 ms");
        assert_eq!(shown("LORA_CHANNEL", &[23]), "433 MHz");
        assert_eq!(shown("uptime", &[1, 2]), "65538 s");
        assert_eq!(shown("status", &[0]), "-");
        assert_eq!(shown("FORMAT", &[99]), "99", "a code without a name");
        let temperature = show(&book(2, 1).find("p5.1").unwrap(), &[0xFF83], false);
        assert_eq!(temperature.json, json!(-12.5));
        assert_eq!(
            show(&book(2, 1).find("p5.1").unwrap(), &[0xFF83], true).text,
            "65411"
        );
    }

    #[test]
    fn values_are_parsed_into_registers() {
        let book = book(1, 1);
        assert_eq!(parsed(&book, "BAUD", "115200"), Ok(1152));
        assert_eq!(parsed(&book, "BAUD", "19200 bit/s"), Ok(192));
        assert_eq!(parsed(&book, "FORMAT", "8e1"), Ok(1));
        assert_eq!(parsed(&book, "FRAME_GAP", "1.2"), Ok(12));
        assert_eq!(parsed(&book, "p5.3", "12000"), Ok(12_000));
        assert_eq!(parsed(&book, "p5.3.safe", "0xFFFF"), Ok(0xFFFF));
        assert_eq!(parsed(&book, "p5.module", "4ai"), Ok(4));
        assert_eq!(parsed(&book, "LORA_CHANNEL", "433"), Ok(23));
    }

    #[test]
    fn fields_are_separated_by_commas() {
        let book = names::book(&MODIO_08, Module::Relay2, (0, 0));
        let link = book.find("p1.3.link1").unwrap();
        for (text, words) in [
            ("none", [0xFFFF, 0, 0, 0]),
            ("p1.1, toggle", [0, 3, 0, 0]),
            ("p1.2, pulse if alone, 25", [1, 0x104, 25, 0]),
            ("p1.1, follow, 0, 7", [0, 1, 0, 7]),
            ("none, set", [0xFFFF, 5, 0, 0]),
        ] {
            assert_eq!(show(&link, &words, false).text, text);
            assert_eq!(parse(&link, text, false), Ok(words.to_vec()));
        }
        assert_eq!(show(&link, &[16, 3, 0, 0], true).text, "p5.1, 3");
        for (text, words) in [
            ("5.1,TOGGLE", [16, 3, 0, 0]),
            ("p1.1, pulse, 1.5min", [0, 4, 900, 0]),
            ("p1.1, pulse if alone, 0x1F", [0, 0x104, 31, 0]),
        ] {
            assert_eq!(parse(&link, text, false), Ok(words.to_vec()), "{text}");
        }
        let wrong = |text| parse(&link, text, false).unwrap_err().to_string();
        assert!(wrong("p9.1").contains("source: it takes a point such as p1.1"));
        assert!(wrong("p5.1, blink").contains("action: it takes 0 = none, 1 = follow"));
        assert!(wrong("p5.1, set, 1, 2, 3").contains("it has 4 parts"));
        assert!(wrong("p5.1, pulse, 2h").contains("0.1 to 6553.5 s, not \"2h\""));
        assert!(wrong("p5.1, set, 90s").contains("time or high: it takes 0 to 65535"));
    }

    #[test]
    fn a_value_out_of_range_is_rejected_with_the_range() {
        let book = book(1, 1);
        let wrong = |name, text| parsed(&book, name, text).unwrap_err();
        assert!(wrong("p5.3", "3000").contains("4000 to 20000 µA"));
        assert!(wrong("BAUD", "14400").contains("9600"));
        assert!(wrong("FORMAT", "9X9").contains("8N2"));
        assert!(wrong("p5.3.range", "2").contains("4-20 mA"));
        assert!(!wrong("p5.3.range", "2").contains("NTC"));
        assert!(wrong("p5.1", "5").contains("only be read"));
        assert!(wrong("FRAME_GAP", "1.23").contains("0.2 to 100.0 ms, or 0"));
        for text in ["", "-1", "1e300", "nan", "99999999999999999999", "ä"] {
            assert!(parsed(&book, "COMM_TIMEOUT", text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_of_a_description_that_no_register_has_do_not_overflow() {
        let mut item = book(1, 1).find("status").unwrap();
        item.meaning = Meaning::Value(Value::Bits(vec![(0, "a".into()), (200, "b".into())]));
        assert_eq!(show(&item, &[0xFFFF], false).text, "a");

        let mut item = book(1, 1).find("p5.3").unwrap();
        let Meaning::Analog(reading) = &mut item.meaning else {
            panic!("not an analog point");
        };
        (reading.min, reading.max) = (0, i32::MAX);
        assert_eq!(parse(&item, "65535", false), Ok(vec![0xFFFF]));
        assert!(parse(&item, "65536", false).is_err());
    }

    #[test]
    fn raw_numbers_are_decimal_or_hexadecimal_without_a_sign() {
        let item = book(1, 1).find("COMM_TIMEOUT").unwrap();
        let raw = |text| parse(&item, text, true).ok();
        assert_eq!([raw("16"), raw("0x10")], [Some(vec![16]), Some(vec![16])]);
        for text in ["+16", "-1", "0x+5", "0x", "1.5", "on", "", "65536"] {
            assert_eq!(raw(text), None, "{text}");
        }
    }
}
