//! `cargo xtask test`, the steps that a change must pass, and `cargo xtask ci`, which adds formatting, lints and
//! documentation with every warning an error, and steps that take longer.

use std::env;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;

use In::{Ci, Host, Test};
use Run::{Each, EachOfModio, Once};
use anyhow::{Result, bail, ensure};
use register_map::Board;
use register_map::board::{FX3U_24, MODIO_02, MODIO_08};

use crate::error::{missing, usage};
use crate::python::{console, masters, page};
use crate::renode::checks;
use crate::steps::{self, Done};
use crate::workspace::{ALL, SUITE, Workspace};
use crate::{adding, bench, build, command, fuzz, group, ordinary, peers, signed, size, table};

/// The variable with the corner of the part for the tests of the image.
pub const CORNER: &str = "MODIO_CORNER";

/// The programs for the microcontroller, each with its packages. They need different features of board-support.
const PROGRAMS: [(&str, &str); 2] = [
    (
        "firmware",
        "firmware board-support boot-state modio-drivers ports modbus-server register-map",
    ),
    (
        "loader",
        "loader board-support boot-state ports register-map",
    ),
];

const WORKSPACES: [&str; 3] = ["Cargo.toml", fuzz::MANIFEST, peers::MANIFEST];

/// The tests of the images that run at the corners: those whose result depends on the clocks, on the time of
/// instructions and of the flash, or on the converter.
const AT_CORNERS: &str = "air::requests:: analog_inputs:: boot:: clock:: comm_watchdog:: counters:: dac_faults:: \
    flash_faults:: hung_task:: in_force:: loading::the_ noise:: outputs_at_start:: points:: power_cut:: pulses:: saving:: \
    silences:: timing:: updating::cuts:: updating::service:: updating::the_ upsets::a_reply";
const AT_CORNERS_08: &str = "analog:: boot:: power_cut:: saving:: timing::";

/// Which command runs a step when no step is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum In {
    /// `cargo xtask test --host`, `cargo xtask test` and `cargo xtask ci`.
    Host,
    /// `cargo xtask test` and `cargo xtask ci`.
    Test,
    /// `cargo xtask ci` only.
    Ci,
}

