//! `cargo xtask size`: what the image takes of flash and RAM, by section and by crate, and what is
//! left of the parts and of the application's budget.

use std::path::{Path, PathBuf};

use register_map::Board;
use serde_json::{Value, json};

use crate::board::{Hardware, Memory};
use crate::workspace::Workspace;
use crate::{Failure, Result, build, image};

mod measure;
mod owner;
mod source;
pub mod types;

pub use measure::{Bytes, Sizes, measure};
pub use source::Source;

const KIB: u32 = 1024;

/// What to measure and how to tell.
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

/// `cargo xtask size`.
///
/// # Errors
///
/// When the image does not build, is broken, or does not fit a part or the budget.
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
        say!("{}", as_table(&sizes, hardware).trim_end());
    }
    within_limits(&sizes, hardware)
}

/// Whether an image fits the parts and the budget of a board.
///
/// # Errors
///
/// When it does not, or is no image.
pub fn check(elf: &Path, board: &Board) -> Result<()> {
    within_limits(&of(elf)?, Hardware::of(board))
}

/// The figures of an image for a board as JSON.
///
/// # Errors
///
/// When it is no image.
pub fn report(elf: &Path, board: &Board) -> Result<Value> {
    of(elf).map(|sizes| as_json(&sizes, Hardware::of(board)))
}

fn of(elf: &Path) -> Result<Sizes> {
    measure(&image::read(elf)?).map_err(|why| Failure::asked(format!("{}: {why}", elf.display())))
}

fn within_limits(sizes: &Sizes, hardware: &Hardware) -> Result<()> {
    match exceeded(sizes, hardware) {
        Some(limit) => Err(Failure::new(format!(
            "the image takes {} bytes of flash and {} of RAM: more than {} has ({} and {})",
            sizes.total.flash, sizes.total.ram, limit.name, limit.flash, limit.ram
        ))),
        None => Ok(()),
    }
}

/// The part or budget that the image exceeds.
fn exceeded(sizes: &Sizes, hardware: &Hardware) -> Option<Memory> {
    hardware
        .limits()
        .find(|limit| sizes.total.flash > limit.flash || sizes.total.ram > limit.ram)
}

/// What is left of a limit; negative when it is exceeded.
fn left(limit: u32, taken: u32) -> i64 {
    i64::from(limit) - i64::from(taken)
}

fn as_json(sizes: &Sizes, hardware: &Hardware) -> Value {
    let rows = |rows: &[(String, Bytes)]| -> Vec<Value> {
        let row = |(name, taken): &(String, Bytes)| json!({ "name": name, "flash": taken.flash, "ram": taken.ram });
        rows.iter().map(row).collect()
    };
    let limits: Vec<Value> = hardware
        .limits()
        .map(|limit| {
            json!({
                "name": limit.name,
                "flash": { "size": limit.flash, "left": left(limit.flash, sizes.total.flash) },
                "ram": { "size": limit.ram, "left": left(limit.ram, sizes.total.ram) },
            })
        })
        .collect();
    json!({
        "flash": sizes.total.flash,
        "ram": sizes.total.ram,
        "sections": rows(&sizes.sections),
        "crates": rows(&sizes.crates),
        "limits": limits,
    })
}

fn as_table(sizes: &Sizes, hardware: &Hardware) -> String {
    let mut lines = Vec::new();
    let mut row = |name: &str, flash: String, ram: String| {
        lines.push(format!("{name:<32} {flash:>10} {ram:>10}\n"));
    };
    for (title, rows) in [("section", &sizes.sections), ("crate", &sizes.crates)] {
        row(title, "flash".to_owned(), "RAM".to_owned());
        for (name, taken) in rows {
            row(name, taken.flash.to_string(), taken.ram.to_string());
        }
        row(
            "total",
            sizes.total.flash.to_string(),
            sizes.total.ram.to_string(),
        );
        row("", String::new(), String::new());
    }
    row(
        "left of (stack not counted)",
        "flash".to_owned(),
        "RAM".to_owned(),
    );
    for limit in hardware.limits() {
        let size = format!(
            "{} ({} KiB / {} KiB)",
            limit.name,
            limit.flash / KIB,
            limit.ram / KIB
        );
        let of = |limit, taken| match left(limit, taken) {
            left if left < 0 => format!("{} over", -left),
            left => left.to_string(),
        };
        row(
            &size,
            of(limit.flash, sizes.total.flash),
            of(limit.ram, sizes.total.ram),
        );
    }
    lines
        .iter()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
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
    fn what_is_left_is_told_for_parts_and_budget() {
        let hardware = Hardware::of(&MODIO_02);
        let json = as_json(&sizes(30_000, 5_000), hardware);
        assert_eq!(json["limits"][0]["flash"]["left"], 65_536 - 30_000);
        assert_eq!(json["limits"][1]["flash"]["left"], 131_072 - 30_000);
        assert_eq!(json["limits"][2]["ram"]["left"], 8_192 - 5_000);
        assert_eq!(json["crates"][0]["name"], "firmware");
        let table = as_table(&sizes(30_000, 5_000), hardware);
        assert!(table.contains("budget (47 KiB / 8 KiB)"), "{table}");
        assert!(table.lines().all(|line| line.trim_end() == line), "{table}");
    }

    #[test]
    fn an_image_that_is_too_large_is_found_out() {
        let hardware = Hardware::of(&MODIO_02);
        let limit = |flash, ram| exceeded(&sizes(flash, ram), hardware).map(|limit| limit.name);
        assert_eq!(limit(47 * KIB, 8 * KIB), None);
        assert_eq!(limit(47 * KIB + 1, 0), Some("budget"));
        assert_eq!(limit(0, 8 * KIB + 1), Some("budget"));
        assert_eq!(limit(64 * KIB + 1, 0), Some("STM32F103C8"));
        assert_eq!(limit(0, 20 * KIB + 1), Some("STM32F103C8"));
        let failure = within_limits(&sizes(70_000, 9_000), hardware)
            .unwrap_err()
            .to_string();
        assert!(
            failure.contains("70000") && failure.contains("STM32F103C8"),
            "{failure}"
        );
        assert!(as_table(&sizes(48 * KIB, 0), hardware).contains("1024 over"));
    }

    #[test]
    fn every_board_has_limits_of_its_own() {
        let hardware = Hardware::of(&MODIO_08);
        let limit = |flash, ram| exceeded(&sizes(flash, ram), hardware).map(|limit| limit.name);
        assert_eq!(limit(47 * KIB, 12 * KIB), None);
        assert_eq!(limit(0, 12 * KIB + 1), Some("budget"));
        assert_eq!(limit(256 * KIB + 1, 0), Some("STM32F103RC"));
        assert_eq!(limit(0, 48 * KIB + 1), Some("STM32F103RC"));
    }
}
