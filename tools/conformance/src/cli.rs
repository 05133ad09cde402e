//! The command line: which endpoint, which unit, which cases, which reports.

use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;

use crate::bench::Patience;
use crate::case::{Case, Kind};
use crate::endpoint::exact_line;
use crate::endpoint::stream::Stream;
use crate::endpoint::{Broken, Endpoint};
use crate::frame::Mode;
use crate::line::{CharacterFormat, LineFormat};
use crate::profile::Profile;
use crate::program::Files;

/// Tests a Modbus serial-line server from outside, case by case, each with the section it comes from.
///
/// Leaves the unit as it was. Exit status: 0 all cases passed or were skipped, 1 some failed, 2 nothing
/// could be tested.
#[derive(Clone, Debug, Parser)]
#[command(name = "modio-conformance", version)]
pub struct Cli {
    /// Test through this serial port or pseudo-terminal
    #[arg(long, value_name = "PORT", group = "endpoint")]
    pub serial: Option<PathBuf>,

    /// Test through raw bytes over TCP: the simulator's --tcp, Renode's socket, a serial device server
    #[arg(long, value_name = "HOST:PORT", group = "endpoint")]
    pub tcp: Option<String>,

    /// Test through the exact-line protocol, in virtual time: the simulator's --exact-line, Renode's
    /// exact-line.py
    #[arg(long, value_name = "HOST:PORT", group = "endpoint", conflicts_with_all = ["baud", "format"])]
    pub exact_line: Option<String>,

    /// Test this firmware image in the simulator, in exact virtual time
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "ELF", group = "endpoint")]
    pub sim: Option<PathBuf>,

    /// The simulated board, for which the image is: modio-02 or modio-08
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "NAME", default_value_t = &register_map::board::MODIO_02, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub board: &'static register_map::Board,

    /// What is in the simulated board's first slot: none, 4di, 4do, 2relay, 4ai, 4ao or 2ai2ao
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "NAME", default_value = "4do", conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub module: register_map::Module,

    /// What is in the simulated board's slot at a port, such as 3=4ai; may be repeated
    #[cfg(feature = "sim")]
    #[arg(long = "slot", value_name = "PORT=MODULE", value_parser = sim_options::slot, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub slots: Vec<(u8, register_map::Module)>,

    /// The simulated board's DIP switch: its unit address
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub dip: u8,

    /// A register stored in the simulated board's configuration, such as 0x0107=1; may be repeated
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "REGISTER=VALUE", value_parser = setting, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub set: Vec<(u16, u16)>,

    /// The line's rate in bit/s
    #[arg(long, value_name = "RATE", default_value_t = 9600, value_parser = clap::value_parser!(u32).range(300..=4_000_000))]
    pub baud: u32,

    /// The line's format: data bits, parity, stop bits
    #[arg(long, value_name = "FORMAT", default_value = "8N2")]
    pub format: CharacterFormat,

    /// The unit's address [default: the profile's, the DIP switch, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub unit: Option<u8>,

    /// The unit speaks ASCII, not RTU
    #[arg(long)]
    pub ascii: bool,

    /// What the unit has, in TOML, when it is no modio
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,

    /// Run the cases too that write a modio's configuration; they put it back
    #[arg(long)]
    pub allow_config: bool,

    /// What stays silent for so long, in ms, is silent [default: 250, exact 25]; a reply that is due is
    /// waited for four times as long where time is not exact
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub patience: Option<u64>,

    /// Run only cases whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub only: Vec<String>,

    /// Do not run cases whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub exclude: Vec<String>,

    /// Run only the cases whose demand stands in the standards: no interpretations, nothing about the modio
    #[arg(long, conflicts_with = "strict")]
    pub standard_only: bool,

    /// Count failed interpretations of the standard, too: the exit status is then 1. On a modio they always
    /// count
    #[arg(long)]
    pub strict: bool,

    /// Write every frame sent and received to the standard error output, with its time
    #[arg(long)]
    pub trace: bool,

    /// List the cases and end
    #[arg(long)]
    pub list: bool,

    /// Where the results go
    #[command(flatten)]
    pub reports: Files,
}

