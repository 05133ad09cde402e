//! `modioctl describe`.

use modio_description::Unit;
use serde_json::{Value as Json, json};

use super::module::description;
use crate::cli::Describe;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Book, Item, Meaning};
use crate::output;
use crate::value::{table_name, takes, unit_name};

/// Lists the unit's points and registers.
///
/// # Errors
///
/// What went wrong with the unit.
pub async fn run(device: &mut Device, options: &Describe, json: bool) -> Result<(), Failure> {
    let learned = fetch(device, options.refresh).await?;
    let about = description(&learned.book)?;
    let items = learned.book.items();
    if json {
        return output::json(&description_json(&learned.book, &learned.source)?);
    }
    output::line(format_args!(
        "{} ({}), firmware {}, register map {}; from {}",
        about.board, about.model, about.firmware, about.map_version, learned.source
    ))?;
    let rows: Vec<_> = items
        .iter()
        .map(|item| {
            let access = match (item.writable, item.restart) {
                (false, _) => "read",
                (true, false) => "write",
                (true, true) => "write, restart",
            };
            [
                format!("{:#06X}", item.address),
                item.name.clone(),
                table_name(item.table).to_owned(),
                access.to_owned(),
                item.about.clone(),
                values(item).trim_start_matches("it takes ").to_owned(),
            ]
        })
        .collect();
    output::table(&rows)
}

/// Returns the description of a unit for programs. `source` says where the description is from.
///
/// # Errors
///
/// Error when the unit is not a modio.
pub fn description_json(book: &Book, source: &str) -> Result<Json, Failure> {
    let about = description(book)?;
    Ok(json!({
        "board": about.board,
        "model": about.model,
        "firmware": about.firmware,
        "map_version": about.map_version,
        "source": source,
        "items": book.items().iter().map(as_json).collect::<Vec<_>>(),
    }))
}

fn unit(item: &Item) -> Unit {
    match &item.meaning {
        Meaning::Analog(reading) => reading.unit.clone(),
        Meaning::Value(
            modio_description::Value::Number(unit) | modio_description::Value::Long(unit),
        ) => unit.clone(),
        _ => Unit::default(),
    }
}

/// The values of an item, for people.
pub fn values(item: &Item) -> String {
    let unit = unit(item);
    match (&item.values, &item.meaning) {
        (_, Meaning::Value(modio_description::Value::Codes(names))) => {
            let allowed = names.iter().filter(|(code, _)| {
                item.values
                    .as_ref()
                    .is_none_or(|values| crate::value::allow(values, *code))
            });
            let names: Vec<_> = allowed.map(|(_, name)| name.as_str()).collect();
            names.join(" | ")
        }
        (Some(values), _) => takes(values, &unit),
        (None, Meaning::Bit) => "off | on".to_owned(),
        (None, _) => unit_name(&unit.code).to_owned(),
    }
}

/// An item for programs.
pub fn as_json(item: &Item) -> Json {
    json!({
        "name": item.name,
        "table": table_name(item.table),
        "address": item.address,
        "words": item.words,
        "writable": item.writable,
        "setting": item.setting,
        "restart": item.restart,
        "unit": unit_name(&unit(item).code),
        "values": values(item),
        "about": item.about,
    })
}
