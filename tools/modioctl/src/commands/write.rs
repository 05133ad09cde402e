//! `modioctl write`.

use modio_description::Table;
use serde_json::json;

use super::note::{Note, Progress};
use super::read::as_json;
use super::stage::Off;
use crate::cli::Write;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::held;
use crate::names::{Item, Meaning};
use crate::output;
use crate::value::{parse, show};

/// Line that reports that settings are in force and not saved.
pub const UNSAVED: &str = "not saved: save with `modioctl config save`";

/// Writes items by name or address, after all of them have been checked. When a name or a value is wrong, nothing is
/// written. Reports outputs that links hold, and outputs that MAX_ON or their pair keeps off, where the unit has accepted
/// the write.
pub async fn run(
    device: &mut Device,
    options: &Write,
    json: bool,
    note: &Note,
) -> Result<(), Failure> {
    let book = fetch(device).await?.book;
    let mut checked = Vec::new();
    for (name, text) in &options.values {
        let item = book.find(name)?;
        let words = parse(&item, text, options.raw)?;
        checked.push((item, words));
    }
    let pairs = device.pairs_before(&book, &checked).await?;
    device.write_items(&checked, note).await?;
    let bits = checked.iter().map(|(item, _)| item);
    let bits = bits.filter(|item| item.meaning == Meaning::Bit);
    let held = device.held(&book, bits).await?;
    let off = device.off(&book, &held, &checked).await?;
    let is_unsaved = checked.iter().any(|(item, _)| item.setting);
    if json {
        let each = checked.iter().map(|(item, words)| {
            let off = off.get(&item.name);
            let words = if off.is_some() { &vec![0] } else { words };
            let mut value = as_json(item, words, options.raw);
            value["off_by"] = json!(off.and_then(Off::by));
            value["held_by"] = json!(held.get(&item.name).map_or(&[][..], Vec::as_slice));
            value
        });
        output::json(&each.collect::<Vec<_>>())?;
        if is_unsaved {
            eprintln!("modioctl: {UNSAVED}");
        }
        device.warn_of_settings(&checked).await;
        device.warn_of_lost_pairs(&pairs).await;
        return Ok(());
    }
    for (item, words) in &checked {
        if let Some(sources) = held.get(&item.name) {
            output::line(format_args!("{}: {}", item.name, held::text(sources)))?;
            continue;
        }
        if let Some(off) = off.get(&item.name) {
            output::line(format_args!("{}: {}", item.name, off.text()))?;
            continue;
        }
        let when = if item.restart {
            " after save and restart"
        } else {
            ""
        };
        let value = show(item, words, options.raw);
        output::line(format_args!("{} = {value}{when}", item.name))?;
    }
    if is_unsaved {
        output::line(UNSAVED)?;
    }
    device.warn_of_settings(&checked).await;
    device.warn_of_lost_pairs(&pairs).await;
    Ok(())
}

impl Device {
    /// Writes items whose values have been checked. Opens the lock if one of them needs that.
    pub async fn write_items(
        &mut self,
        checked: &[(Item, Vec<u16>)],
        note: &Note,
    ) -> Result<(), Failure> {
        let is_locked = |item: &Item| item.setting || item.name == "COMMAND";
        let settings = checked.iter().filter(|(item, _)| item.setting);
        // An order among the values may have saved them.
        let has_orders = checked.iter().any(|(item, _)| item.name == "COMMAND");
        let has_settings = settings.clone().count() > 0 && !has_orders;
        let mut progress = Progress::of_values(note, checked.len(), has_settings);
        if checked.iter().any(|(item, _)| is_locked(item)) {
            self.unlock().await?;
        }
        self.warn_of_line(settings.map(|(item, _)| item.address));
        for (item, words) in checked {
            progress.write(1, self.write_item(item, words)).await?;
        }
        Ok(())
    }

    /// Writes an item.
    pub async fn write_item(&mut self, item: &Item, words: &[u16]) -> Result<(), Failure> {
        let about = format!("writing {}", item.name);
        match (item.table, words) {
            (Table::Bit, [bit, ..]) => self.write_bit(item.address, *bit != 0, &about).await,
            _ => self.write_words(item.address, words, &about).await,
        }
    }
}