/// The function of a step: for the project, or for each board.
enum Run {
    Once(fn(&mut Workspace) -> Result<()>),
    Each(fn(&mut Workspace, &'static Board) -> Result<()>),
    /// For each of [`MODIO`].
    EachOfModio(fn(&mut Workspace, &'static Board) -> Result<()>),
}

/// The boards that Renode and the bench have.
pub const MODIO: [&Board; 2] = [&MODIO_02, &MODIO_08];

/// The steps in the order in which they run: command, name, description, function. The names do not change. A step that
/// runs for each board has the board's number or name at the end of its name, such as `lint-02` or `lint-eth-io5r`.
const STEPS: [(In, &str, &str, Run); 23] = [
    (Ci, "fmt", "formatting", Once(formatting)),
    (Ci, "lint-host", "lints, host", Once(lint_host)),
    (Ci, "lint", "lints, target", Each(lint_target)),
    (Ci, "lint-fuzz", "lints, fuzz targets", Once(lint_fuzz)),
    (Ci, "lint-peers", "lints, peers", Once(lint_peers)),
    (Ci, "doc-host", "documentation, host", Once(doc_host)),
    (Ci, "doc", "documentation, target", Each(doc_target)),
    (Host, "unit", "tests on the host", Once(unit)),
    (Host, "image", "release images, no panics", Each(image)),
    (Host, "size", "size of the image", Each(size::check)),
    (Test, "sim", "tests of the images in simulation", Once(sim)),
    (Test, "conformance", "the conformance suite", Once(suite)),
    (Test, "modioctl", "modioctl on the simulator", Once(tool)),
    (Test, "pymodbus", "pymodbus and mbpoll", Once(masters)),
    (Test, "page", "the simulator's page", Once(page)),
    (Test, "console", "commands in the documents", Once(console)),
    (Test, "renode", "files for Renode", Once(checks::files)),
    (Ci, "sim-slow", "sim, slow corner", Once(sim_slow)),
    (Ci, "sim-fast", "sim, fast corner", Once(sim_fast)),
    (
        Ci,
        "bench",
        "instructions and bytes",
        EachOfModio(bench::check),
    ),
    (Ci, "peers", "Modbus servers, briefly", Once(peers::check)),
    (
        Ci,
        "adding",
        "the module of docs/adding-a-module.md",
        Once(adding::check),
    ),
    (Ci, "fuzz", "fuzz targets, briefly", Once(fuzz::check)),
];

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
    names: Vec<String>,

    /// List the steps instead of running them
    #[arg(long, conflicts_with = "names")]
    list: bool,

    /// Install missing Debian packages of the toolchain with apt-get, as root
    #[arg(long)]
    install_packages: bool,
}

/// A step, for one board if its function is for each: command, name, description, function.
type Step = (In, String, String, Box<Function>);
type Function = dyn Fn(&mut Workspace) -> Result<()>;

fn all() -> Vec<Step> {
    let mut all: Vec<Step> = Vec::new();
    for (part_of, name, what, run) in STEPS {
        let (run, boards): (_, &[&'static Board]) = match run {
            Once(run) => {
                all.push((part_of, name.to_owned(), what.to_owned(), Box::new(run)));
                continue;
            }
            Each(run) => (run, &Board::ALL),
            EachOfModio(run) => (run, &MODIO),
        };
        for board in boards {
            let name = format!("{name}-{}", board.name.trim_start_matches("modio-"));
            let run = Box::new(move |workspace: &mut Workspace| run(workspace, board));
            all.push((part_of, name, format!("{what}, {board}"), run));
        }
    }
    all
}

/// Returns the steps of these names, in the order of [`STEPS`], or the steps of the command if there are no names.
fn chosen(names: &[String], command: In) -> Result<Vec<Step>> {
    let mut all = all();
    let unknown = |name: &&String| !all.iter().any(|step| step.1 == **name);
    if let Some(name) = names.iter().find(unknown) {
        return Err(usage(format!("no step {name:?}; --list shows the steps")));
    }
    all.retain(|(part_of, name, ..)| match names {
        [] => *part_of <= command,
        names => names.contains(name),
    });
    Ok(all)
}

/// `cargo xtask test`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    workspace.host = options.host;
    let command = if options.host { Host } else { Test };
    options.steps.run(workspace, command)
}

/// `cargo xtask ci`. A step whose tool is missing fails.
pub fn ci(workspace: &mut Workspace, options: &Chosen) -> Result<()> {
    options.run(workspace, Ci)
}

impl Chosen {
    fn run(&self, workspace: &mut Workspace, command: In) -> Result<()> {
        if self.list {
            let rows = all().into_iter().map(|(part_of, name, what, _)| {
                let part_of = match part_of {
                    Host => "test --host, test, ci",
                    Test => "test, ci",
                    Ci => "ci",
                };
                [name, part_of.to_owned(), what]
            });
            say!("{}", table::text(&["step", "runs in", "what"], rows));
            return Ok(());
        }
        workspace.install = self.install_packages;
        // Every CI service sets this variable.
        let is_ci = !matches!(env::var("CI").as_deref(), Err(_) | Ok("" | "0" | "false"));
        let strict = command == Ci || is_ci;
        let mut done: Vec<Done> = Vec::new();
        for (_, name, what, run) in chosen(&self.names, command)? {
            group::not_interrupted()?;
            done.push(steps::timed(&name, &what, strict, || run(workspace)));
        }
        steps::finish(&done)
    }
}

fn formatting(workspace: &mut Workspace) -> Result<()> {
    // Check all workspaces, even when one fails.
    let checked = WORKSPACES.map(|manifest| {
        let mut cargo = workspace.cargo("fmt");
        command::run(cargo.args(["--all", "--check", "--manifest-path", manifest]))
    });
    checked.into_iter().collect()
}

fn deny_warnings(mut cargo: Command) -> Result<()> {
    command::run(cargo.args(["--", "-Dwarnings"]))
}

fn lint_host(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("clippy");
    cargo.args(ALL).arg("--all-targets");
    deny_warnings(cargo)
}

/// Returns cargo with the options that compile a program for a board.
fn for_target(
    workspace: &mut Workspace,
    subcommand: &str,
    program: &str,
    board: &Board,
) -> Result<Command> {
    let mut cargo = workspace.target_cargo(subcommand)?;
    cargo.args(["--profile", build::PROFILE]);
    cargo.args([
        "--features",
        &format!("{program}/board,board-support/{board}"),
    ]);
    Ok(cargo)
}

fn lint_target(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    for (program, packages) in PROGRAMS {
        let mut cargo = for_target(workspace, "clippy", program, board)?;
        for package in packages.split(' ') {
            cargo.args(["--package", package]);
        }
        deny_warnings(cargo)?;
    }
    Ok(())
}

fn lint_fuzz(workspace: &mut Workspace) -> Result<()> {
    deny_warnings(workspace.other("clippy", fuzz::MANIFEST, "fuzz"))
}

fn lint_peers(workspace: &mut Workspace) -> Result<()> {
    deny_warnings(workspace.other("clippy", peers::MANIFEST, "peers"))?;
    deny_warnings(bench::rivals(workspace, "clippy")?)
}

fn documentation(mut cargo: Command) -> Result<()> {
    cargo.args(["--no-deps", "--document-private-items"]);
    // Private items are documented too, so links to them are valid.
    let flags = "-Dwarnings -Arustdoc::private-intra-doc-links";
    command::run(cargo.env("RUSTDOCFLAGS", flags))
}

fn doc_host(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("doc");
    // Most of board-support exists for the target only.
    cargo.args(ALL).args(["--exclude", "board-support"]);
    documentation(cargo)
}

fn doc_target(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    for (program, _) in PROGRAMS {
        let mut cargo = for_target(workspace, "doc", program, board)?;
        cargo.args(["--package", "board-support", "--package", program]);
        documentation(cargo)?;
    }
    Ok(())
}

fn unit(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("test");
    if workspace.host {
        cargo.arg("--ignore-rust-version");
    } else {
        cargo.args(ALL).args(["--features", SUITE]);
    }
    command::run(cargo.arg("--no-fail-fast"))
}

fn image(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    build::all(workspace, board).map(drop)
}

fn sim(workspace: &mut Workspace) -> Result<()> {
    let tests = "--bin=modio-sim --test=command --test=image --test=image_08 --test=image_fx3u";
    // The image that runs alone, which is beside the others.
    build::image(workspace, &MODIO_02)?;
    let boards = [&MODIO_02, &MODIO_08, &FX3U_24];
    simulated(workspace, &boards, tests, "", &[])
}

fn suite(workspace: &mut Workspace) -> Result<()> {
    simulated(workspace, &Board::ALL, "--test=suite", "", &[])
}

fn tool(workspace: &mut Workspace) -> Result<()> {
    // The simulators follow the wall clock, so the tests mostly wait.
    let threads = thread::available_parallelism().map_or(2, |cores| cores.get() + 1);
    let threads = format!("--test-threads={threads}");
    let boards = [&MODIO_02, &MODIO_08];
    simulated(workspace, &boards, "--test=simulator", &threads, &[])?;
    ensure!(
        which::which("node").is_ok(),
        missing(
            "passed, but the functions of the Node-RED export were not run (on Debian: apt-get install nodejs)"
        )
    );
    let mut cargo = workspace.cargo("test");
    cargo.args(ALL).args(["--features", SUITE]);
    command::run(cargo.args(["--test=node_red", "--", "--include-ignored"]))
}

fn sim_slow(workspace: &mut Workspace) -> Result<()> {
    sim_at(workspace, "slow")
}

fn sim_fast(workspace: &mut Workspace) -> Result<()> {
    sim_at(workspace, "fast")
}

fn sim_at(workspace: &mut Workspace, corner: &str) -> Result<()> {
    let corner = [(CORNER, corner)];
    for (board, test, names) in [
        (&MODIO_02, "--test=image", AT_CORNERS),
        (&MODIO_08, "--test=image_08", AT_CORNERS_08),
        (&FX3U_24, "--test=image_fx3u", ""),
    ] {
        simulated(workspace, &[board], test, names, &corner)?;
    }
    Ok(())
}

/// Builds the loader of these boards, and the signed images for both slots. Returns for each board the variable with which
/// tests find the directory of these files.
pub fn images(
    workspace: &mut Workspace,
    boards: &[&'static Board],
) -> Result<Vec<(String, PathBuf)>> {
    let mut directories = Vec::new();
    for board in boards {
        let loader = build::loader(workspace, board)?;
        signed::update(workspace, &signed::Options::of(board))?;
        let name = board.name.to_uppercase().replace('-', "_");
        directories.push((format!("MODIO_IMAGES_{name}"), loader.with_file_name("")));
    }
    Ok(directories)
}

/// Runs tests that run the loader and the images of these boards in the simulator, as an ordinary user: those of these
/// targets whose names contain one of `names`, or all. Spaces separate targets and names. A name that begins with `--` is
/// an option of the tests. The variables choose the corner of the part, and how long a test is.
pub fn simulated(
    workspace: &mut Workspace,
    boards: &[&'static Board],
    targets: &str,
    names: &str,
    variables: &[(&str, &str)],
) -> Result<()> {
    let ordinary = ordinary::words()?;
    let images = images(workspace, boards)?;
    let simulator = workspace.simulator()?;
    let tests = |list: &[&str]| {
        let mut cargo = workspace.cargo("test");
        cargo.args(ALL).args(["--features", SUITE]);
        if !ordinary.is_empty() {
            let runner = format!("target.'cfg(unix)'.runner={ordinary:?}");
            cargo.args(["--config", &runner]);
        }
        cargo.arg("--no-fail-fast").args(targets.split(' '));
        cargo.args(["--", "--ignored"]).args(list);
        cargo.args(names.split_whitespace());
        cargo.env(CORNER, "nominal").envs(variables.iter().copied());
        cargo.envs(images.iter().map(|(name, directory)| (name, directory)));
        // Tests of one package do not know the path of another package's program.
        cargo.env("MODIO_SIM", &simulator);
        cargo
    };
    let wanted = names.split_whitespace();
    let wanted: Vec<_> = wanted.filter(|word| !word.starts_with("--")).collect();
    if !wanted.is_empty() {
        // The messages of the compiler are shown.
        let list = command::read(tests(&["--list"]).stderr(Stdio::inherit()))?;
        all_match(&list, &wanted)?;
    }
    command::run(&mut tests(&[]))
}

/// Refuses a name that no test in this list of tests has, because a run of no test passes.
fn all_match(list: &str, names: &[&str]) -> Result<()> {
    let tests = || list.lines().filter_map(|line| line.strip_suffix(": test"));
    let absent = names
        .iter()
        .find(|name| !tests().any(|test| test.contains(**name)));
    absent.map_or(Ok(()), |name| bail!("no test has the name {name}"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn names(names: &[&str], command: In) -> Result<Vec<String>> {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let chosen = chosen(&names, command)?;
        Ok(chosen.into_iter().map(|step| step.1).collect())
    }

    #[test]
    fn a_name_that_no_test_has_is_an_error() {
        let list = "noise::soak: test\nslots::a_pulse: test\n\n2 tests, 0 benchmarks\n";
        assert!(all_match(list, &["noise::soak", "slots::"]).is_ok());
        let error = all_match(list, &["slots::", "long_run::"]).unwrap_err();
        assert_eq!(error.to_string(), "no test has the name long_run::");
        assert!(all_match("", &["tests"]).is_err());
    }

    #[test]
    fn steps_are_chosen_by_command_or_name() {
        let host = names(&[], Host).unwrap();
        assert_eq!(host[..4], ["unit", "image-02", "image-08", "image-fx3u-14"]);
        let test = names(&[], Test).unwrap();
        assert!(host.iter().all(|name| test.contains(name)) && !test.contains(&"fuzz".to_owned()));
        assert_eq!(
            names(&["size-08", "fmt"], Test).unwrap(),
            ["fmt", "size-08"]
        );
        let error = names(&["no-step"], Test).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
    }

    #[test]
    fn workflow_runs_every_step_under_a_unique_name() {
        let workflow = include_str!("../../.github/workflows/ci.yml");
        let words: BTreeSet<&str> = workflow.split_whitespace().collect();
        let mut seen = BTreeSet::new();
        let mut missing = Vec::new();
        for name in names(&[], Ci).unwrap() {
            if !words.contains(name.as_str()) {
                missing.push(name.clone());
            }
            assert!(seen.insert(name.clone()), "{name} is the name of two steps");
        }
        let missing = missing.join(" ");
        assert!(missing.is_empty(), "no job of ci.yml runs: {missing}");
    }
}
