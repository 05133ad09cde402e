//! `modioctl config`.

mod file;

use std::path::Path;

use register_map::codes::Command;
use register_map::state::{self, status};
use register_map::{configuration, points};

use super::read;
use crate::cli::Config;
use crate::device::{Device, fetch, with_modules};
use crate::failure::Failure;
use crate::names::{Book, Item};
use crate::output;
use crate::value::show;

/// Largest number of registers that one request writes.
const MOST: usize = 100;

/// Reads and changes settings.
///
/// # Errors
///
/// When a name, a value or a file is wrong; nothing is written then. When the unit does not answer or refuses.
pub async fn run(mut device: Device, options: Config, json: bool) -> Result<(), Failure> {
    let book = fetch(&mut device).await?.book;
    let modules = device
        .read_words(configuration::MODULE, points::PORTS)
        .await?;
    let set = |port: u8| modules.get(usize::from(port.max(1)) - 1).copied();
    // Settings by point belong to the module that is set, which may not be in force yet.
    let book = of_modules(&book, set)?;
    match options {
        Config::Get { names } => get(&mut device, &book, &names, json).await,
        Config::Set { values } => {
            let changes = file::check(&book, values)?;
            device.unlock().await?;
            write(&mut device, &changes).await?;
            output::line(format_args!(
                "written, but not saved: save with `modioctl config save`"
            ))
        }
        Config::Save => {
            device.unlock().await?;
            device.save().await?;
            output::line(format_args!("saved"))?;
            tell_restart(&mut device).await
        }
        Config::Diff { file } => diff(&mut device, &book, file.as_deref()).await,
        Config::Export { file } => {
            let (items, values) = settings(&mut device, &book).await?;
            let text = file::text(&book, &items, &values)?;
            match file {
                None => output::line(format_args!("{}", text.trim_end())),
                Some(path) => std::fs::write(&path, text).map_err(|error| {
                    Failure::usage(format!("cannot write {}: {error}", path.display()))
                }),
            }
        }
        Config::Import { file, restart } => import(device, &book, &file, restart).await,
        Config::Reset { restart } => {
            device.unlock().await?;
            let (items, values) = settings(&mut device, &book).await?;
            let changes = items.iter().zip(&values);
            let changes = changes.filter(|(item, words)| words[..] != [item.default]);
            device.warn_of_line(changes.map(|(item, _)| item.address));
            device
                .order(Command::LoadDefaults.code(), "loading the factory settings")
                .await?;
            device.save().await?;
            output::line(format_args!("the factory settings are saved"))?;
            finish(device, restart).await
        }
    }
}

/// Returns the names of the unit as they will be with these modules.
fn of_modules(book: &Book, module: impl Fn(u8) -> Option<u16>) -> Result<Book, Failure> {
    let description = with_modules(book.of_modio()?.clone(), module);
    Ok(Book::new(description, Vec::new()))
}

/// Returns all settings with their values.
async fn settings(device: &mut Device, book: &Book) -> Result<(Vec<Item>, Vec<Vec<u16>>), Failure> {
    let items: Vec<_> = book.settings().cloned().collect();
    let values = device.read_items(&items).await?;
    Ok((items, values))
}

async fn get(
    device: &mut Device,
    book: &Book,
    names: &[String],
    json: bool,
) -> Result<(), Failure> {
    let items: Vec<_> = if names.is_empty() {
        book.settings().cloned().collect()
    } else {
        names
            .iter()
            .map(|name| book.find(name))
            .collect::<Result<_, _>>()?
    };
    let values = device.read_items(&items).await?;
    let both = items.iter().zip(&values);
    if json {
        let each = both.map(|(item, words)| read::as_json(item, words, false));
        return output::json(&each.collect::<Vec<_>>());
    }
    let rows: Vec<_> = both
        .map(|(item, words)| [item.name.clone(), show(item, words, false).to_string()])
        .collect();
    output::table(&rows)
}

/// Writes settings that have been checked. The lock must be open.
async fn write(device: &mut Device, changes: &[(Item, Vec<u16>)]) -> Result<(), Failure> {
    device.warn_of_line(changes.iter().map(|(item, _)| item.address));
    // Modules first: a change of module resets the settings of its points. Registers with consecutive addresses go in one
    // request, so that the unit checks FORMAT and MODE together.
    let mut sorted: Vec<_> = changes.iter().collect();
    sorted.sort_by_key(|(item, _)| (!is_module(item), item.address));
    let mut runs: Vec<(Vec<&str>, u16, Vec<u16>)> = Vec::new();
    for (item, words) in sorted {
        match runs.last_mut() {
            Some((names, first, run))
                if usize::from(item.address) == usize::from(*first) + run.len()
                    && run.len() < MOST =>
            {
                names.push(&item.name);
                run.extend(words);
            }
            _ => runs.push((vec![&item.name], item.address, words.clone())),
        }
    }
    for (names, first, words) in runs {
        device
            .write_words(first, &words, &format!("writing {}", names.join(", ")))
            .await?;
    }
    Ok(())
}