#[cfg(feature = "sim")]
fn setting(text: &str) -> Result<(u16, u16), String> {
    let number = |text: &str| match text.trim().strip_prefix("0x") {
        Some(digits) => u16::from_str_radix(digits, 16).ok(),
        None => text.trim().parse().ok(),
    };
    text.split_once('=')
        .and_then(|(register, value)| Some((number(register)?, number(value)?)))
        .ok_or_else(|| "not REGISTER=VALUE such as 0x0107=1".to_owned())
}

impl Cli {
    /// The line's rate and format.
    #[must_use]
    pub fn line(&self) -> LineFormat {
        LineFormat::new(self.baud, self.format)
    }

    /// The transmission mode, by the option or the profile.
    ///
    /// # Errors
    ///
    /// What is wrong with the profile.
    pub fn mode(&self, profile: Option<&Profile>) -> Result<Mode, String> {
        let told = match profile {
            Some(profile) => profile.known()?.mode,
            None => None,
        };
        Ok(if self.ascii {
            Mode::Ascii
        } else {
            told.unwrap_or_default()
        })
    }

    /// The unit's address.
    #[must_use]
    pub fn unit(&self, profile: Option<&Profile>) -> u8 {
        let told = self.unit.or_else(|| profile.and_then(|p| p.unit));
        #[cfg(feature = "sim")]
        let told = told.or_else(|| self.sim.as_ref().map(|_| self.dip));
        told.unwrap_or(1)
    }

    /// The profile, if one is given.
    ///
    /// # Errors
    ///
    /// When it cannot be read or is wrong, in one line.
    pub fn read_profile(&self) -> Result<Option<Profile>, String> {
        let Some(path) = &self.profile else {
            return Ok(None);
        };
        let told = |why: String| format!("{}: {why}", path.display());
        let text = std::fs::read_to_string(path).map_err(|error| told(error.to_string()))?;
        let profile = Profile::parse(&text).map_err(told)?;
        profile.known().map_err(told)?;
        Ok(Some(profile))
    }

    /// Opens the endpoint.
    ///
    /// # Errors
    ///
    /// When none is named, or it cannot be opened: what is wrong and what to do, in one line.
    pub fn open(&self, mode: Mode) -> Result<Box<dyn Endpoint>, Broken> {
        if self.format.data_bits == 7 && mode == Mode::Rtu {
            return Err(Broken(
                "RTU needs 8 data bits: give another --format, or --ascii".to_owned(),
            ));
        }
        if let Some(path) = &self.serial {
            return Ok(Box::new(Stream::serial(path, self.line())?));
        }
        if let Some(address) = &self.tcp {
            return Ok(Box::new(Stream::tcp(address, self.line())?));
        }
        if let Some(address) = &self.exact_line {
            return Ok(Box::new(exact_line::Tcp::connect(address)?));
        }
        #[cfg(feature = "sim")]
        if let Some(elf) = &self.sim {
            use crate::endpoint::sim::{Fitting, start};
            return Ok(Box::new(start(&Fitting {
                elf: elf.clone(),
                board: self.board,
                module: self.module,
                slots: self.slots.clone(),
                dip: self.dip,
                line: self.line(),
                mode,
                settings: self.set.clone(),
            })?));
        }
        let sim = if cfg!(feature = "sim") {
            ", --sim ELF"
        } else {
            ""
        };
        Err(Broken(format!(
            "nothing to test: name an endpoint with --serial PORT, --tcp HOST:PORT, --exact-line HOST:PORT{sim}"
        )))
    }

    /// How long to wait on this endpoint.
    #[must_use]
    pub fn waits(&self, endpoint: &dyn Endpoint) -> Patience {
        waits(endpoint, self.patience.map(Duration::from_millis))
    }

    /// The cases that are wanted.
    ///
    /// # Errors
    ///
    /// When none is left.
    pub fn cases(&self) -> Result<Vec<Case>, String> {
        let mut cases = chosen(&self.only)?;
        cases.retain(|case| {
            let excluded = self.exclude.iter().any(|part| case.name.contains(part));
            !excluded && (!self.standard_only || case.kind == Kind::Standard)
        });
        if cases.is_empty() {
            return Err("--exclude and --standard-only leave no case to run".to_owned());
        }
        Ok(cases)
    }
}

