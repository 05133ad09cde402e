//! `cargo xtask test`, the steps that a change must pass, and `cargo xtask ci`, which adds formatting, lints and
//! documentation with every warning an error, and steps that take longer.

use std::env;
use std::num::NonZero;
use std::thread;

use In::{Ci, Host, Night, Test};
use Run::{Each, EachOfModio, EachPart, Once};
use anyhow::{Result, ensure};
use register_map::Row;
use register_map::board::{FX3U_24, MODIO_02, MODIO_08};

use crate::error::{missing, usage};
use crate::python::{console, masters, page};
use crate::renode::{MODIO, checks};
use crate::steps::{self, Done};
use crate::workspace::{ALL, SUITE, Workspace};
use crate::{
    adding, bench, build, command, fuzz, group, images, lint, peers, simulated, size, table,
};

/// The tests of images: of these boards, in these targets.
const IMAGES: [(&Row, &str); 3] = [
    (&MODIO_02, "--test=image"),
    (&MODIO_08, "--test=image_08"),
    (&FX3U_24, "--test=image_fx3u"),
];

/// Parts of the names of tests, for each of [`IMAGES`]; without any all tests.
type Names = [&'static str; 3];

/// Those whose result can depend on a corner: on the clocks, on the time of instructions and of the flash, or on the
/// converter.
const AT_CORNERS: Names = [
    "air::requests:: analog_inputs:: boot:: clock:: comm_watchdog:: counters:: dac_faults:: flash_faults:: hung_task:: \
        in_force:: loading::the_ noise:: outputs_at_start:: points:: power_cut:: pulses:: saving:: silences:: timing:: \
        updating::cuts:: updating::service:: updating::the_ upsets::a_reply",
    "analog:: boot:: power_cut:: saving:: timing::",
    "",
];

/// Those for which instructions take longer: the times of starts, replies, saves and cuts, and the converter.
const AT_SLOW: Names = [
    "air::requests:: analog_inputs:: boot:: clock:: flash_faults:: hung_task:: loading::the_ noise:: power_cut:: \
        pulses:: saving:: silences:: timing:: updating::cuts:: updating::service::",
    "analog:: boot:: saving:: timing::",
    "analog_ line_stays rs232::frames rs232::reply rs232::save scan_finds timing::",
];

/// Which command runs a step when no step is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum In {
    /// `cargo xtask test --host`, `cargo xtask test` and `cargo xtask ci`.
    Host,
    /// `cargo xtask test` and `cargo xtask ci`.
    Test,
    /// `cargo xtask ci` only.
    Ci,
    /// None: the workflow nightly.yml names it.
    Night,
}

/// The function of a step: for the project, or for each board.
enum Run {
    Once(fn(&mut Workspace) -> Result<()>),
    Each(OfBoard),
    /// For each of [`MODIO`].
    EachOfModio(OfBoard),
    /// For the board of each of [`lint::PARTS`].
    EachPart(OfBoard),
}

