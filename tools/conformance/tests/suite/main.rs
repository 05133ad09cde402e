//! Runs the suite on the loader and the image in the simulator: every case on every board, and the cases about points
//! with every module.

#![cfg(feature = "sim")]

mod each_rate;
mod matrix;
mod noise;
mod wires;

use std::env;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use conformance::case::{Case, Need, case};
use conformance::cases::all;
use conformance::cli::waits;
use conformance::endpoint::Endpoint;
use conformance::endpoint::exact_line::Tcp;
use conformance::endpoint::sim::{Fitting, start};
use conformance::frame::Mode;
use conformance::probe::{Given, probe};
use conformance::report::table;
use conformance::run::{Outcome, Verdict, run};
use conformance::target::Target;
use conformance::tester::Tester;
use modbus_line::LineFormat;
use rayon::iter::{IntoParallelIterator as _, ParallelBridge as _, ParallelIterator as _};
use register_map::board::{MODIO_02, MODIO_08};
use register_map::{Module, Row, configuration, state};

/// Returns the directory with the loader and the images of a board. `cargo xtask test` sets the variables.
fn images(board: &Row) -> PathBuf {
    let variable = format!(
        "MODIO_IMAGES_{}",
        board.name.to_uppercase().replace('-', "_")
    );
    let directory = env::var_os(&variable);
    PathBuf::from(directory.unwrap_or_else(|| panic!("{variable}: cargo xtask test sets it")))
}

/// Returns a board as a user gets it, with the loader and an image in slot A.
fn of(board: &'static Row) -> Fitting {
    let [loader, image] = files(board);
    Fitting::new(loader, image, board)
}

/// Returns the loader of a board, and its image.
fn files(board: &Row) -> [PathBuf; 2] {
    ["loader", "modio-a.image"].map(|name| images(board).join(name))
}

fn modio_02(module: Module) -> Fitting {
    Fitting {
        module,
        ..of(&MODIO_02)
    }
}

/// Returns the board with slots on which the tests run that need another module each time: the modio-02, or that of the
/// variable `MODIO_BOARD`.
fn with_slots() -> &'static Row {
    let named = env::var("MODIO_BOARD");
    named.map_or(&MODIO_02, |name| name.parse().expect("a board"))
}

/// Returns all boards but the modio-02, on which the tests of modules, rates and modes run.
fn others() -> impl Iterator<Item = &'static Row> + Send {
    Row::ALL.into_iter().filter(|board| **board != MODIO_02)
}

/// A board with another module in each slot, if it has slots.
fn with_different_modules(board: &'static Row) -> Fitting {
    let modules = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
    let ports = board.ports().filter(|_| board.fixed.is_empty());
    let ports = ports.map(|port| port as u8);
    Fitting {
        slots: ports.zip(modules.into_iter().cycle()).collect(),
        ..of(board)
    }
}

/// A modio-08 with these modules in its slots, port 1 first.
fn modio_08(modules: [Module; 4]) -> Fitting {
    Fitting {
        slots: (1..).zip(modules).collect(),
        ..of(&MODIO_08)
    }
}

fn line(baud: u32, format: &str) -> LineFormat {
    LineFormat::new(baud, format.parse().expect("a format"))
}

/// Asks the unit at `dip` what it has.
fn probed(endpoint: &mut dyn Endpoint, dip: u8, mode: Mode) -> Target {
    let given = Given {
        unit: dip,
        mode,
        patience: waits(endpoint, None),
        profile: None,
        allow_config: true,
    };
    probe(endpoint, &given).expect("the unit answers")
}

/// The unit answers with the code, the name and the model of this board.
fn assert_is(board: &'static Row, endpoint: &mut dyn Endpoint, target: &Target) {
    let found = target.modio.and_then(|modio| modio.board);
    assert_eq!(found, Some(board), "register BOARD");
    let mut tester = Tester::new(endpoint, target);
    for (object, text) in [(4, board.name), (5, board.model)] {
        let reply = tester.reply(&[0x2B, 0x0E, 4, object]).expect("a reply");
        assert_eq!(reply.get(9..), Some(text.as_bytes()), "object {object}");
    }
}

