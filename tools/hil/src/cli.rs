//! The command line of `modio-hil`, and of `cargo xtask hil`, which passes its arguments on.

use std::path::PathBuf;

use clap::Parser;
use modbus_line::Format;
use register_map::Module;
use register_map::codes::Baud;

use conformance::program::Files;

/// Tests a modio on a bench: the conformance suite, the turnaround and lost frames at each rate, and the wires from
/// outputs to inputs.
///
/// Leaves the unit as it was, also after Ctrl-C. Exit status: 0 all tests passed, 1 a test failed, 2 nothing could
/// be tested, 130 interrupted.
#[derive(Clone, Debug, Parser)]
#[command(name = "modio-hil")]
pub struct Cli {
    /// The bench file: port, probe, unit, line, module, commands and wires in TOML (docs/hil.md). An option takes
    /// precedence over its key
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,

    /// The serial port
    #[arg(long, value_name = "PORT")]
    pub port: Option<PathBuf>,

    /// Raw bytes over TCP instead of a serial port: a serial device server
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "port")]
    pub tcp: Option<String>,

    /// Write the image into the board first, by `cargo xtask flash`
    #[arg(long)]
    pub flash: bool,

    /// The debug probe, when there are several: VID:PID or VID:PID:SERIAL, as `probe-rs list` shows it
    #[arg(long, value_name = "SELECTOR", requires = "flash")]
    pub probe: Option<String>,

    /// Write this image instead of building one
    #[arg(long, value_name = "FILE", requires = "flash")]
    pub elf: Option<PathBuf>,

    /// Update the unit over the line first, by `modioctl update`, with this .modio file
    #[arg(long, value_name = "FILE")]
    pub update: Option<PathBuf>,

    /// Run this in a shell before the tests, to reset the board or to switch it on
    #[arg(long, value_name = "CMD")]
    pub reset_cmd: Option<String>,

    /// Run this in a shell, followed by ` off` or ` on`, to switch the unit's power; without it the cases that
    /// switch the power are skipped
    #[arg(long, value_name = "CMD")]
    pub power_cmd: Option<String>,

    /// The unit's address [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub unit: Option<u8>,

    /// The line's rate in bit/s [default: 9600]
    #[arg(long, value_name = "RATE", value_parser = clap::value_parser!(u32).range(modbus_line::RATES))]
    pub baud: Option<u32>,

    /// The line's format: 8N2, 8E1, 8O1 or 8N1 [default: 8N2]
    #[arg(long, value_name = "FORMAT")]
    pub format: Option<Format>,

    /// The module that must be in the unit's first slot [default: any]
    #[arg(long, value_name = "NAME")]
    pub module: Option<Module>,

    /// Run also the cases that write the unit's configuration; they restore it
    #[arg(long)]
    pub allow_config: bool,

    /// Run only cases whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub only: Vec<String>,

    /// Leave the conformance suite out
    #[arg(long, conflicts_with = "only")]
    pub no_suite: bool,

    /// Requests at each rate for the timing; 0 leaves it out
    #[arg(long, value_name = "N", default_value_t = 2000)]
    pub requests: u32,

    /// Measure at these rates, such as 9600,115200, or `all`; the unit's configuration is saved at each
    /// rate and restored [default: the present rate]
    #[arg(long, value_name = "LIST", value_parser = rates)]
    pub rates: Option<List<u32>>,

    /// Fail when more than one turnaround in a hundred is longer than this
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub limit: Option<u64>,

    /// Time to wait, in ms, before a unit that must not reply counts as silent [default: 250]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub patience: Option<u64>,

    /// Files for the results
    #[command(flatten)]
    pub reports: Files,
}

/// A list in one argument. The parser takes a `Vec` for several arguments.
pub type List<T> = Vec<T>;

fn rates(text: &str) -> Result<List<u32>, String> {
    let known = || Baud::ALL.iter().map(|baud| baud.bits_per_second());
    if text == "all" {
        return Ok(known().collect());
    }
    let one = |part: &str| {
        let rate = part.trim().parse().ok();
        let rate = rate.filter(|rate| known().any(|other| other == *rate));
        rate.ok_or_else(|| {
            let all: Vec<String> = known().map(|rate| rate.to_string()).collect();
            let all = all.join(" ");
            format!("{part:?} is not a rate of the device; use one of {all}")
        })
    };
    text.split(',').map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(arguments: &[&str]) -> Result<Cli, clap::Error> {
        Cli::try_parse_from([&["x"], arguments].concat())
    }

    #[test]
    fn the_options_are_consistent() {
        Cli::command().debug_assert();
        assert!(parse(&["--port", "a", "--flash", "--probe", "b", "--elf", "c"]).is_ok());
        for wrong in [
            &["--port", "a", "--tcp", "b"][..],
            &["--port", "a", "--unit", "0"],
            &["--port", "a", "--rates", "9601"],
            &["--port", "a", "--rates", ""],
            &["--port", "a", "--module", "5do"],
            &["--port", "a", "--no-suite", "--only", "x"],
            &["--port", "a", "--probe", "b"],
            &["--port", "a", "--elf", "c"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn every_option_is_in_the_manual() {
        let manual = include_str!("../../../docs/hil.md");
        let command = Cli::command();
        let options = command.get_arguments().filter_map(clap::Arg::get_long);
        let missing: Vec<&str> = options
            .filter(|name| !manual.contains(&format!("`--{name}")))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn rates_are_those_of_the_device() {
        assert_eq!(rates("9600, 115200"), Ok(vec![9600, 115_200]));
        assert_eq!(rates("all").unwrap().len(), Baud::ALL.len());
        let text = rates("9600,300").unwrap_err();
        assert!(
            text.starts_with("\"300\" is not a rate of the device; use one of 1200 "),
            "{text}"
        );
    }
}
