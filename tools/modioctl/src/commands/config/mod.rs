//! `modioctl config`.

mod file;

use std::io::{IsTerminal, stdin};
use std::path::Path;

use register_map::codes::Command;
use register_map::configuration;
use register_map::stage;

use super::note::{Note, Progress, UNDO};
use super::read;
use crate::cli::Config;
use crate::device::{Device, fetch_set, with_modules};
use crate::failure::Failure;
use crate::names::{Book, Item, is_module};
use crate::output;
use crate::value::show;

/// Largest number of registers that one request writes.
const MOST: usize = 100;

type Setting = (Item, Vec<u16>);

/// Reads and changes settings. When a name, a value or a file is wrong, nothing is written.
pub async fn run(
    mut device: Device,
    options: Config,
    json: bool,
    note: &Note,
) -> Result<(), Failure> {
    let book = fetch_set(&mut device).await?;
    match options {
        Config::Get { names } => {
            let mut items = book.find_all(&names)?;
            if names.is_empty() {
                items = book.settings().cloned().collect();
            }
            read::print(&mut device, &items, false, json).await
        }
        Config::Set { values } => {
            let changes = values
                .iter()
                .map(|(name, value)| file::setting(&book, name, value))
                .collect::<Result<Vec<_>, _>>()?;
            let mut progress = Progress::of_settings(note, changes.len());
            let pairs = device.pairs_before(&book, &changes).await?;
            device.unlock().await?;
            write(&mut device, &changes, &mut progress).await?;
            output::line("written, but not saved: save with `modioctl config save`")?;
            device.warn_of_settings(&changes).await;
            device.warn_of_lost_pairs(&pairs).await;
            Ok(())
        }
        Config::Save => {
            device.unlock().await?;
            note.during("the settings may be saved", "", device.save())
                .await?;
            note.set("the settings are saved");
            output::line("saved")?;
            tell_restart(&mut device).await
        }
        Config::Diff { file } => diff(&mut device, &book, file.as_deref()).await,
        Config::Export { file, force } => {
            let (items, values) = settings(&mut device, &book).await?;
            let text = file::text(&book, &items, &values)?;
            output::save(&text, file.as_deref(), force)
        }
        Config::Import { file, yes, restart } => {
            let wanted = file::read(&book, &file)?;
            let rows = differences(&mut device, &book, &wanted).await?;
            table(rows.clone(), "the file")?;
            let is_changed = |item: &Item| rows.iter().any(|[name, ..]| *name == item.name);
            let modules = wanted.iter().map(|(item, _)| item);
            let modules = modules.filter(|item| is_module(item) && is_changed(item));
            let modules: Vec<_> = modules.map(|item| item.name.as_str()).collect();
            if !modules.is_empty() && !yes {
                agree(&modules.join(", ")).await?;
            }
            let pairs = device.pairs_before(&book, &wanted).await?;
            import(&mut device, &wanted, &file, rows.len(), note).await?;
            device.warn_of_settings(&wanted).await;
            device.warn_of_lost_pairs(&pairs).await;
            finish(device, restart).await
        }
        Config::Reset { restart } => {
            device.unlock().await?;
            let (items, values) = settings(&mut device, &book).await?;
            let changes = items.iter().zip(&values);
            let changes = changes.filter(|(item, words)| words[..] != [item.default]);
            let changed: Vec<_> = changes.map(|(item, _)| item.address).collect();
            device.warn_of_line(changed.iter().copied());
            let pairs = device.pairs(&book).await?;
            let order = Command::LoadDefaults.code();
            note.during(
                format_args!("the factory settings may be in force{UNDO}"),
                "nothing has changed",
                device.order(order, "loading the factory settings"),
            )
            .await?;
            device.warn_of_lost_pairs(&pairs).await;
            note.during(
                "the factory settings are in force, and may be saved: repeat the command",
                format_args!("the factory settings are in force{UNDO}"),
                device.save(),
            )
            .await?;
            note.set("the factory settings are saved");
            output::line("the factory settings are saved")?;
            finish(device, restart).await
        }
    }
}

