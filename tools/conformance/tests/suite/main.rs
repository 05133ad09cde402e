//! Runs the whole suite on the firmware's image in the simulator, with every module.

#![cfg(feature = "sim")]

mod matrix;

use std::env;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use conformance::case::Case;
use conformance::cases::all;
use conformance::cli::waits;
use conformance::endpoint::Endpoint;
use conformance::endpoint::exact_line::Tcp;
use conformance::endpoint::sim::{Fitting, start};
use conformance::frame::Mode;
use conformance::probe::{Given, probe};
use conformance::report::table;
use conformance::run::{Options, Outcome, Verdict, run};
use modbus_line::LineFormat;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use register_map::board::{MODIO_02, MODIO_08};
use register_map::points::Kind;
use register_map::{Board, Module, configuration};

/// The image of a board.
fn elf(board: &Board) -> PathBuf {
    let name = if *board == MODIO_02 {
        "MODIO_ELF"
    } else {
        "MODIO_ELF_08"
    };
    let elf = env::var_os(name);
    PathBuf::from(elf.unwrap_or_else(|| panic!("{name}: cargo xtask test sets it")))
}

/// A modio-02 with this module and the factory settings.
fn modio_02(module: Module) -> Fitting {
    Fitting {
        module,
        ..Fitting::new(elf(&MODIO_02), &MODIO_02)
    }
}

/// A modio-08 with these modules in its slots, port 1 first.
fn modio_08(modules: [Module; 4], mode: Mode) -> Fitting {
    Fitting {
        slots: (1..).zip(modules).collect(),
        mode,
        ..Fitting::new(elf(&MODIO_08), &MODIO_08)
    }
}

/// The rate and format of a line.
fn line(baud: u32, format: &str) -> LineFormat {
    LineFormat::new(baud, format.parse().expect("a format"))
}

/// Runs these cases against the unit at `dip`.
fn outcomes(endpoint: &mut dyn Endpoint, dip: u8, mode: Mode, cases: &[Case]) -> Vec<Outcome> {
    let given = Given {
        unit: dip,
        mode,
        patience: waits(endpoint, None),
        profile: None,
        allow_config: true,
    };
    let (target, patience) = probe(endpoint, &given).expect("the unit answers");
    let options = Options {
        patience,
        allow_config: true,
    };
    run(endpoint, &target, options, cases, |_| {}).expect("the endpoint works")
}

/// Runs these cases in process.
fn in_process(fitting: &Fitting, cases: &[Case]) -> Vec<Outcome> {
    let mut endpoint = start(fitting).expect("the image can be read");
    outcomes(&mut endpoint, fitting.dip, fitting.mode, cases)
}

/// A row for each case that failed.
fn failed(outcomes: &[Outcome]) -> Vec<String> {
    let failed = outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)));
    failed.map(table::row).collect()
}

/// Number of cases that passed.
fn passed(outcomes: &[Outcome]) -> usize {
    let passed = outcomes.iter().filter(|o| o.verdict == Verdict::Passed);
    passed.count()
}

/// Runs every case in process. No case may fail, and more than `least` have to pass.
fn conforms(fitting: &Fitting, least: usize) {
    assert_conforms(&in_process(fitting, &all()), &format!("{fitting:?}"), least);
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
        let mut child = Command::new(program)
            .arg("--elf")
            .arg(elf(&MODIO_02))
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
        outcomes(&mut endpoint, 1, Mode::Rtu, cases)
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

/// Runs these cases in process and through the exact line. Both must give the same verdicts, and no case may fail.
fn conforms_on_an_exact_line(module: Module, cases: &[Case], least: usize) {
    let verdicts = |outcomes: Vec<Outcome>| -> Vec<(&str, Verdict)> {
        let each = outcomes.into_iter();
        each.map(|outcome| (outcome.case.name, outcome.verdict))
            .collect()
    };
    let in_process = in_process(&modio_02(module), cases);
    assert_conforms(&in_process, module.name(), least);
    let exact_line = Simulator::start(module).outcomes(cases);
    assert_eq!(verdicts(exact_line), verdicts(in_process), "{module}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_4do_conforms_in_process_and_on_an_exact_line() {
    conforms_on_an_exact_line(Module::Do4, &all(), 200);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn cases_about_the_module_pass_on_an_exact_line_with_every_module() {
    let cases = named(&[
        "fc02/same-as-01",
        "fc04/same-as-03",
        "files/self-description",
        "outputs/inputs-take-no-writes",
    ]);
    for module in Module::ALL.into_iter().filter(|m| *m != Module::Do4) {
        conforms_on_an_exact_line(module, &cases, 1);
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

/// Returns a number for a modio-02 with this module: more cases than that have to pass.
fn least(module: Module) -> usize {
    if module.points().contains(&Kind::BitOutput) {
        200
    } else {
        180
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_02_conforms_with_every_module() {
    let modules = Module::ALL.into_par_iter();
    modules.for_each(|module| conforms(&modio_02(module), least(module)));
}

macro_rules! boards_conform {
    ($($test:ident: $fitting:expr, $least:literal;)+) => {
        $(#[test]
        #[ignore = "needs the image: cargo xtask test"]
        fn $test() {
            conforms(&$fitting, $least);
        })+
    };
}

// Each board, and a number: more cases than that have to pass.
boards_conform! {
    with_parity_a_strict_t15_and_another_address_it_conforms: Fitting {
        dip: 247,
        line: line(19_200, "8E1"),
        settings: vec![(configuration::STRICT_T15, 1)],
        ..modio_02(Module::Do4)
    }, 200;
    at_9600_without_parity_it_conforms: Fitting {
        line: line(9600, "8N1"),
        ..modio_02(Module::Do4)
    }, 200;
    at_115200_without_parity_it_conforms: Fitting {
        dip: 9,
        line: line(115_200, "8N1"),
        ..modio_02(Module::Ao4)
    }, 180;
    in_ascii_it_conforms: Fitting { mode: Mode::Ascii, ..modio_02(Module::Do4) }, 150;
    in_ascii_with_seven_data_bits_and_even_parity_it_conforms: Fitting {
        line: line(19_200, "7E1"),
        mode: Mode::Ascii,
        ..modio_02(Module::Relay2)
    }, 150;
    a_modio_08_with_four_different_modules_conforms:
        modio_08([Module::Di4, Module::Do4, Module::Ai4, Module::Ao4], Mode::Rtu), 200;
    a_modio_08_with_empty_slots_between_modules_conforms:
        modio_08([Module::None, Module::Relay2, Module::None, Module::Ai2Ao2], Mode::Rtu), 200;
    a_modio_08_with_sixteen_analog_outputs_conforms: modio_08([Module::Ao4; 4], Mode::Rtu), 180;
    a_modio_08_conforms_in_ascii:
        modio_08([Module::Do4, Module::Do4, Module::Di4, Module::Di4], Mode::Ascii), 150;
}
