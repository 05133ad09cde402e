//! `cargo xtask test`: the steps that a change must pass.

use std::env;

use anyhow::Result;
use register_map::Board;
use register_map::board::{MODIO_02, MODIO_08};

use crate::steps::{self, Bench, In, Step, short};
use crate::workspace::{ALL, Workspace};
use crate::{ci, command, page, pymodbus, renode, sim, size};

/// The variable with the corner of the part for the tests of the image.
pub const CORNER: &str = "MODIO_CORNER";

/// The feature with which the conformance suite contains the simulator. All tests are built with it, so that nothing is
/// built twice.
pub const SUITE: &str = "conformance/sim";

/// The options of `cargo xtask test`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Leave out the simulator: host tests, images and sizes
    #[arg(long)]
    host: bool,

    #[command(flatten)]
    steps: Chosen,
}

/// Which steps to run.
#[derive(clap::Args, Debug)]
#[group(skip)]
pub struct Chosen {
    /// Run only these steps; --list shows their names
    #[arg(value_name = "STEP")]
    pub names: Vec<String>,

    /// List the steps instead of running them
    #[arg(long, conflicts_with = "names")]
    pub list: bool,

    /// Install missing Debian packages of the toolchain with apt-get, as root
    #[arg(long)]
    pub install_packages: bool,
}

/// `cargo xtask test`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let command = if options.host { In::Host } else { In::Test };
    options.steps.run(workspace, command)
}

impl Chosen {
    /// Runs the chosen steps, or the steps of the command if none is named.
    pub fn run(&self, workspace: &mut Workspace, command: In) -> Result<()> {
        let all = ci::steps();
        if self.list {
            steps::list(&all);
            return Ok(());
        }
        workspace.install = self.install_packages;
        let chosen = steps::chosen(all, &self.names, command)?;
        let strict = command == In::Ci || is_ci(env::var("CI").ok().as_deref());
        let mut bench = Bench::new(workspace, command == In::Host);
        steps::run(&chosen, &mut bench, strict)
    }
}

/// Returns whether the variable `CI`, which every CI service sets, means that this process runs in CI.
fn is_ci(variable: Option<&str>) -> bool {
    !matches!(variable, None | Some("" | "0" | "false"))
}

/// Returns the steps of `cargo xtask test`.
pub fn steps() -> Vec<Step> {
    let mut all = vec![Step::new(In::Host, "unit", "tests on the host", |bench| {
        let mut cargo = bench.workspace.cargo("test");
        if bench.host {
            cargo.arg("--ignore-rust-version");
        } else {
            cargo.args(ALL).args(["--features", SUITE]);
        }
        command::run(cargo.arg("--no-fail-fast"))
    })];
    for board in Board::ALL {
        let name = format!("image-{}", short(board));
        let what = format!("release image of the {board}, which must not panic");
        all.push(Step::new(In::Host, name, what, |bench| {
            bench.image(board).map(drop)
        }));
        let name = format!("size-{}", short(board));
        let what = format!("size of the image of the {board}");
        all.push(Step::new(In::Host, name, what, |bench| {
            size::check(&bench.image(board)?, board)
        }));
    }
    all.extend([
        Step::new(
            In::Test,
            "sim",
            "tests of the images in simulation",
            |bench| {
                let tests = [
                    "--bin=modio-sim",
                    "--test=command",
                    "--test=image",
                    "--test=image_08",
                ];
                in_simulation(bench, &tests, &[], "nominal")
            },
        ),
        Step::new(
            In::Test,
            "conformance",
            "conformance of the images",
            |bench| {
                let tests = ["--test=suite", "--test=hil", "--test=hil_simulator"];
                in_simulation(bench, &tests, &[], "nominal")
            },
        ),
        Step::new(In::Test, "modioctl", "modioctl on the simulator", |bench| {
            in_simulation(bench, &["--test=simulator"], &[], "nominal")
        }),
        Step::new(
            In::Test,
            "pymodbus",
            "pymodbus and mbpoll as masters",
            |bench| {
                let (elf, elf_08) = (bench.image(&MODIO_02)?, bench.image(&MODIO_08)?);
                pymodbus::check(bench.workspace, &elf, &elf_08)
            },
        ),
        Step::new(
            In::Test,
            "page",
            "the simulator's page in Chromium",
            |bench| {
                let (elf, elf_08) = (bench.image(&MODIO_02)?, bench.image(&MODIO_08)?);
                page::check(bench.workspace, &elf, &elf_08)
            },
        ),
    ]);
    for board in Board::ALL {
        let name = format!("renode-{}", short(board));
        let what = format!("files for Renode, {board}");
        all.push(Step::new(In::Test, name, what, |bench| {
            let elf = bench.image(board)?;
            renode::checks::files(bench.workspace, board, &elf)
        }));
    }
    all
}

/// Returns the steps at the corners other than the nominal one.
pub fn corners() -> impl Iterator<Item = Step> {
    ["slow", "fast"].into_iter().map(|corner| {
        let name = format!("sim-{corner}");
        let what = format!("tests of the images in simulation, {corner} corner");
        Step::new(In::Ci, name, what, move |bench| {
            in_simulation(bench, &["--test=image"], &[], corner)?;
            in_simulation(bench, &["--test=image_08"], &OWN_OF_08, corner)
        })
    })
}

/// The tests of the modio-08 that run at the corners: those of the board itself, its start and its store. The other
/// tests run the same code as on the modio-02, and would double the time.
const OWN_OF_08: [&str; 6] = [
    "analog::",
    "boot::",
    "digital::",
    "faults_of_slots::",
    "power_cut::",
    "slots::",
];

/// Runs tests that run the images in the simulator at a corner of the part: those of these targets whose names contain
/// one of `names`, or all.
fn in_simulation(bench: &mut Bench, targets: &[&str], names: &[&str], corner: &str) -> Result<()> {
    let mut cargo = bench.workspace.cargo("test");
    cargo
        .args(ALL)
        .args(["--no-fail-fast", "--features", SUITE]);
    cargo.args(targets).args(["--", "--include-ignored"]);
    cargo.args(names);
    cargo.env("MODIO_ELF", bench.image(&MODIO_02)?);
    cargo.env("MODIO_ELF_08", bench.image(&MODIO_08)?);
    cargo.env(CORNER, corner);
    // Tests of one package do not know the path of another package's program.
    cargo.env("MODIO_SIM", sim::simulator(bench.workspace)?);
    command::run(&mut cargo)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ci_is_recognised_by_its_variable() {
        for (variable, expected) in [
            (None, false),
            (Some(""), false),
            (Some("false"), false),
            (Some("0"), false),
            (Some("true"), true),
            (Some("1"), true),
        ] {
            assert_eq!(is_ci(variable), expected, "{variable:?}");
        }
    }
}
