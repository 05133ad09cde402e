//! `cargo xtask size`: the flash and RAM of the image, by section and by crate, and what is left.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use register_map::Row;
use register_map::layout::{HEADER, LOADER};
use register_map::part::FLASH_BASE;
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

/// `cargo xtask size`. An image that exceeds its limit is an error.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let board = options.given.board();
    let elf = match options.slot {
        Some(slot) => build::program(workspace, board, Program::Slot(slot), None)?.elf,
        None => options.given.elf(workspace)?,
    };
    let sizes = of(&elf)?;
    let limit = limit(board, options.slot);
    say!("{}", as_table(&sizes, limit));
    within(sizes.total(), limit)
}

/// Shows what is left of the loader and of each image of a board. Fails when one exceeds its limit.
pub fn check(workspace: &mut Workspace, board: &'static Row) -> Result<()> {
    let loader = build::loader(workspace, board)?;
    let [flash, _] = of(&loader)?.total();
    say!("loader: {} bytes of flash left", left(LOADER, flash));
    ensure!(
        flash <= LOADER,
        "the loader takes {flash} bytes of flash, more than its {LOADER}"
    );
    for (name, slot) in [
        ("slot a", Some(Slot::A)),
        ("slot b", Some(Slot::B)),
        ("alone", None),
    ] {
        let program = slot.map_or(Program::Alone, Program::Slot);
        let elf = build::program(workspace, board, program, None)?.elf;
        let (taken, limit) = (of(&elf)?.total(), limit(board, slot));
        let [flash, ram] = [0, 1].map(|memory| left(limit[memory], taken[memory]));
        say!("{name}: {flash} bytes of flash and {ram} of RAM left");
        within(taken, limit)?;
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

/// Returns the bytes of flash and of RAM that an image may take: flash of its slot, or of the smallest part without the
/// store when it runs alone, and the RAM that the stack leaves.
pub fn limit(board: &Row, slot: Option<Slot>) -> Bytes {
    let flash = match slot {
        Some(_) => board.layout().slot - HEADER,
        None => board.store().first - FLASH_BASE,
    };
    let memory = board.memory;
    [flash, memory.least().ram - memory.stack]
}

fn within([flash, ram]: Bytes, limit: Bytes) -> Result<()> {
    ensure!(
        flash <= limit[0] && ram <= limit[1],
        "the image takes {flash} bytes of flash and {ram} of RAM, more than {} and {}",
        limit[0],
        limit[1]
    );
    Ok(())
}

/// Returns the rest of a limit; negative when the limit is exceeded.
fn left(limit: u32, taken: u32) -> i64 {
    i64::from(limit) - i64::from(taken)
}

fn as_table(sizes: &Sizes, limit: Bytes) -> String {
    let row = |(name, taken): &(String, Bytes)| {
        let [flash, ram] = taken.map(|bytes| bytes.to_string());
        [name.clone(), flash, ram]
    };
    let total = sizes.total();
    let mut rows: Vec<[String; 3]> = sizes.sections.iter().map(row).collect();
    rows.extend([["", "", ""], ["crate", "flash", "RAM"]].map(|row| row.map(str::to_owned)));
    rows.extend(sizes.crates.iter().map(row));
    rows.push(row(&("total".to_owned(), total)));
    rows.push(row(&("limit (stack not counted)".to_owned(), limit)));
    let [flash, ram] = [0, 1].map(|memory| left(limit[memory], total[memory]).to_string());
    rows.push(["left".to_owned(), flash, ram]);
    table::figures(&["section", "flash", "RAM"], rows)
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};
    use register_map::part::KIB;

    use super::*;

    #[test]
    fn limit_is_the_slot_or_the_smallest_part_and_an_image_above_it_is_an_error() {
        let slot = limit(&MODIO_02, Some(Slot::B));
        assert_eq!(slot, [54_784, 11 * KIB]);
        assert_eq!(limit(&MODIO_02, None), [62 * KIB, 11 * KIB]);
        assert_eq!(limit(&MODIO_08, Some(Slot::A)), [118_272, 36 * KIB]);
        assert!(within(slot, slot).is_ok());
        for taken in [[slot[0] + 1, 0], [0, slot[1] + 1]] {
            let error = within(taken, slot).unwrap_err();
            assert!(error.to_string().contains("54784"), "{error}");
        }
    }

    #[test]
    fn report_has_what_is_left() {
        let sections = vec![(".text".to_owned(), [70_000, 5_000])];
        let crates = Vec::new();
        let table = as_table(&Sizes { sections, crates }, [54_784, 11_264]);
        let last = table.lines().last().unwrap_or_default();
        let words: Vec<_> = last.split_whitespace().collect();
        assert_eq!(words, ["left", "-15216", "6264"], "{table}");
    }
}
