//! Writes YAML with every text in double quotes. Without them readers of YAML 1.1, as Home Assistant has, take `yes` for a
//! boolean, and `1.0` and `1_000` for numbers.

use serde::Serialize;
use serde_yaml_ng::{Mapping, Number, Value};

use crate::failure::Failure;

/// Returns a mapping of these keys and values, without the keys that have no value or an empty list.
macro_rules! map {
    ($($key:literal: $value:expr),+ $(,)?) => {
        crate::export::yaml::mapping([$(($key, serde_yaml_ng::to_value(&$value))),+])
    };
}
pub(super) use map;

/// Returns the mapping of [`map`]. Every value can be written as YAML.
pub fn mapping<const N: usize>(
    entries: [(&str, Result<Value, serde_yaml_ng::Error>); N],
) -> Mapping {
    let entries = entries.map(|(key, value)| (key.into(), value.unwrap_or_default()));
    let is_empty =
        |value: &Value| value.is_null() || value.as_sequence().is_some_and(Vec::is_empty);
    let entries = entries.into_iter().filter(|(_, value)| !is_empty(value));
    entries.collect()
}

/// Returns a value as YAML.
pub fn text(value: &impl Serialize) -> Result<String, Failure> {
    let value = serde_yaml_ng::to_value(value).map_err(Failure::usage)?;
    Ok(lines(&value).join("\n") + "\n")
}

fn lines(value: &Value) -> Vec<String> {
    match value {
        Value::Sequence(items) => items.iter().flat_map(item).collect(),
        Value::Mapping(entries) => entries.iter().flat_map(entry).collect(),
        Value::Tagged(tagged) => lines(&tagged.value),
        Value::String(text) => vec![quoted(text)],
        Value::Number(number) => vec![shown(number)],
        Value::Bool(is) => vec![is.to_string()],
        Value::Null => vec!["null".to_owned()],
    }
}

fn item(value: &Value) -> Vec<String> {
    let lines = lines(value).into_iter().enumerate();
    let start = |n| if n == 0 { "- " } else { "  " };
    lines.map(|(n, line)| start(n).to_owned() + &line).collect()
}

fn entry((key, value): (&Value, &Value)) -> Vec<String> {
    let key = key.as_str().unwrap_or_default();
    let indent = match value {
        Value::Sequence(_) => "",
        Value::Mapping(_) => "  ",
        scalar => return vec![format!("{key}: {}", lines(scalar).concat())],
    };
    let below = lines(value)
        .into_iter()
        .map(|line| indent.to_owned() + &line);
    std::iter::once(format!("{key}:")).chain(below).collect()
}

/// Returns a number. YAML 1.1 knows no exponent without a point.
fn shown(number: &Number) -> String {
    match number.as_f64().filter(|_| number.is_f64()) {
        Some(whole) if whole.fract() == 0.0 => format!("{whole:.1}"),
        Some(fraction) => fraction.to_string(),
        None => number.to_string(),
    }
}

/// Returns a text in double quotes, with escapes for what YAML does not allow in a file.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            ' '..='~' | '\u{A0}'..='\u{2027}' | '\u{202A}'..='\u{D7FF}' => quoted.push(c),
            _ => quoted += &format!("\\U{:08X}", u32::from(c)),
        }
    }
    quoted + "\""
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_and_numbers_read_back() {
        let texts = [
            "yes",
            "1_0",
            "a\"b\\c",
            "\u{7F}\u{85}\u{2028}\u{1F600}",
            "°C",
            "",
        ];
        let yaml = text(&(texts, [0.1, 2.0, 1e-7, 1e20], -3)).unwrap();
        let (read, numbers, whole): (Vec<String>, Vec<f64>, i32) =
            serde_yaml_ng::from_str(&yaml).unwrap();
        assert_eq!(read, texts);
        assert_eq!((&numbers[..], whole), (&[0.1, 2.0, 1e-7, 1e20][..], -3));
        assert!(!yaml.contains("e-"), "{yaml}");
    }
}