type OfBoard = fn(&mut Workspace, &'static Row) -> Result<()>;

/// The steps in the order in which they run: command, name, description, function. The names do not change. A step that
/// runs for each board has the board's number or name at the end of its name, such as `image-02` or `image-eth-io5r`. The
/// name without it, `image`, means all of them.
const STEPS: [(In, &str, &str, Run); 23] = [
    (Ci, "fmt", "formatting", Once(lint::formatting)),
    (Ci, "lint-host", "lints, host", Once(lint::host)),
    (Ci, "lint", "lints, target", EachPart(lint::target)),
    (
        Ci,
        "lint-fuzz",
        "lints, fuzz targets",
        Once(lint::fuzz_targets),
    ),
    (Ci, "lint-peers", "lints, peers", Once(lint::peers)),
    (Ci, "doc-host", "documentation, host", Once(lint::doc_host)),
    (
        Ci,
        "doc",
        "documentation, target",
        EachPart(lint::doc_target),
    ),
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
    (
        Ci,
        "sim-slow",
        "sim, slow corner",
        Once(|workspace| sim_at(workspace, "slow", AT_SLOW)),
    ),
    (
        Ci,
        "bench",
        "instructions and bytes",
        EachOfModio(bench::check),
    ),
    (Ci, "peers", "Modbus servers, briefly", Once(peers::check)),
    (Ci, "fuzz", "fuzz targets, briefly", Once(fuzz::check)),
    (
        Night,
        "adding",
        "the module and the board of the documents",
        Once(adding::check),
    ),
    (Night, "corners", "sim, both corners", Once(corners)),
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

/// A step, for one board if its function is for each.
struct Step {
    part_of: In,
    /// Its name in [`STEPS`], which the steps of all boards share.
    all: &'static str,
    name: String,
    what: String,
    run: Box<Function>,
}

type Function = dyn Fn(&mut Workspace) -> Result<()>;

impl Step {
    fn is(&self, name: &str) -> bool {
        [self.all, &self.name].contains(&name)
    }
}

fn all() -> Vec<Step> {
    let short = |board: &'static Row| (board.name.trim_start_matches("modio-"), board);
    let mut steps = Vec::new();
    for (part_of, all, what, run) in STEPS {
        let (run, boards) = match run {
            Once(run) => {
                steps.push(Step {
                    part_of,
                    all,
                    name: all.to_owned(),
                    what: what.to_owned(),
                    run: Box::new(run),
                });
                continue;
            }
            Each(run) => (run, Row::ALL.map(short).to_vec()),
            EachOfModio(run) => (run, MODIO.map(short).to_vec()),
            EachPart(run) => (run, lint::PARTS.to_vec()),
        };
        steps.extend(boards.into_iter().map(|(of, board)| Step {
            part_of,
            all,
            name: format!("{all}-{of}"),
            what: format!("{what}, {board}"),
            run: Box::new(move |workspace: &mut Workspace| run(workspace, board)),
        }));
    }
    steps
}

/// Returns the steps of these names, in the order of [`STEPS`], or the steps of the command if there are no names.
fn chosen(names: &[String], command: In) -> Result<Vec<Step>> {
    let mut all = all();
    let unknown = |name: &&String| !all.iter().any(|step| step.is(name));
    if let Some(name) = names.iter().find(unknown) {
        return Err(usage(format!("no step {name:?}; --list shows the steps")));
    }
    all.retain(|step| match names {
        [] => step.part_of <= command,
        names => names.iter().any(|name| step.is(name)),
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
            let rows = all().into_iter().map(|step| {
                let part_of = match step.part_of {
                    Host => "test --host, test, ci",
                    Test => "test, ci",
                    Ci => "ci",
                    Night => "the nightly workflow",
                };
                [step.name, part_of.to_owned(), step.what]
            });
            say!("{}", table::text(&["step", "runs in", "what"], rows));
            return Ok(());
        }
        workspace.install = self.install_packages;
        // Every CI service sets this variable.
        let is_ci = !matches!(env::var("CI").as_deref(), Err(_) | Ok("" | "0" | "false"));
        let strict = command == Ci || is_ci;
        let mut done: Vec<Done> = Vec::new();
        for Step {
            name, what, run, ..
        } in chosen(&self.names, command)?
        {
            group::not_interrupted()?;
            done.push(steps::timed(&name, &what, strict, || run(workspace)));
        }
        steps::finish(&done)
    }
}

fn unit(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("test");
    if workspace.host {
        cargo.arg("--ignore-rust-version");
    } else {
        cargo.args(ALL).args(["--features", SUITE]);
    }
    // The tests of modioctl mostly wait.
    cargo.env("RUST_TEST_THREADS", threads(3).to_string());
    command::run(cargo.arg("--no-fail-fast"))
}

/// Returns this number of threads for each core.
fn threads(each: usize) -> usize {
    each * thread::available_parallelism().map_or(1, NonZero::get)
}

fn image(workspace: &mut Workspace, board: &'static Row) -> Result<()> {
    images::all(workspace, board).map(drop)
}

fn sim(workspace: &mut Workspace) -> Result<()> {
    // The image that runs alone, which is beside the others.
    build::image(workspace, &MODIO_02)?;
    let (boards, tests) = (IMAGES.map(|(board, _)| board), IMAGES.map(|(_, test)| test));
    let tests = format!("--bin=modio-sim --test=command {}", tests.join(" "));
    simulated::run(workspace, &boards, &tests, "", &[])
}

fn suite(workspace: &mut Workspace) -> Result<()> {
    simulated::run(workspace, &Row::ALL, "--test=suite", "", &[])
}

fn tool(workspace: &mut Workspace) -> Result<()> {
    // The simulators follow the wall clock, so the tests mostly wait.
    let threads = format!("--test-threads={}", threads(2));
    let boards = [&MODIO_02, &MODIO_08];
    let has_node = which::which("node").is_ok();
    let tests = match has_node {
        true => "--test=simulator --test=node_red",
        false => "--test=simulator",
    };
    simulated::run(workspace, &boards, tests, &threads, &[])?;
    ensure!(
        has_node,
        missing(
            "passed, but the functions of the Node-RED export were not run (on Debian: apt-get install nodejs)"
        )
    );
    Ok(())
}

fn sim_at(workspace: &mut Workspace, corner: &str, names: Names) -> Result<()> {
    let corner = [(simulated::CORNER, corner)];
    for ((board, test), names) in IMAGES.into_iter().zip(names) {
        simulated::run(workspace, &[board], test, names, &corner)?;
    }
    Ok(())
}

fn corners(workspace: &mut Workspace) -> Result<()> {
    sim_at(workspace, "slow", AT_CORNERS)?;
    sim_at(workspace, "fast", AT_CORNERS)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_yaml_ng::Value;

    use super::*;

    fn names(names: &[&str], command: In) -> Result<Vec<String>> {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let chosen = chosen(&names, command)?;
        Ok(chosen.into_iter().map(|step| step.name).collect())
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
        assert_eq!(
            names(&["bench"], Test).unwrap(),
            ["bench-02", "bench-08"],
            "without the boards"
        );
        let error = names(&["no-step"], Test).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
    }

    /// Returns the names of steps that the jobs of a workflow run.
    fn steps_of(workflow: &str) -> Vec<String> {
        let workflow: Value = serde_yaml_ng::from_str(workflow).unwrap();
        let jobs = workflow["jobs"].as_mapping().unwrap().values();
        let matrices = jobs.map(|job| &job["strategy"]["matrix"]);
        let lines = matrices.flat_map(|matrix| {
            let steps = matrix["steps"].as_sequence().into_iter().flatten();
            let jobs = matrix["include"].as_sequence().into_iter().flatten();
            let runs =
                jobs.filter_map(|job| job["run"].as_str()?.strip_prefix("cargo xtask test "));
            let lines: Vec<_> = steps.filter_map(Value::as_str).chain(runs).collect();
            lines
        });
        let words = lines.flat_map(str::split_whitespace);
        words.map(str::to_owned).collect()
    }

    #[test]
    fn workflows_run_every_step_under_a_unique_name() {
        let of_ci = steps_of(include_str!("../../.github/workflows/ci.yml"));
        let nightly = steps_of(include_str!("../../.github/workflows/nightly.yml"));
        let mut seen = BTreeSet::new();
        for step in all() {
            let names = if step.part_of == Night {
                &nightly
            } else {
                &of_ci
            };
            let name = &step.name;
            assert!(names.iter().any(|word| step.is(word)), "no job runs {name}");
            assert!(seen.insert(name.clone()), "{name} is the name of two steps");
        }
    }
}
