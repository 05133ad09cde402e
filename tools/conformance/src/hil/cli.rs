//! The command line of `modio-hil`, and of `cargo xtask hil`, which passes everything on to it.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Parser;
use register_map::Module;
use register_map::codes::Baud;

use crate::case::Case;
use crate::cli::waits;
use crate::endpoint::stream::Stream;
use crate::endpoint::{Broken, Endpoint};
use crate::hil::Plan;
use crate::hil::bench_file::BenchFile;
use crate::hil::shell::{Flash, Powered};
use crate::line::{CharacterFormat, LineFormat};
use crate::program::Files;

/// Tests a modio on a bench: the conformance suite, how soon and how surely it answers at each rate, and
/// the wires from outputs to inputs.
///
/// Leaves the unit as it was, also after Ctrl-C. Exit status: 0 all is well, 1 something failed, 2 it could
/// not be tested, 130 interrupted.
#[derive(Clone, Debug, Parser)]
#[command(name = "modio-hil", version)]
pub struct Cli {
    /// The bench file: port, probe, unit, line, module, commands and wires in TOML (docs/hil.md). An option takes
    /// precedence over its key
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,

    /// The serial port
    #[arg(long, value_name = "PORT")]
    pub port: Option<PathBuf>,

    /// Raw bytes over TCP in its place: a serial device server
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

    /// Run this in a shell before the tests, to reset the board or to switch it on
    #[arg(long, value_name = "CMD")]
    pub reset_cmd: Option<String>,

    /// Run this in a shell, followed by ` off` or ` on`, to switch the unit's power; without it the cases that need
    /// that are skipped
    #[arg(long, value_name = "CMD")]
    pub power_cmd: Option<String>,

    /// The unit's address [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub unit: Option<u8>,

    /// The line's rate in bit/s [default: 9600]
    #[arg(long, value_name = "RATE", value_parser = clap::value_parser!(u32).range(300..=4_000_000))]
    pub baud: Option<u32>,

    /// The line's format: 8N2, 8E1, 8O1 or 8N1 [default: 8N2]
    #[arg(long, value_name = "FORMAT")]
    pub format: Option<CharacterFormat>,

    /// The module that must be in the unit's slot [default: any]
    #[arg(long, value_name = "NAME")]
    pub module: Option<Module>,

    /// Run the cases too that write the unit's configuration; they put it back
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

    /// Measure at these rates, such as 9600,115200, or `all`; the unit's configuration is saved on the
    /// way and put back [default: the present one]
    #[arg(long, value_name = "LIST", value_parser = rates)]
    pub rates: Option<Rates>,

    /// Fail when more than one turnaround of a hundred is above this
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub limit: Option<u64>,

    /// What stays silent for so long, in ms, is silent [default: 250]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub patience: Option<u64>,

    /// Where the results go
    #[command(flatten)]
    pub reports: Files,
}

/// Rates in bit/s that the device has, in the order given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rates(pub Vec<u32>);

fn rates(text: &str) -> Result<Rates, String> {
    let known = || Baud::ALL.iter().map(|baud| baud.bits_per_second());
    if text == "all" {
        return Ok(Rates(known().collect()));
    }
    let one = |part: &str| {
        let rate = part.trim().parse().ok();
        rate.filter(|rate| known().any(|other| other == *rate))
            .ok_or_else(|| {
                let all: Vec<String> = known().map(|rate| rate.to_string()).collect();
                format!("{part:?} is none of {}", all.join(" "))
            })
    };
    text.split(',')
        .map(one)
        .collect::<Result<_, _>>()
        .map(Rates)
}

/// The command line and the bench file, merged.
#[derive(Clone, Debug)]
pub struct Setup {
    cli: Cli,
    file: BenchFile,
}