/// Runs these cases against the unit.
fn outcomes(endpoint: &mut dyn Endpoint, target: &Target, cases: &[Case]) -> Vec<Outcome> {
    // A restart begins the count of the free stack anew, so the cases that restart the unit are last.
    let restarts = |case: &&Case| {
        let mut needs = case.needs.iter();
        needs.any(|need| matches!(need, Need::Power | Need::SetLine))
    };
    let (last, first): (Vec<&Case>, Vec<&Case>) = cases.iter().partition(restarts);
    let cases = first.into_iter().chain([&STACK]).chain(last);
    let cases: Vec<Case> = cases.copied().collect();
    run(endpoint, target, &cases).expect("the endpoint works")
}

/// At least a KiB of the stack was never used since the start.
const STACK: Case = case(
    "modio/stack",
    "map, 0x020B",
    "at least 1024 bytes of the stack are free",
    &[Need::Modio],
    |tester| {
        // The unit checks a part of the stack at a time.
        tester.rest(Duration::from_secs(1))?;
        let free = tester.read_word(state::STACK_FREE)?;
        tester.ensure(free >= 1024, format!("{free} bytes of the stack are free"))
    },
);

fn in_process(fitting: &Fitting, cases: &[Case]) -> Vec<Outcome> {
    let mut endpoint = start(fitting).expect("the image can be read");
    let target = probed(&mut endpoint, fitting.dip, fitting.mode);
    assert_is(fitting.board, &mut endpoint, &target);
    outcomes(&mut endpoint, &target, cases)
}

/// A row for each case that failed.
fn failed(outcomes: &[Outcome]) -> Vec<String> {
    let failed = outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)));
    failed.map(table::row).collect()
}

fn passed(outcomes: &[Outcome]) -> usize {
    let passed = outcomes.iter().filter(|o| o.verdict == Verdict::Passed);
    passed.count()
}

/// Runs these cases in process. No case may fail, and more than `least` have to pass.
fn conforms(fitting: &Fitting, cases: &[Case], least: usize) {
    assert_conforms(&in_process(fitting, cases), &format!("{fitting:?}"), least);
}

fn assert_conforms(outcomes: &[Outcome], unit: &str, least: usize) {
    let failed = failed(outcomes);
    assert!(failed.is_empty(), "{unit}:\n{}", failed.join("\n"));
    let passed = passed(outcomes);
    assert!(passed > least, "{passed} cases passed on {unit}");
}

/// The program modio-sim with this module in its slot and its line on the exact-line protocol.
struct Simulator {
    child: Child,
    address: String,
}

