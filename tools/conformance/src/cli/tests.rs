//! The options, alone and with a bench file.

use super::*;
use clap::CommandFactory;

fn parse(arguments: &str) -> Cli {
    Cli::try_parse_from(format!("x {arguments}").split_whitespace()).unwrap()
}

#[test]
fn the_options_are_consistent() {
    Cli::command().debug_assert();
    let right = "hil --port a --flash --probe b --elf c --rates 9600,115200 --no-suite";
    assert!(parse(right).serial.is_some());
    for wrong in [
        "--serial a --tcp b",
        "--port a --exact-line b",
        "--format 8X1",
        "--unit 0",
        "hal",
        "--rates 9601",
        "--rates ,",
        "--module 5do",
        "--probe b",
        "--elf c",
        "--exact-line a --flash",
        "--exact-line a --reset-cmd b",
        "--exact-line a --update b",
        "--exact-line a --power-cmd b",
        #[cfg(feature = "sim")]
        "--sim a --flash",
        #[cfg(feature = "sim")]
        "--sim a --reset-cmd b",
        #[cfg(feature = "sim")]
        "--sim a --update b",
        #[cfg(feature = "sim")]
        "--sim a --power-cmd b",
    ] {
        let arguments = ["x"].into_iter().chain(wrong.split(' '));
        assert!(Cli::try_parse_from(arguments).is_err(), "{wrong}");
    }
}

#[test]
fn every_option_is_in_the_manual() {
    let manual = [
        include_str!("../../../../docs/conformance.md"),
        include_str!("../../../../docs/hil.md"),
    ]
    .concat();
    let command = Cli::command();
    let options = command.get_arguments().filter_map(clap::Arg::get_long);
    let missing: Vec<&str> = options
        .filter(|name| !manual.contains(&format!("`--{name}")))
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Returns the arguments with this bench file.
fn with_file(file: &str, arguments: &str) -> Result<Cli, String> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bench.toml");
    std::fs::write(&path, file).unwrap();
    let cli = parse(&format!("hil --bench {} {arguments}", path.display()));
    cli.with_bench_file().map_err(|error| format!("{error:#}"))
}

const FILE: &str = "port = \"/dev/a\"\nprobe = \"1:2\"\nunit = 7\nbaud = 19200\nformat = \"8E1\"\n\
                    module = \"4ao\"\nreset_cmd = \"r\"\npower_cmd = \"p\"\n";

#[test]
fn option_takes_precedence_over_the_bench_file() {
    let shown = |cli: &Cli| {
        let port = cli.serial.as_ref().map(|port| port.display().to_string());
        let texts = [
            &port,
            &cli.on_bench.probe,
            &cli.on_bench.reset_cmd,
            &cli.on_bench.power_cmd,
        ];
        let texts = texts.map(|text| text.clone().unwrap_or_default()).join(" ");
        let (line, unit, module) = (cli.line(), cli.unit(None), cli.module.unwrap());
        format!("{texts} {line} {unit} {module}")
    };
    let cli = with_file(FILE, "").unwrap();
    assert_eq!(shown(&cli), "/dev/a 1:2 r p 19200 8E1 7 4ao");
    assert!(!cli.on_bench.flash, "without --flash nothing is written");
    assert_eq!(cli.of_bench().requests, 2000);
    let all = "--port /dev/b --flash --probe 3:4 --unit 9 --baud 9600 --format 8N1 --module 4di --reset-cmd s \
               --power-cmd q";
    let cli = with_file(FILE, all).unwrap();
    assert_eq!(shown(&cli), "/dev/b 3:4 s q 9600 8N1 9 4di");
    assert_eq!(with_file(FILE, "--tcp b:1").unwrap().serial, None);
    assert_eq!(parse("--port a").of_bench().requests, 0);
    let exact = with_file(FILE, "--exact-line b:1").unwrap().on_bench;
    assert_eq!((exact.reset_cmd, exact.power_cmd), (None, None));
}

#[test]
fn modioctl_gets_port_line_and_unit() {
    let reached = |arguments: &str| parse(arguments).reached().unwrap().join(" ");
    let serial = "--port /dev/b --baud 19200 --format 8E1 --unit 9";
    assert_eq!(reached(serial), serial);
    let tcp = "--tcp a:1 --baud 9600 --format 8N2 --unit 1";
    assert_eq!(reached("--tcp a:1"), tcp);
    assert!(parse("").reached().is_err());
}