impl Cli {
    /// Reads the bench file, if one is named.
    ///
    /// # Errors
    ///
    /// What is wrong with the file, or with both together, in one line.
    pub fn setup(&self) -> Result<Setup, String> {
        let file = match &self.bench {
            None => BenchFile::default(),
            Some(path) => {
                let path = path.display();
                let text = std::fs::read_to_string(path.to_string())
                    .map_err(|error| format!("{path}: {error}"))?;
                BenchFile::parse(&text, self.unit).map_err(|wrong| format!("{path}:{wrong}"))?
            }
        };
        let setup = Setup {
            cli: self.clone(),
            file,
        };
        if setup.port().is_none() && self.tcp.is_none() {
            return Err("which serial port? Name it with --port, or in the bench file".to_owned());
        }
        let format = setup.line().format().to_string();
        if !["8N2", "8E1", "8O1", "8N1"].contains(&format.as_str()) {
            return Err(format!(
                "a modio has no format {format}: 8N2, 8E1, 8O1, 8N1"
            ));
        }
        let wires = setup.file.wires.len() + setup.file.analog.len();
        if self.no_suite && self.requests == 0 && wires == 0 {
            let what = "nothing is left to do: no suite, no requests, and no wires in a bench file";
            return Err(what.to_owned());
        }
        Ok(setup)
    }
}

impl Setup {
    /// The serial port, if the line is on one.
    #[must_use]
    pub fn port(&self) -> Option<&Path> {
        let told = self.cli.port.as_deref();
        match self.cli.tcp {
            Some(_) => None,
            None => told.or(self.file.port.as_deref()),
        }
    }

    fn line(&self) -> LineFormat {
        let usual = LineFormat::default();
        let format = self.cli.format.or(self.file.format);
        LineFormat::new(
            self.cli.baud.or(self.file.baud).unwrap_or(usual.baud),
            format.unwrap_or_else(|| usual.format()),
        )
    }

    /// Opens the line.
    ///
    /// # Errors
    ///
    /// When it cannot be opened, in one line.
    pub fn open(&self) -> Result<Box<dyn Endpoint>, Broken> {
        let line: Box<dyn Endpoint> = match (self.port(), &self.cli.tcp) {
            (Some(port), _) => Box::new(Stream::serial(port, self.line())?),
            (None, Some(address)) => Box::new(Stream::tcp(address, self.line())?),
            (None, None) => return Err(Broken("no --port".to_owned())),
        };
        let power = self.cli.power_cmd.as_ref().or(self.file.power_cmd.as_ref());
        Ok(match power {
            Some(command) => Box::new(Powered::new(line, command.clone())),
            None => line,
        })
    }

    /// How the image is to be written, if it is.
    #[must_use]
    pub fn flash(&self) -> Option<Flash> {
        let probe = self.cli.probe.as_ref().or(self.file.probe.as_ref());
        self.cli.flash.then(|| Flash {
            probe: probe.cloned(),
            elf: self.cli.elf.clone(),
        })
    }

    /// The command that resets the board, if there is one.
    #[must_use]
    pub fn reset(&self) -> Option<&str> {
        let told = self.cli.reset_cmd.as_deref();
        told.or(self.file.reset_cmd.as_deref())
    }

    /// What to do, on this line.
    ///
    /// # Errors
    ///
    /// When no case has a name as wanted, in one line.
    pub fn plan(&self, endpoint: &dyn Endpoint) -> Result<Plan, String> {
        let (cli, file) = (&self.cli, &self.file);
        Ok(Plan {
            unit: cli.unit.or(file.unit).unwrap_or(1),
            module: cli.module.or(file.module),
            patience: waits(endpoint, cli.patience.map(Duration::from_millis)),
            allow_config: cli.allow_config,
            cases: self.cases()?,
            requests: cli.requests,
            rates: cli.rates.clone().map_or_else(Vec::new, |rates| rates.0),
            limit: cli.limit.map(Duration::from_millis),
            wires: file.wires.clone(),
            analog: file.analog.clone(),
        })
    }