fn is_module(item: &Item) -> bool {
    let ports = configuration::MODULE..configuration::MODULE + points::PORTS;
    ports.contains(&item.address)
}

async fn diff(device: &mut Device, book: &Book, path: Option<&Path>) -> Result<(), Failure> {
    let (items, values) = settings(device, book).await?;
    let wanted = match path {
        Some(path) => file::check(&file::book(book, path)?, file::read(path)?)?,
        None => items
            .iter()
            .map(|item| (item.clone(), vec![item.default]))
            .collect(),
    };
    let mut rows = Vec::new();
    for (item, words) in &wanted {
        let now = items
            .iter()
            .zip(&values)
            .find(|(known, _)| known.address == item.address);
        let now = now.map(|(_, words)| words);
        if now != Some(words) {
            let now = now.map_or_else(
                || "missing".to_owned(),
                |words| show(item, words, false).to_string(),
            );
            rows.push([item.name.clone(), now, show(item, words, false).to_string()]);
        }
    }
    if rows.is_empty() {
        return output::line(format_args!("no difference"));
    }
    let other = if path.is_some() {
        "the file"
    } else {
        "the factory"
    };
    rows.insert(
        0,
        [
            "setting".to_owned(),
            "the unit".to_owned(),
            other.to_owned(),
        ],
    );
    output::table(&rows)
}

async fn import(
    mut device: Device,
    book: &Book,
    path: &Path,
    restart: bool,
) -> Result<(), Failure> {
    // Check the whole file before anything is written, with the modules that it contains.
    let values = file::read(path)?;
    let book = file::book(book, path)?;
    let wanted = file::check(&book, values)?;
    file::check_line(&wanted)?;
    device.unlock().await?;
    let modules: Vec<_> = wanted
        .iter()
        .filter(|(item, _)| is_module(item))
        .cloned()
        .collect();
    let modules = differing(&mut device, &modules).await?;
    write(&mut device, &modules).await?;
    let mut changes = differing(&mut device, &wanted).await?;
    // FORMAT and MODE must be compatible, so write both or none.
    let line = configuration::FORMAT..=configuration::MODE;
    if changes.iter().any(|(item, _)| line.contains(&item.address)) {
        changes.retain(|(item, _)| !line.contains(&item.address));
        changes.extend(
            wanted
                .iter()
                .filter(|(item, _)| line.contains(&item.address))
                .cloned(),
        );
    }
    write(&mut device, &changes).await?;
    let left = differing(&mut device, &wanted).await?;
    if let Some((item, _)) = left.first() {
        return Err(Failure::Refused(format!(
            "{} does not have the written value; nothing is saved: see `modioctl config diff {}`",
            item.name,
            path.display()
        )));
    }
    let count = modules.len() + changes.len();
    if count == 0 {
        output::line(format_args!("the unit has these settings already"))?;
    } else {
        output::line(format_args!("{count} settings written"))?;
    }
    device.save().await?;
    output::line(format_args!("saved"))?;
    finish(device, restart).await
}

/// Returns the settings whose values differ from those of the unit.
async fn differing(
    device: &mut Device,
    wanted: &[(Item, Vec<u16>)],
) -> Result<Vec<(Item, Vec<u16>)>, Failure> {
    let items: Vec<_> = wanted.iter().map(|(item, _)| item.clone()).collect();
    let now = device.read_items(&items).await?;
    let both = wanted.iter().zip(now);
    Ok(both
        .filter(|((_, words), now)| words != now)
        .map(|(change, _)| change.clone())
        .collect())
}

/// Restarts the unit if that is wanted and needed. Prints a note if it is needed but not wanted.
async fn finish(mut device: Device, restart: bool) -> Result<(), Failure> {
    if !restart {
        return tell_restart(&mut device).await;
    }
    if waits(&mut device).await? {
        device.unlock().await?;
        device.restart().await?;
        output::line(format_args!("restarted: all settings are in force"))?;
    }
    Ok(())
}

async fn waits(device: &mut Device) -> Result<bool, Failure> {
    let words = device.read_words(state::STATUS, 1).await?;
    Ok(words.iter().any(|word| word & status::RESTART_NEEDED != 0))
}

async fn tell_restart(device: &mut Device) -> Result<(), Failure> {
    if waits(device).await? {
        output::line(format_args!(
            "some settings take effect after a restart: use `modioctl reboot`"
        ))?;
    }
    Ok(())
}
