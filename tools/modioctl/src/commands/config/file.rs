//! The file of settings: TOML with register names.

use std::fmt::Write;
use std::path::Path;

use modio_description::Unit;
use register_map::codes::{Format, Mode};
use register_map::configuration::{FORMAT, MODE};

use super::{is_module, of_modules};
use crate::failure::Failure;
use crate::names::{Book, Item, Meaning};
use crate::value::{parse, show, takes};

/// Returns the text of a file.
///
/// # Errors
///
/// When the unit is not a modio.
pub fn text(book: &Book, items: &[Item], values: &[Vec<u16>]) -> Result<String, Failure> {
    let about = book.of_modio()?;
    let mut text = format!(
        "# Settings of a {} with firmware {}, written by `modioctl config export`.\n",
        about.board, about.firmware
    );
    for (item, words) in items.iter().zip(values) {
        let shown = show(item, words, false);
        let value = match &shown.json {
            serde_json::Value::String(name) => toml::Value::String(name.clone()).to_string(),
            _ => shown.text.clone(),
        };
        let _ = writeln!(
            text,
            "{} = {value}  # {}",
            item.name,
            comment(item, &shown.unit)
        );
    }
    Ok(text)
}

fn comment(item: &Item, unit: &str) -> String {
    let about = item
        .about
        .trim_start_matches("By point. ")
        .trim_start_matches("By port. ");
    let takes = match (&item.meaning, &item.values) {
        (Meaning::Value(modio_description::Value::Number(of)), Some(values)) => takes(values, of),
        (_, Some(values))
            if unit.is_empty()
                && !matches!(
                    item.meaning,
                    Meaning::Value(modio_description::Value::Codes(_))
                ) =>
        {
            takes(values, &Unit::default())
        }
        _ => String::new(),
    };
    let takes = takes.trim_start_matches("it takes ");
    match takes {
        "" => about.to_owned(),
        takes => format!("{takes}. {about}"),
    }
}

/// Reads names and values from a file.
///
/// # Errors
///
/// When the file cannot be read, or is not valid TOML.
pub fn read(path: &Path) -> Result<Vec<(String, String)>, Failure> {
    let shown = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::usage(format!("cannot read {shown}: {error}")))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let line = error.span().map_or(1, |span| {
            text.get(..span.start)
                .unwrap_or_default()
                .matches('\n')
                .count()
                + 1
        });
        Failure::usage(format!("{shown}, line {line}: {}", error.message()))
    })?;
    let mut values = Vec::new();
    flatten(String::new(), table, &mut values);
    Ok(values)
}

/// `p5.1.filter = 4` is a table within tables.
fn flatten(prefix: String, table: toml::Table, values: &mut Vec<(String, String)>) {
    for (key, value) in table {
        let name = if prefix.is_empty() {
            key
        } else {
            format!("{prefix}.{key}")
        };
        match value {
            toml::Value::Table(inner) => flatten(name, inner, values),
            toml::Value::String(text) => values.push((name, text)),
            other => values.push((name, other.to_string())),
        }
    }
}

/// Returns the names of the unit with the modules in the file.
///
/// # Errors
///
/// When the file cannot be read, or contains an unknown module.
pub fn book(book: &Book, path: &Path) -> Result<Book, Failure> {
    let mut modules = Vec::new();
    for (name, text) in read(path)? {
        if let Ok(item) = book.find(&name)
            && is_module(&item)
        {
            modules.push((item.address, parse(&item, &text, false)?));
        }
    }
    of_modules(book, |port| {
        let address = register_map::configuration::module_of(port.into());
        let wanted = modules.iter().find(|(module, _)| *module == address);
        wanted.and_then(|(_, words)| words.first().copied())
    })
}

/// Checks names and values.
///
/// # Errors
///
/// The first name or value that is wrong.
pub fn check(book: &Book, values: Vec<(String, String)>) -> Result<Vec<(Item, Vec<u16>)>, Failure> {
    let mut changes = Vec::new();
    for (name, text) in values {
        let item = book.find(&name)?;
        if !item.setting {
            return Err(Failure::usage(format!("{name} is not a setting")));
        }
        let words = parse(&item, &text, false)?;
        changes.push((item, words));
    }
    Ok(changes)
}

/// Checks that FORMAT and MODE are compatible, as the unit does.
///
/// # Errors
///
/// When they are not.
pub fn check_line(wanted: &[(Item, Vec<u16>)]) -> Result<(), Failure> {
    let word = |address: u16| {
        let found = wanted.iter().find(|(item, _)| item.address == address);
        found.and_then(|(_, words)| words.first().copied())
    };
    let format = word(FORMAT).and_then(Format::from_code);
    let mode = word(MODE).and_then(Mode::from_code);
    match (format, mode) {
        (Some(format), Some(mode)) if !format.suits(mode) => Err(Failure::usage(
            "FORMAT with 7 data bits needs MODE = \"ASCII\"",
        )),
        _ => Ok(()),
    }
}