    fn cases(&self) -> Result<Vec<Case>, String> {
        if self.cli.no_suite {
            return Ok(Vec::new());
        }
        crate::cli::chosen(&self.cli.only)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(arguments: &[&str]) -> Result<Cli, clap::Error> {
        Cli::try_parse_from([&["x"], arguments].concat())
    }

    fn setup(file: &str, arguments: &[&str]) -> Result<Setup, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("bench.toml");
        std::fs::write(&path, file).unwrap();
        let path = path.to_string_lossy();
        parse(&[&["--bench", &path], arguments].concat())
            .unwrap()
            .setup()
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
        let manual = include_str!("../../../../docs/hil.md");
        let command = Cli::command();
        let options = command.get_arguments().filter_map(clap::Arg::get_long);
        let missing: Vec<&str> = options
            .filter(|name| !manual.contains(&format!("`--{name}")))
            .collect();
        assert!(missing.is_empty(), "{missing:?}");
    }

    #[test]
    fn rates_are_those_of_the_device() {
        assert_eq!(rates("9600, 115200"), Ok(Rates(vec![9600, 115_200])));
        assert_eq!(rates("all").unwrap().0.len(), Baud::ALL.len());
        let text = rates("9600,300").unwrap_err();
        assert!(text.starts_with("\"300\" is none of 1200 "), "{text}");
    }

    const FILE: &str = "port = \"/dev/a\"\nprobe = \"1:2\"\nunit = 7\nbaud = 19200\nformat = \"8E1\"\n\
                        module = \"4ao\"\nreset_cmd = \"r\"\n";

    #[test]
    fn bench_file_is_used_where_the_command_line_says_nothing() {
        let setup = setup(FILE, &["--flash"]).unwrap();
        assert_eq!(setup.port(), Some(Path::new("/dev/a")));
        assert_eq!(setup.line().to_string(), "19200 8E1");
        assert_eq!(setup.flash().unwrap().probe.as_deref(), Some("1:2"));
        assert_eq!(setup.reset(), Some("r"));
        let plan = setup.plan(&crate::hil::fake::Line::new(&[1])).unwrap();
        assert_eq!((plan.unit, plan.module), (7, Some(Module::Ao4)));
    }

    #[test]
    fn command_line_takes_precedence_over_the_bench_file() {
        let arguments = [
            "--port",
            "/dev/b",
            "--flash",
            "--probe",
            "3:4",
            "--unit",
            "9",
            "--baud",
            "9600",
            "--format",
            "8N1",
            "--module",
            "4di",
            "--reset-cmd",
            "s",
        ];
        let told = setup(FILE, &arguments).unwrap();
        assert_eq!(told.port(), Some(Path::new("/dev/b")));
        assert_eq!(told.line().to_string(), "9600 8N1");
        assert_eq!(told.flash().unwrap().probe.as_deref(), Some("3:4"));
        assert_eq!(told.reset(), Some("s"));
        let plan = told.plan(&crate::hil::fake::Line::new(&[1])).unwrap();
        assert_eq!((plan.unit, plan.module), (9, Some(Module::Di4)));
        assert_eq!(setup(FILE, &["--tcp", "b:1"]).unwrap().port(), None);
        assert_eq!(setup(FILE, &[]).unwrap().flash(), None);
    }

    #[test]
    fn mistake_is_one_line_that_names_the_file_and_the_line() {
        let told = setup("unit = 1\nprot = \"x\"", &[]).unwrap_err();
        assert!(
            told.contains("bench.toml:2: unknown field `prot`"),
            "{told}"
        );
        assert!(!told.contains('\n'), "{told}");
        let told = setup("unit = 1", &[]).unwrap_err();
        assert!(told.contains("--port"), "{told}");
        let told = setup(FILE, &["--no-suite", "--requests", "0"]).unwrap_err();
        assert!(told.starts_with("nothing is left to do"), "{told}");
        let told = setup(FILE, &["--format", "7E1"]).unwrap_err();
        assert!(told.starts_with("a modio has no format 7E1"), "{told}");
        let cli = parse(&["--bench", "/nowhere/b.toml"]).unwrap();
        assert!(cli.setup().unwrap_err().starts_with("/nowhere/b.toml: "));
    }
}