/// Returns the names of the unit as they will be with these modules.
fn of_modules(book: &Book, module: impl Fn(u8) -> Option<u16>) -> Result<Book, Failure> {
    let description = with_modules(book.of_modio()?.clone(), module);
    Ok(Book::new(description, Vec::new()))
}

async fn settings(device: &mut Device, book: &Book) -> Result<(Vec<Item>, Vec<Vec<u16>>), Failure> {
    let items: Vec<_> = book.settings().cloned().collect();
    let values = device.read_items(&items).await?;
    Ok((items, values))
}

/// Writes settings that have been checked. The lock must be open.
async fn write(
    device: &mut Device,
    changes: &[Setting],
    progress: &mut Progress<'_>,
) -> Result<(), Failure> {
    device.warn_of_line(changes.iter().map(|(item, _)| item.address));
    for (names, first, words) in runs(changes) {
        let about = format!("writing {}", names.join(", "));
        let request = device.write_words(first, &words, &about);
        progress.write(names.len(), request).await?;
    }
    Ok(())
}

/// Returns the requests that write these settings: names, first address and words. Modules are first, because a change
/// of module resets the settings of its points. Times of outputs are next: a pair is one before START, SAFE or a link can
/// switch both of it on. Registers with consecutive addresses are in one request, so that the
/// unit checks FORMAT and MODE together.
fn runs(changes: &[Setting]) -> Vec<(Vec<&str>, u16, Vec<u16>)> {
    let mut sorted: Vec<_> = changes.iter().collect();
    sorted.sort_by_key(|(item, _)| {
        (
            !is_module(item),
            !stage::contain(item.address),
            item.address,
        )
    });
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
    runs
}

async fn diff(device: &mut Device, book: &Book, path: Option<&Path>) -> Result<(), Failure> {
    let (wanted, other) = match path {
        Some(path) => (file::read(book, path)?, "the file"),
        None => {
            let default = |item: &Item| (item.clone(), vec![item.default]);
            (book.settings().map(default).collect(), "the factory")
        }
    };
    let rows = differences(device, book, &wanted).await?;
    if rows.is_empty() {
        return output::line("no difference");
    }
    table(rows, other)
}

/// Returns the name, the present value and the wanted value of each setting whose value differs.
async fn differences(
    device: &mut Device,
    book: &Book,
    wanted: &[Setting],
) -> Result<Vec<[String; 3]>, Failure> {
    let (items, values) = settings(device, book).await?;
    let mut rows = Vec::new();
    for (item, words) in wanted {
        let now = items
            .iter()
            .zip(&values)
            .find(|(known, _)| known.address == item.address);
        let now = now.map(|(_, words)| words);
        if now != Some(words) {
            let shown = |words: &Vec<u16>| show(item, words, false).to_string();
            let now = now.map_or_else(|| "missing".to_owned(), shown);
            rows.push([item.name.clone(), now, shown(words)]);
        }
    }
    Ok(rows)
}

/// Prints differences between the unit and something else.
fn table(mut rows: Vec<[String; 3]>, other: &str) -> Result<(), Failure> {
    if rows.is_empty() {
        return Ok(());
    }
    rows.insert(0, ["setting", "the unit", other].map(str::to_owned));
    output::table(&rows)
}

/// Asks whether the modules with these names may be changed. Fails when the answer is not yes, or when nobody can
/// answer.
async fn agree(modules: &str) -> Result<(), Failure> {
    let mut answer = String::new();
    if stdin().is_terminal() {
        eprint!("modioctl: {modules} changes: write all of this? [y/N] ");
        let (tell, told) = tokio::sync::oneshot::channel();
        // Ctrl-C ends the program while this thread waits for a line.
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = stdin().read_line(&mut line);
            tell.send(line)
        });
        answer = told.await.unwrap_or_default();
    }
    match answer.trim() {
        "y" | "Y" | "yes" => Ok(()),
        _ => Err(Failure::usage(format!(
            "nothing is written: {modules} would change; --yes allows it"
        ))),
    }
}