#[test]
fn mistake_in_a_bench_file_is_one_line_that_names_the_file_and_the_line() {
    let error = with_file("unit = 1\nprot = \"x\"", "").unwrap_err();
    let named = error.contains("bench.toml:2: unknown field `prot`");
    assert!(named && !error.contains('\n'), "{error}");
    let error = with_file(FILE, "--no-suite --requests 0").unwrap_err();
    assert!(error.starts_with("nothing to test: "), "{error}");
    let missing = parse("--bench /nowhere/b.toml").with_bench_file();
    let error = format!("{:#}", missing.unwrap_err());
    assert!(error.starts_with("/nowhere/b.toml: "), "{error}");
}

const WIRE: &str = "[[wire]]\nfrom = { point = 0x10 }\nto = { unit = 2, point = 0x10 }\n";

#[test]
fn cases_that_all_lack_something_of_the_bench_are_an_error_that_says_what() {
    for (file, arguments, reason) in [
        (
            WIRE,
            "--only pulses --requests 0",
            "no [[wire]] with pulses",
        ),
        ("", "--only wires", "no [[wire]] in a bench file: --bench"),
        (
            "",
            "--only timing --requests 0",
            "measures with --requests only",
        ),
        (
            "",
            "--only timing --rates all --requests 0",
            "need requests: --requests N",
        ),
        ("", "--limit 9 --requests 0", "need requests: --requests N"),
        (
            WIRE,
            "--only wires --rates 9600",
            "and the case timing/each-rate",
        ),
    ] {
        let error = with_file(file, arguments).unwrap_err();
        let right = error.contains(reason) && !error.contains('\n');
        assert!(right, "{arguments}: {error}");
    }
    for arguments in [
        "--only wires",
        "--only wires --only pulses",
        "--only timing",
    ] {
        with_file(WIRE, arguments).unwrap();
    }
    let exact = "--exact-line b:1 --only timing --requests 0";
    with_file("", exact).unwrap();
    let without_hil = |arguments: &str| parse(arguments).with_bench_file().err();
    for ignored in ["--rates 9600", "--limit 9"] {
        let error = without_hil(ignored).unwrap().to_string();
        assert!(error.contains("--requests N"), "{error}");
        assert!(without_hil(&format!("{ignored} --requests 5")).is_none());
    }
}

#[test]
fn missing_endpoint_is_an_error_that_names_the_options() {
    let text = parse("").open(Mode::Rtu).err().unwrap().to_string();
    let both = text.contains("--serial") && text.contains("--tcp");
    assert!(both, "{text}");
    let wrong = parse("--format 7E1").open(Mode::Rtu).err().unwrap();
    assert!(wrong.to_string().contains("--ascii"), "{wrong}");
}

#[test]
fn cases_are_chosen_by_parts_of_their_names() {
    let all = parse("").cases().unwrap().len();
    let of_bench = parse("--no-suite").cases().unwrap();
    assert_eq!(of_bench.len(), cases::of_bench().len());
    let some = parse("--only fc05/ --only ascii/").cases().unwrap();
    assert!(some.len() > 10 && some.len() < all);
    assert!(parse("--only no-such-case").cases().is_err());
    let fewer = parse("--only fc05/ --exclude length --exclude value");
    let names: Vec<_> = fewer.cases().unwrap().iter().map(|c| c.name).collect();
    assert_eq!(names, ["fc05/on-and-off", "fc05/address"]);
    assert!(parse("--exclude /").cases().is_err());
    let standard = parse("--standard-only --only fc05/ --only config/");
    let names: Vec<_> = standard.cases().unwrap().iter().map(|c| c.name).collect();
    assert!(names.contains(&"fc05/value") && !names.contains(&"fc05/length"));
    assert!(names.iter().all(|name| name.starts_with("fc05/")));
}

#[test]
fn unit_is_that_of_the_option_then_of_the_profile_then_1() {
    assert_eq!(parse("").unit(None), 1);
    assert_eq!(parse("--unit 9").unit(None), 9);
    let profile = Profile::parse("unit = 17").unwrap();
    assert_eq!(parse("").unit(Some(&profile)), 17);
    assert_eq!(parse("--unit 9").unit(Some(&profile)), 9);
}
