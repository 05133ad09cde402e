//! `modioctl read`.

use serde_json::{Value as Json, json};

use crate::cli::Read;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::output;
use crate::value::show;

/// Reads items by name or address.
pub async fn run(device: &mut Device, options: &Read, json: bool) -> Result<(), Failure> {
    let book = fetch(device).await?.book;
    let items = book.find_all(&options.names)?;
    print(device, &items, options.raw, json).await
}

/// Reads items and prints their values. With `raw` they are numbers without meaning.
pub async fn print(
    device: &mut Device,
    items: &[Item],
    raw: bool,
    json: bool,
) -> Result<(), Failure> {
    let values = device.read_items(items).await?;
    let both = items.iter().zip(&values);
    if json {
        let each = both.map(|(item, words)| as_json(item, words, raw));
        return output::json(&each.collect::<Vec<_>>());
    }
    let rows: Vec<_> = both
        .map(|(item, words)| [item.name.clone(), show(item, words, raw).to_string()])
        .collect();
    output::table(&rows)
}

/// Returns an item with its value.
pub fn as_json(item: &Item, words: &[u16], raw: bool) -> Json {
    let shown = show(item, words, raw);
    json!({
        "name": item.name,
        "address": item.address,
        "words": words,
        "value": shown.json,
        "unit": match &item.meaning {
            Meaning::LongestOn if !raw => "s",
            _ => &shown.unit,
        },
    })
}
