//! The firmware's image in the simulator, with every module, against the whole suite.

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
use conformance::line::LineFormat;
use conformance::probe::{Given, probe};
use conformance::report::table;
use conformance::run::{Options, Outcome, Verdict, run};
use register_map::board::{MODIO_02, MODIO_08};
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
    run(endpoint, &target, options, cases, |_| {}).expect("the line holds")
}

/// Runs every case in process on a modio-02; none may fail.
fn conforms(
    module: Module,
    dip: u8,
    line: LineFormat,
    mode: Mode,
    settings: &[(u16, u16)],
) -> Vec<Outcome> {
    fitting_conforms(&Fitting {
        elf: elf(&MODIO_02),
        board: &MODIO_02,
        module,
        slots: Vec::new(),
        dip,
        line,
        mode,
        settings: settings.to_vec(),
    })
}

/// Runs every case in process; none may fail.
fn fitting_conforms(fitting: &Fitting) -> Vec<Outcome> {
    let mut endpoint = start(fitting).expect("the image can be read");
    let outcomes = outcomes(&mut endpoint, fitting.dip, fitting.mode, &all());
    let failed: Vec<String> = outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)))
        .map(table::row)
        .collect();
    let modules = (fitting.module, &fitting.slots);
    assert!(failed.is_empty(), "{modules:?}:\n{}", failed.join("\n"));
    outcomes
}

/// The command modio-sim with this module in its slot, its line served by the exact-line protocol.
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
        // The rest is the firmware's log, which must not fill the pipe.
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

/// 9600 8N2, as the factory sets it: in process and through the exact line, with the same verdicts.
fn factory(module: Module) {
    let in_process = conforms(module, 1, LineFormat::default(), Mode::Rtu, &[]);
    let passed = in_process.iter().filter(|o| o.verdict == Verdict::Passed);
    let passed = passed.count();
    assert!(passed > 90, "{passed} cases apply to a {module}");
    let verdicts = |outcomes: Vec<Outcome>| -> Vec<(&str, Verdict)> {
        let each = outcomes.into_iter();
        each.map(|outcome| (outcome.case.name, outcome.verdict))
            .collect()
    };
    let exact_line = Simulator::start(module).outcomes(&all());
    assert_eq!(verdicts(exact_line), verdicts(in_process), "{module}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_same_run_on_an_exact_line_gives_the_same_report_to_the_byte() {
    let mut cases = all();
    cases.retain(|case| {
        ["fc03/", "gaps/", "timing/", "power/"]
            .iter()
            .any(|part| case.name.starts_with(part))
    });
    let report = || -> Vec<String> {
        let outcomes = Simulator::start(Module::Ai4).outcomes(&cases);
        outcomes.iter().map(table::row).collect()
    };
    let first = report();
    assert!(first.len() > 20, "{first:#?}");
    assert_eq!(report(), first);
}

macro_rules! with_each_module {
    ($($test:ident $module:ident,)+) => {
        $(#[test]
        #[ignore = "needs the image: cargo xtask test"]
        fn $test() {
            factory(Module::$module);
        })+
    };
}

with_each_module! {
    an_empty_slot_conforms None,
    a_4di_conforms Di4,
    a_4do_conforms Do4,
    a_2relay_conforms Relay2,
    a_4ai_conforms Ai4,
    a_4ao_conforms Ao4,
    a_2ai2ao_conforms Ai2Ao2,
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn with_parity_a_strict_t15_and_another_address_it_conforms() {
    let line = LineFormat::new(19_200, "8E1".parse().expect("a format"));
    let strict = [(configuration::STRICT_T15, 1)];
    conforms(Module::Do4, 247, line, Mode::Rtu, &strict);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_9600_without_parity_it_conforms() {
    let line = LineFormat::new(9600, "8N1".parse().expect("a format"));
    conforms(Module::Do4, 1, line, Mode::Rtu, &[]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_115200_without_parity_it_conforms() {
    let line = LineFormat::new(115_200, "8N1".parse().expect("a format"));
    conforms(Module::Ao4, 9, line, Mode::Rtu, &[]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn in_ascii_it_conforms() {
    conforms(Module::Do4, 1, LineFormat::default(), Mode::Ascii, &[]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn in_ascii_with_seven_data_bits_and_even_parity_it_conforms() {
    let line = LineFormat::new(19_200, "7E1".parse().expect("a format"));
    conforms(Module::Relay2, 1, line, Mode::Ascii, &[]);
}

/// Every case on a modio-08 with these modules in its slots, port 1 first.
fn modio_08_conforms(modules: [Module; 4], mode: Mode) {
    let outcomes = fitting_conforms(&Fitting {
        elf: elf(&MODIO_08),
        board: &MODIO_08,
        module: Module::None,
        slots: (1..).zip(modules).collect(),
        dip: 1,
        line: LineFormat::default(),
        mode,
        settings: Vec::new(),
    });
    let passed = outcomes.iter().filter(|o| o.verdict == Verdict::Passed);
    let passed = passed.count();
    let least = if mode == Mode::Rtu { 150 } else { 90 };
    assert!(passed > least, "{passed} cases apply to {modules:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_08_with_four_different_modules_conforms() {
    let modules = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
    modio_08_conforms(modules, Mode::Rtu);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_08_with_empty_slots_between_modules_conforms() {
    let modules = [Module::None, Module::Relay2, Module::None, Module::Ai2Ao2];
    modio_08_conforms(modules, Mode::Rtu);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_08_with_sixteen_analog_outputs_conforms() {
    modio_08_conforms([Module::Ao4; 4], Mode::Rtu);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_modio_08_conforms_in_ascii() {
    let modules = [Module::Do4, Module::Do4, Module::Di4, Module::Di4];
    modio_08_conforms(modules, Mode::Ascii);
}