impl Simulator {
    fn start(module: Module) -> Self {
        let program =
            env::var_os("MODIO_SIM").expect("MODIO_SIM names the simulator: cargo xtask test");
        let [loader, image] = files(&MODIO_02);
        let mut child = Command::new(program)
            .arg("--loader")
            .arg(loader)
            .arg("--image")
            .arg(image)
            .args(["--module", module.name(), "--http", "127.0.0.1:0"])
            .args(["--exact-line", "127.0.0.1:0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("the simulator can be started");
        let stdout = child.stdout.take().expect("it is a pipe");
        let mut lines = BufReader::new(stdout).lines();
        let first = lines.next().expect("a line").expect("text");
        let address = first
            .strip_prefix("exact-line: ")
            .expect("its address")
            .to_owned();
        // The other lines are the firmware's log. Without a reader the log would fill the pipe and stop the simulator.
        std::thread::spawn(move || lines.for_each(drop));
        Self { child, address }
    }

    fn outcomes(&self, cases: &[Case]) -> Vec<Outcome> {
        let mut endpoint = Tcp::connect(&self.address).expect("the simulator listens");
        let target = probed(&mut endpoint, 1, Mode::Rtu);
        outcomes(&mut endpoint, &target, cases)
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The cases whose names begin with one of these texts.
fn named(beginnings: &[&str]) -> Vec<Case> {
    let mut cases = all();
    cases.retain(|case| beginnings.iter().any(|text| case.name.starts_with(text)));
    cases
}

/// No case may depend on what ran before it, and none on the way to the unit.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4do_conforms_in_process_and_with_the_same_verdicts_in_reverse_order_on_an_exact_line() {
    let in_process = in_process(&modio_02(Module::Do4), &all());
    assert_conforms(&in_process, "4do", 200);
    let mut reversed = all();
    reversed.retain(|case| !matrix::LONG.contains(&case.name));
    reversed.reverse();
    let exact_line = Simulator::start(Module::Do4).outcomes(&reversed);
    assert!(exact_line.len() > 220, "{} cases", exact_line.len());
    let verdict = |case: &Case| {
        let mut same = in_process
            .iter()
            .filter(|other| other.case.name == case.name);
        same.next().map(|outcome| &outcome.verdict)
    };
    for outcome in &exact_line {
        let row = table::row(outcome);
        assert_eq!(Some(&outcome.verdict), verdict(&outcome.case), "{row}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn two_runs_on_an_exact_line_give_the_same_report_to_the_byte() {
    let cases = named(&["fc03/", "gaps/", "timing/", "power/"]);
    let report = || -> Vec<String> {
        let outcomes = Simulator::start(Module::Ai4).outcomes(&cases);
        outcomes.iter().map(table::row).collect()
    };
    let first = report();
    assert!(first.len() > 20, "{first:#?}");
    assert_eq!(report(), first);
}

/// The beginnings of the names of cases that depend on the points of the board.
const OF_POINTS: [&str; 14] = [
    "fc01/",
    "fc02/",
    "fc03/",
    "fc04/",
    "fc05/",
    "fc06/",
    "fc0f/",
    "fc10/",
    "fc16/",
    "fc17/",
    "files/",
    "outputs/",
    "config/",
    "hurts/torn-values",
];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_board_conforms_with_every_module() {
    let (board, cases) = (of(with_slots()), named(&OF_POINTS));
    Module::ALL.into_par_iter().for_each(|module| {
        let fitting = Fitting {
            module,
            ..board.clone()
        };
        conforms(&fitting, &cases, 40);
    });
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_other_board_conforms() {
    // A board with digital inputs alone skips the cases that write outputs.
    others()
        .par_bridge()
        .for_each(|board| conforms(&with_different_modules(board), &all(), 190));
}

macro_rules! boards_conform {
    ($($test:ident: $fitting:expr, $cases:expr, $least:literal;)+) => {
        $(#[test]
        #[ignore = "needs the image: cargo xtask test"]
        fn $test() {
            conforms(&$fitting, &$cases, $least);
        })+
    };
}

// A fitting, the cases, and a number: more cases than that have to pass. The matrix has the other rates and formats, and
// `cargo xtask matrix` runs every case with every module.
boards_conform! {
    with_parity_a_strict_t15_and_another_address_it_conforms: Fitting {
        dip: 247,
        line: line(19_200, "8E1"),
        settings: vec![(configuration::STRICT_T15, 1)],
        ..modio_02(Module::Do4)
    }, all(), 200;
    in_ascii_it_conforms: Fitting { mode: Mode::Ascii, ..modio_02(Module::Do4) }, all(), 150;
    a_modio_08_with_empty_slots_between_modules_conforms:
        modio_08([Module::None, Module::Relay2, Module::None, Module::Ai2Ao2]), named(&OF_POINTS), 40;
    a_modio_08_with_sixteen_analog_outputs_conforms: modio_08([Module::Ao4; 4]), named(&OF_POINTS), 40;
}
