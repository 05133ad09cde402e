//! The points and registers of a unit as JSON, and their values in words.

use modio_description::Value;
use serde_json::{Value as Json, json};

use crate::failure::Failure;
use crate::names::{Book, Item, Meaning};
use crate::value::{table_name, takes, unit_name};

/// Returns the description of a unit for programs. `source` is the source of the description.
pub fn as_json(book: &Book, source: &str) -> Result<Json, Failure> {
    let about = book.of_modio()?;
    Ok(json!({
        "board": about.board,
        "model": about.model,
        "firmware": about.firmware,
        "map_version": about.map_version,
        "source": source,
        "items": book.items().iter().map(item_json).collect::<Vec<_>>(),
    }))
}

/// Returns the allowed values of an item, for people.
pub fn values(item: &Item) -> String {
    let unit = item.unit();
    match (&item.values, &item.meaning) {
        (_, Meaning::Value(Value::Codes(names))) => {
            let allowed = names.iter().filter(|(code, _)| item.allows(*code));
            let names: Vec<_> = allowed.map(|(_, name)| name.as_str()).collect();
            names.join(" | ")
        }
        (_, Meaning::Value(Value::Fields { fields, .. })) => {
            let names: Vec<_> = fields.iter().map(|field| field.name.as_str()).collect();
            names.join(", ")
        }
        // With the numbers, for a program that writes registers.
        (_, Meaning::LongestOn) => {
            "0, 0.1 to 3276.7 s (1 to 32767), or 1 to 32767 min (0x8001 to 0xFFFF)".to_owned()
        }
        (Some(values), _) => takes(values, &unit),
        (None, Meaning::Bit) => "off | on".to_owned(),
        (None, _) => unit_name(&unit.code).to_owned(),
    }
}

fn item_json(item: &Item) -> Json {
    json!({
        "name": item.name,
        "table": table_name(item.table),
        "address": item.address,
        "words": item.words,
        "writable": item.writable,
        "setting": item.setting,
        "restart": item.restart,
        "unit": unit_name(&item.unit().code),
        "values": values(item),
        "about": item.about,
    })
}