/// Writes the settings of a file that differ from those of the unit, about `count` of them, and saves them.
async fn import(
    device: &mut Device,
    wanted: &[Setting],
    path: &Path,
    count: usize,
    note: &Note,
) -> Result<(), Failure> {
    let mut progress = Progress::of_settings(note, count);
    device.unlock().await?;
    let modules = wanted.iter().filter(|(item, _)| is_module(item));
    let modules = differing(device, &modules.cloned().collect::<Vec<_>>()).await?;
    write(device, &modules, &mut progress).await?;
    let mut changes = differing(device, wanted).await?;
    // FORMAT and MODE must be compatible, so write both or none.
    let line = configuration::FORMAT..=configuration::MODE;
    if changes.iter().any(|(item, _)| line.contains(&item.address)) {
        changes.retain(|(item, _)| !line.contains(&item.address));
        let both = wanted
            .iter()
            .filter(|(item, _)| line.contains(&item.address));
        changes.extend(both.cloned());
    }
    progress.all = progress.done + changes.len();
    write(device, &changes, &mut progress).await?;
    let left = differing(device, wanted).await?;
    if let Some((item, _)) = left.first() {
        return Err(Failure::Refused(format!(
            "{} does not have the written value: see `modioctl config diff {}`",
            item.name,
            path.display()
        )));
    }
    if progress.done == 0 {
        output::line("the unit has these settings already")?;
    } else {
        output::line(format_args!("{} settings written", progress.done))?;
    }
    note.during(
        "all settings are written, and may be saved: repeat the import",
        format_args!("all settings are written{UNDO}"),
        device.save(),
    )
    .await?;
    note.set("the settings are saved");
    output::line("saved")
}

/// Returns the settings whose values differ from those of the unit.
async fn differing(device: &mut Device, wanted: &[Setting]) -> Result<Vec<Setting>, Failure> {
    let items: Vec<_> = wanted.iter().map(|(item, _)| item.clone()).collect();
    let now = device.read_items(&items).await?;
    let both = wanted.iter().zip(now);
    let differing = both.filter(|((_, words), now)| words != now);
    Ok(differing.map(|(change, _)| change.clone()).collect())
}

/// Restarts the unit if that is wanted and needed. Prints a note if it is needed but not wanted.
async fn finish(mut device: Device, restart: bool) -> Result<(), Failure> {
    if !restart {
        return tell_restart(&mut device).await;
    }
    if device.waits_for_restart().await? {
        device.unlock().await?;
        device.restart().await?;
        output::line("restarted: all settings are in force")?;
    }
    Ok(())
}

async fn tell_restart(device: &mut Device) -> Result<(), Failure> {
    if device.waits_for_restart().await? {
        output::line("some settings take effect after a restart: use `modioctl reboot`")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_08;

    use super::*;
    use crate::names::book;

    #[test]
    fn modules_are_written_first_and_then_the_times_of_outputs() {
        let book = book(&MODIO_08, Module::Do4, (0, 0));
        let names = [
            "p1.1.link1",
            "p1.1.safe",
            "p1.1.start",
            "p1.1.filter",
            "p1.1.max_on",
            "p1.1.dead_time",
            "p1.2.dead_time",
            "p1.module",
        ];
        let changes = names.map(|name| {
            let item = book.find(name).unwrap();
            let words = vec![0; item.words.into()];
            (item, words)
        });
        let order: Vec<_> = runs(&changes)
            .into_iter()
            .map(|(names, ..)| names.join(" "))
            .collect();
        let wanted = [
            "p1.module",
            "p1.1.dead_time p1.2.dead_time",
            "p1.1.max_on",
            "p1.1.filter",
            "p1.1.safe",
            "p1.1.start",
            "p1.1.link1",
        ];
        assert_eq!(order, wanted);
    }
}
