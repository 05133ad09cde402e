//! The firmware's image in the simulator, with every module, against the whole suite.

#![cfg(feature = "sim")]

use std::env;
use std::path::PathBuf;

use conformance::cases::all;
use conformance::cli::waits;
use conformance::endpoint::sim::{Fitting, start};
use conformance::frame::Mode;
use conformance::line::LineFormat;
use conformance::probe::{Given, probe};
use conformance::report::table;
use conformance::run::{Options, Verdict, run};
use register_map::{Module, configuration};

/// Runs every case; tells how many have passed.
fn conforms(
    module: Module,
    dip: u8,
    line: LineFormat,
    mode: Mode,
    settings: &[(u16, u16)],
) -> usize {
    let elf = env::var_os("MODIO_ELF").expect("MODIO_ELF names the image: cargo xtask test");
    let fitting = Fitting {
        elf: PathBuf::from(elf),
        module,
        dip,
        line,
        mode,
        settings: settings.to_vec(),
    };
    let mut endpoint = start(&fitting).expect("the image can be read");
    let given = Given {
        unit: dip,
        mode,
        patience: waits(&endpoint, None),
        profile: None,
        allow_config: true,
    };
    let (target, patience) = probe(&mut endpoint, &given).expect("the unit answers");
    let options = Options {
        patience,
        allow_config: true,
    };
    let outcomes = run(&mut endpoint, &target, options, &all(), |_| {}).expect("the line holds");
    let failed: Vec<String> = outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)))
        .map(table::row)
        .collect();
    assert!(failed.is_empty(), "{module}:\n{}", failed.join("\n"));
    outcomes
        .iter()
        .filter(|o| o.verdict == Verdict::Passed)
        .count()
}

/// 9600 8N2, as the factory sets it.
fn factory(module: Module) {
    let passed = conforms(module, 1, LineFormat::default(), Mode::Rtu, &[]);
    assert!(passed > 90, "{passed} cases apply to a {module}");
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
fn at_115200_without_parity_it_conforms() {
    let line = LineFormat::new(115_200, "8N1".parse().expect("a format"));
    conforms(Module::Ao4, 9, line, Mode::Rtu, &[]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn in_ascii_it_conforms() {
    conforms(Module::Do4, 1, LineFormat::default(), Mode::Ascii, &[]);
}
