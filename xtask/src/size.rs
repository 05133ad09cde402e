//! `cargo xtask size`: the flash and RAM of the image, by section and by crate, and what is left of the parts and of
//! the budget.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use register_map::board::{Board, Memory};
use register_map::layout::LOADER;
use register_map::part::KIB;
use register_map::update::Slot;
use serde_json::{Value, json};

use crate::build::Program;
use crate::workspace::Workspace;
use crate::{build, image, table};

mod measure;
mod source;

use measure::{Bytes, Sizes, measure};
pub use source::{Source, structures};

/// The board, and which image to measure.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    given: build::Given,

    /// Measure the application for a slot behind the loader, a or b, instead of the image that runs without a loader
    #[arg(long, value_name = "LETTER", value_parser = build::slot, conflicts_with = "elf")]
    slot: Option<Slot>,
}

/// `cargo xtask size`. An image that exceeds a limit is an error.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let board = options.given.board();
    let elf = match options.slot {
        Some(slot) => build::program(workspace, board, Program::Slot(slot), None)?.elf,
        None => options.given.elf(workspace)?,
    };
    let sizes = of(&elf)?;
    say!("{}", as_table(&sizes, board.memory()));
    within_limits(sizes.total(), board.memory())
}

/// Fails when the loader or an image does not fit the parts and the budget of a board.
pub fn check(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    let loader = build::loader(workspace, board)?;
    let [flash, _] = of(&loader)?.total();
    ensure!(
        flash <= LOADER,
        "the loader takes {flash} bytes of flash, more than its {LOADER}"
    );
    let slots = Slot::ALL.map(Program::Slot);
    for program in slots.into_iter().chain([Program::Alone]) {
        let elf = build::program(workspace, board, program, None)?.elf;
        within_limits(of(&elf)?.total(), board.memory())?;
    }
    Ok(())
}

/// Returns flash and RAM of an image, and of each crate.
pub fn report(elf: &Path) -> Result<Value> {
    let sizes = of(elf)?;
    let crates = sizes
        .crates
        .iter()
        .map(|(name, [flash, ram])| json!({ "name": name, "flash": flash, "ram": ram }));
    let crates: Vec<_> = crates.collect();
    let [flash, ram] = sizes.total();
    Ok(json!({ "flash": flash, "ram": ram, "crates": crates }))
}

fn of(elf: &Path) -> Result<Sizes> {
    measure(&image::read(elf)?).with_context(|| elf.display().to_string())
}

/// Returns the limits of an image, each with its name: the parts, the smaller one first, and the budget.
fn limits(memory: &Memory) -> impl Iterator<Item = (&'static str, Bytes)> {
    let parts = memory.smaller.into_iter().chain([memory.part]);
    let parts = parts.map(|part| (part.name, [part.flash, part.ram]));
    parts.chain([("budget", memory.budget)])
}

fn within_limits([flash, ram]: Bytes, memory: &Memory) -> Result<()> {
    for (name, limit) in limits(memory) {
        ensure!(
            flash <= limit[0] && ram <= limit[1],
            "the image takes {flash} bytes of flash and {ram} of RAM, more than {name} has ({} and {})",
            limit[0],
            limit[1]
        );
    }
    Ok(())
}

/// Returns the rest of a limit; negative when the limit is exceeded.
fn left(limit: u32, taken: u32) -> i64 {
    i64::from(limit) - i64::from(taken)
}

fn as_table(sizes: &Sizes, memory: &Memory) -> String {
    let row = |(name, taken): &(String, Bytes)| {
        let [flash, ram] = taken.map(|bytes| bytes.to_string());
        [name.clone(), flash, ram]
    };
    let heading =
        |name: &str| [["", "", ""], [name, "flash", "RAM"]].map(|row| row.map(str::to_owned));
    let total = sizes.total();
    let mut rows: Vec<[String; 3]> = sizes.sections.iter().map(row).collect();
    rows.extend(heading("crate"));
    rows.extend(sizes.crates.iter().map(row));
    rows.push(row(&("total".to_owned(), total)));
    rows.extend(heading("left of (stack not counted)"));
    rows.extend(limits(memory).map(|(name, [flash, ram])| {
        let name = format!("{name} ({} KiB / {} KiB)", flash / KIB, ram / KIB);
        let (flash, ram) = (left(flash, total[0]), left(ram, total[1]));
        [name, flash.to_string(), ram.to_string()]
    }));
    table::figures(&["section", "flash", "RAM"], rows)
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_02;

    use super::*;

    #[test]
    fn image_that_exceeds_a_limit_is_an_error_that_names_it() {
        let memory = MODIO_02.memory();
        let [flash, ram] = memory.budget;
        for (taken, limit) in [
            ([flash, ram], None),
            ([flash + 1, 0], Some("budget")),
            ([0, ram + 1], Some("budget")),
            ([64 * KIB + 1, 0], Some("STM32F103C8")),
            ([0, 20 * KIB + 1], Some("STM32F103C8")),
        ] {
            let error = within_limits(taken, memory).err();
            let text = error.map(|error| error.to_string());
            assert_eq!(text.is_some(), limit.is_some(), "{text:?}");
            assert!(text.unwrap_or_default().contains(limit.unwrap_or_default()));
        }
    }

    #[test]
    fn report_has_what_is_left_of_parts_and_budget() {
        let sections = vec![(".text".to_owned(), [70_000, 5_000])];
        let crates = Vec::new();
        let table = as_table(&Sizes { sections, crates }, MODIO_02.memory());
        assert!(table.contains("budget (53 KiB / 10 KiB)"), "{table}");
        assert!(table.contains("-15216"), "{table}");
    }
}
