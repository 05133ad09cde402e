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
use crate::warnings::{of_links, stage};

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
    device.warn_of(&book, &values).await;
    Ok(())
}

impl Device {
    /// Prints warnings about links, given as their words. The command has done its work, so it does not fail when the unit
    /// does not answer now.
    async fn warn_of(&mut self, book: &Book, links: &[Vec<u16>]) {
        if links.iter().any(|words| acts(words))
            && let Ok(timeout) = self.read_words(COMM_TIMEOUT, 1).await
        {
            let timeout = timeout.first().copied().unwrap_or_default();
            for warning in of_links(book, links, timeout) {
                eprintln!("modioctl: warning: {warning}");
            }
        }
    }

    /// Prints warnings after these settings were written: about all links, and about the times of the outputs that the
    /// settings concern. As [`Self::warn_of`], it does not fail.
    pub async fn warn_of_settings(&mut self, written: &[(Item, Vec<u16>)]) {
        let of_links = |item: &Item| {
            let of_source = item.name.ends_with(".range") || item.name.ends_with(".scale");
            of_source || item.name.contains(".link") || item.name == "COMM_TIMEOUT"
        };
        let about_links = written.iter().any(|(item, _)| of_links(item));
        let about_stage = written
            .iter()
            .any(|(item, _)| stage::pair_of(item).is_some());
        if (about_links || about_stage)
            && let Ok(book) = fetch_set(self).await
        {
            if about_links {
                let outputs = book.points();
                let items = outputs.flat_map(|output| links::of(&book, &output.name));
                let items: Vec<_> = items.collect();
                if let Ok(values) = self.read_items(&items).await {
                    self.warn_of(&book, &values).await;
                }
            }
            if about_stage {
                self.warn_of_stage(&book, written).await;
            }
        }
    }
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
    device.warn_of_stage(&book, &changes).await;
    let words: Vec<_> = changes.into_iter().map(|(_, words)| words).collect();
    device.warn_of(&book, &words).await;
    Ok(())
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