/// The cases whose names contain one of these parts; all when there is none.
///
/// # Errors
///
/// When none is left.
pub fn chosen(parts: &[String]) -> Result<Vec<Case>, String> {
    let mut cases = crate::cases::all();
    if !parts.is_empty() {
        cases.retain(|case| parts.iter().any(|part| case.name.contains(part)));
    }
    if cases.is_empty() {
        return Err("no case has such a name: modio-conformance --list shows them".to_owned());
    }
    Ok(cases)
}

/// How long to wait on an endpoint: by its line when its time is exact, else long enough for an operating
/// system, or a simulator that does not keep up.
#[must_use]
pub fn waits(endpoint: &dyn Endpoint, reply: Option<Duration>) -> Patience {
    let line = endpoint.line();
    if endpoint.abilities().exact {
        let least = line.t35() * 2 + line.characters(4);
        let wait = reply.unwrap_or(Duration::from_millis(25)).max(least);
        Patience {
            reply: wait,
            silence: wait,
            quiet: line.t35() + line.characters(1),
        }
    } else {
        let wait = reply
            .unwrap_or(Duration::from_millis(250))
            .max(line.t35() * 3);
        Patience {
            // A reply that is due ends the wait when it comes: this costs nothing.
            reply: wait * 4,
            silence: wait,
            quiet: Duration::from_millis(40).max(line.t35() * 2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn parse(arguments: &[&str]) -> Cli {
        Cli::try_parse_from(std::iter::once(&"x").chain(arguments)).unwrap()
    }

    #[test]
    fn the_options_are_consistent() {
        Cli::command().debug_assert();
        assert!(Cli::try_parse_from(["x", "--serial", "a", "--tcp", "b"]).is_err());
        assert!(Cli::try_parse_from(["x", "--format", "8X1"]).is_err());
        assert!(Cli::try_parse_from(["x", "--unit", "0"]).is_err());
    }

    #[test]
    fn without_an_endpoint_it_is_told_what_to_do() {
        let text = parse(&[]).open(Mode::Rtu).err().unwrap().0;
        assert!(
            text.contains("--serial") && text.contains("--tcp"),
            "{text}"
        );
        let text = parse(&["--format", "7E1"]).open(Mode::Rtu).err().unwrap().0;
        assert!(text.contains("--ascii"), "{text}");
    }

    #[test]
    fn cases_are_chosen_by_parts_of_their_names() {
        let all = parse(&[]).cases().unwrap().len();
        let some = parse(&["--only", "fc05/", "--only", "ascii/"])
            .cases()
            .unwrap();
        assert!(some.len() > 10 && some.len() < all);
        assert!(parse(&["--only", "no such case"]).cases().is_err());
        let fewer = parse(&[
            "--only",
            "fc05/",
            "--exclude",
            "length",
            "--exclude",
            "value",
        ]);
        let names: Vec<_> = fewer.cases().unwrap().iter().map(|c| c.name).collect();
        assert_eq!(names, ["fc05/on-and-off", "fc05/address"]);
        assert!(parse(&["--exclude", "/"]).cases().is_err());
        let standard = parse(&["--standard-only", "--only", "fc05/", "--only", "config/"]);
        let names: Vec<_> = standard.cases().unwrap().iter().map(|c| c.name).collect();
        assert!(names.contains(&"fc05/value") && !names.contains(&"fc05/length"));
        assert!(names.iter().all(|name| name.starts_with("fc05/")));
    }

    #[test]
    fn the_unit_is_told_or_1() {
        assert_eq!(parse(&[]).unit(None), 1);
        assert_eq!(parse(&["--unit", "9"]).unit(None), 9);
        let profile = Profile::parse("unit = 17").unwrap();
        assert_eq!(parse(&[]).unit(Some(&profile)), 17);
        assert_eq!(parse(&["--unit", "9"]).unit(Some(&profile)), 9);
    }
}
