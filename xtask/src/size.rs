//! `cargo xtask size`: the flash and RAM of the image, by section and by crate, and what is left of the parts and of
//! the budget.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use register_map::Board;
use serde_json::{Value, json};

use crate::board::{Hardware, Memory};
use crate::workspace::Workspace;
use crate::{build, image, table};

mod measure;
mod owner;
mod source;

pub use measure::{Bytes, Sizes, measure};
pub use source::{Source, structures};

const KIB: u32 = 1024;

/// What to measure and how to report it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// Measure this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// `cargo xtask size`. An image that exceeds a limit is an error.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let elf = match &options.elf {
        Some(elf) => elf.clone(),
        None => build::image(workspace, options.build.board)?.elf,
    };
    let sizes = of(&elf)?;
    let hardware = Hardware::of(options.build.board);
    if options.json {
        say!("{:#}", as_json(&sizes, hardware));
    } else {
        say!("{}", as_table(&sizes, hardware));
    }
    within_limits(&sizes, hardware)
}

/// Fails when an image does not fit the parts and the budget of a board.
pub fn check(elf: &Path, board: &Board) -> Result<()> {
    within_limits(&of(elf)?, Hardware::of(board))
}

/// Returns the figures of an image for a board as JSON.
pub fn report(elf: &Path, board: &Board) -> Result<Value> {
    Ok(as_json(&of(elf)?, Hardware::of(board)))
}

fn of(elf: &Path) -> Result<Sizes> {
    measure(&image::read(elf)?).with_context(|| elf.display().to_string())
}

fn within_limits(sizes: &Sizes, hardware: &Hardware) -> Result<()> {
    let Bytes { flash, ram } = sizes.total;
    let exceeded = |limit: &Memory| flash > limit.flash || ram > limit.ram;
    if let Some(limit) = hardware.limits().find(exceeded) {
        let Memory {
            name,
            flash: flash_limit,
            ram: ram_limit,
        } = limit;
        bail!(
            "the image takes {flash} bytes of flash and {ram} of RAM, more than {name} has ({flash_limit} and \
             {ram_limit})"
        );
    }
    Ok(())
}

/// Returns the rest of a limit; negative when the limit is exceeded.
fn left(limit: u32, taken: u32) -> i64 {
    i64::from(limit) - i64::from(taken)
}

fn as_json(sizes: &Sizes, hardware: &Hardware) -> Value {
    let rows = |rows: &[(String, Bytes)]| -> Vec<Value> {
        let row = |(name, taken): &(String, Bytes)| json!({ "name": name, "flash": taken.flash, "ram": taken.ram });
        rows.iter().map(row).collect()
    };
    let limits = hardware.limits().map(|limit| {
        json!({
            "name": limit.name,
            "flash": { "size": limit.flash, "left": left(limit.flash, sizes.total.flash) },
            "ram": { "size": limit.ram, "left": left(limit.ram, sizes.total.ram) },
        })
    });
    json!({
        "flash": sizes.total.flash,
        "ram": sizes.total.ram,
        "sections": rows(&sizes.sections),
        "crates": rows(&sizes.crates),
        "limits": limits.collect::<Vec<_>>(),
    })
}

fn as_table(sizes: &Sizes, hardware: &Hardware) -> String {
    let mut table = table::new(["section", "flash", "RAM"]);
    table::figures(&mut table);
    let row = |name: &str, taken: Bytes| {
        [
            name.to_owned(),
            taken.flash.to_string(),
            taken.ram.to_string(),
        ]
    };
    for (name, taken) in &sizes.sections {
        table.add_row(row(name, *taken));
    }
    table
        .add_row(["", "", ""])
        .add_row(["crate", "flash", "RAM"]);
    for (name, taken) in &sizes.crates {
        table.add_row(row(name, *taken));
    }
    table.add_row(row("total", sizes.total));
    table
        .add_row(["", "", ""])
        .add_row(["left of (stack not counted)", "flash", "RAM"]);
    for Memory { name, flash, ram } in hardware.limits() {
        table.add_row([
            format!("{name} ({} KiB / {} KiB)", flash / KIB, ram / KIB),
            left(flash, sizes.total.flash).to_string(),
            left(ram, sizes.total.ram).to_string(),
        ]);
    }
    table::text(&table)
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;

    fn sizes(flash: u32, ram: u32) -> Sizes {
        let total = Bytes { flash, ram };
        Sizes {
            sections: vec![(".text".to_owned(), total)],
            crates: vec![("firmware".to_owned(), total)],
            total,
        }
    }

    #[test]
    fn report_has_what_is_left_of_parts_and_budget() {
        let hardware = Hardware::of(&MODIO_02);
        let json = as_json(&sizes(70_000, 5_000), hardware);
        assert_eq!(json["limits"][0]["flash"]["left"], 65_536 - 70_000);
        assert_eq!(json["limits"][1]["flash"]["left"], 131_072 - 70_000);
        assert_eq!(json["limits"][2]["ram"]["left"], 8_192 - 5_000);
        assert_eq!(json["crates"][0]["name"], "firmware");
        let table = as_table(&sizes(70_000, 5_000), hardware);
        assert!(table.contains("budget (47 KiB / 8 KiB)"), "{table}");
        assert!(table.contains("-4464"), "{table}");
    }

    #[test]
    fn image_that_exceeds_a_limit_is_an_error_that_names_it() {
        for (board, flash, ram, limit) in [
            (&MODIO_02, 47 * KIB, 8 * KIB, None),
            (&MODIO_02, 47 * KIB + 1, 0, Some("budget")),
            (&MODIO_02, 0, 8 * KIB + 1, Some("budget")),
            (&MODIO_02, 64 * KIB + 1, 0, Some("STM32F103C8")),
            (&MODIO_02, 0, 20 * KIB + 1, Some("STM32F103C8")),
            (&MODIO_08, 47 * KIB, 12 * KIB, None),
            (&MODIO_08, 0, 12 * KIB + 1, Some("budget")),
            (&MODIO_08, 256 * KIB + 1, 0, Some("STM32F103RC")),
        ] {
            let checked = within_limits(&sizes(flash, ram), Hardware::of(board));
            let text = checked.err().map(|error| error.to_string());
            assert_eq!(text.is_some(), limit.is_some(), "{text:?}");
            let named =
                limit.is_none_or(|limit| text.as_ref().is_some_and(|text| text.contains(limit)));
            assert!(named, "{text:?}");
        }
    }
}
