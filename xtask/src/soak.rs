//! `cargo xtask soak` and `cargo xtask matrix`: longer runs of tests that `cargo xtask test` also runs, there with
//! fewer frames, for seconds, and with selected cases.

use std::time::SystemTime;

use anyhow::{Result, ensure};
use register_map::Module;
use register_map::board::MODIO_02;

use crate::error::usage;
use crate::workspace::Workspace;
use crate::{build, simulated};

/// The options of a test run with one test, which shows its progress.
const ONE_TEST: &str = "--nocapture --exact";

/// How long to run.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Number of frames to send
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    frames: u64,

    /// Instead of frames without pause: hours of virtual time, such as 24, with a request every second
    // Virtual time ends after 213 days.
    #[arg(long, conflicts_with = "frames", value_parser = clap::value_parser!(u16).range(1..=2400))]
    hours: Option<u16>,

    /// Corner of the part: nominal, slow or fast
    #[arg(long, default_value = "nominal", value_parser = ["nominal", "slow", "fast"])]
    corner: String,
}

/// `cargo xtask soak`: tests `noise` and `long_run` of `tools/sim/tests/image`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let (name, variable, length) = match options.hours {
        Some(hours) => (
            "long_run::an_input_changes_and_is_read_every_second_for_hours",
            "MODIO_SOAK_HOURS",
            hours.into(),
        ),
        None => ("noise::soak", "MODIO_SOAK_FRAMES", options.frames),
    };
    let name = format!("{ONE_TEST} {name}");
    let variables = [
        (variable, &*length.to_string()),
        (simulated::CORNER, &options.corner),
    ];
    simulated::run(
        workspace,
        &[&MODIO_02],
        "--quiet --test=image",
        &name,
        &variables,
    )
}

/// Number of turns after which each rate has had every module.
const MODULES: u64 = Module::ALL.len() as u64;

/// The board of the matrix, and which module each rate has.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Matrix {
    #[command(flatten)]
    build: build::Options,

    /// Move the modules on by so many rates, to repeat a run [default: the number of the day, so that each rate has
    /// every module once in as many days as there are modules]
    #[arg(long, value_parser = clap::value_parser!(u64).range(..MODULES))]
    turn: Option<u64>,
}

/// `cargo xtask matrix`: every case of the conformance suite at every rate and format of the register map, with another
/// module for each rate on a board with slots, the test `matrix` of `tools/conformance/tests/suite`.
pub fn matrix(workspace: &mut Workspace, options: &Matrix) -> Result<()> {
    const DAY_S: u64 = 24 * 60 * 60;
    let board = options.build.board;
    let has_slots = board.fixed.is_empty();
    ensure!(
        has_slots || options.turn.is_none(),
        usage(format!("the {board} has no slots: leave out --turn"))
    );
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
    let turn = options.turn.unwrap_or(since.as_secs() / DAY_S % MODULES);
    if has_slots {
        say!("repeat this run with: cargo xtask matrix --board {board} --turn {turn}");
    }
    let name = format!("{ONE_TEST} matrix::every_rate_and_format_conforms");
    let every_case = [("MODIO_MATRIX", &*format!("{board} {turn}"))];
    simulated::run(
        workspace,
        &[board],
        "--quiet --test=suite",
        &name,
        &every_case,
    )
}
