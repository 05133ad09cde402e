//! `modioctl links` and `modioctl link`.

use register_map::codes::LinkAction;
use register_map::configuration::COMM_TIMEOUT;
use register_map::links::NO_SOURCE;
use serde_json::{Value as Json, json};

use super::note::Note;
use super::write::UNSAVED;
use crate::device::{Device, fetch_set};
use crate::failure::Failure;
use crate::links::{self, Order, action_of, acts, is_alone, sentence};
use crate::names::{Book, Item};
use crate::output;
use crate::value::point_name;

/// Prints the links of the unit.
pub async fn list(device: &mut Device, json: bool) -> Result<(), Failure> {
    let book = fetch_set(device).await?;
    let items = links::all(&book)?;
    let values = device.read_items(&items).await?;
    let used = items.iter().zip(&values);
    let used: Vec<_> = used.filter(|(_, words)| **words != links::NONE).collect();
    if json {
        let each = used.iter().map(|(item, words)| as_json(&book, item, words));
        return output::json(&each.collect::<Vec<_>>());
    }
    if used.is_empty() {
        return output::line("no links");
    }
    let rows = used.iter();
    let rows = rows.map(|(item, words)| [item.name.clone(), sentence(&book, item, words)]);
    output::table(&rows.collect::<Vec<_>>())?;
    warn_of_alone(device, used.iter().map(|(_, words)| *words)).await
}

/// Prints a warning when one of these links acts only while the master is gone, and the unit does not notice that.
async fn warn_of_alone<'a>(
    device: &mut Device,
    mut links: impl Iterator<Item = &'a Vec<u16>>,
) -> Result<(), Failure> {
    let is_for_alone = |words: &Vec<u16>| acts(words) && words.get(1).is_some_and(|w| is_alone(*w));
    if links.any(is_for_alone) && device.read_words(COMM_TIMEOUT, 1).await? == [0] {
        eprintln!(
            "modioctl: warning: COMM_TIMEOUT is 0, so a link with `if alone` never acts: set the time after which the master counts as gone, such as `modioctl config set COMM_TIMEOUT=5`"
        );
    }
    Ok(())
}

fn as_json(book: &Book, item: &Item, words: &[u16]) -> Json {
    let [source, action, ..] = *words else {
        return Json::Null;
    };
    json!({
        "name": item.name,
        "address": item.address,
        "source": (source != NO_SOURCE).then(|| point_name(source)),
        "action": action_of(action).map(LinkAction::name),
        "if_alone": is_alone(action),
        "text": sentence(book, item, words),
        "words": words,
    })
}

/// Writes the link in `text`, or deletes the links of an output. `done` gets what is written.
pub async fn link(device: &mut Device, text: &str, done: &Note) -> Result<(), Failure> {
    let book = fetch_set(device).await?;
    let mut note = None;
    let changes = match text.split_whitespace().collect::<Vec<_>>()[..] {
        ["none", output] => {
            let (_, items) = links::of_output(&book, output)?;
            let none = |item| (item, links::NONE.to_vec());
            items.into_iter().map(none).collect()
        }
        _ => {
            let order = links::parse(&book, text)?;
            note = links::note(&book, &order);
            let values = device.read_items(&order.links).await?;
            vec![(place(&book, &order, &values)?, order.words.to_vec())]
        }
    };
    device.write_items(&changes, done).await?;
    for (item, words) in &changes {
        output::line(format_args!(
            "{}: {}",
            item.name,
            sentence(&book, item, words)
        ))?;
    }
    output::line(UNSAVED)?;
    if let Some(note) = note {
        eprintln!("modioctl: note: {note}");
    }
    warn_of_alone(device, changes.iter().map(|(_, words)| words)).await
}

/// Returns the link to write: the link that already has this source, or else the first free link.
fn place(book: &Book, order: &Order, values: &[Vec<u16>]) -> Result<Item, Failure> {
    let links = || order.links.iter().zip(values);
    let same = links().find(|(_, words)| acts(words) && words.first() == order.words.first());
    let free = || links().find(|(_, words)| !acts(words));
    if let Some((item, _)) = same.or_else(free) {
        return Ok(item.clone());
    }
    let used = links().map(|(item, words)| format!("`{}`", sentence(book, item, words)));
    let used = used.collect::<Vec<_>>().join(" and ");
    let output = &order.output;
    Err(Failure::usage(format!(
        "all links of {output} are in use: {used}; `modioctl link none {output}` deletes them, `modioctl write {output}.link1=none` the first",
    )))
}
