//! The command line: the endpoint, the unit, the cases and the reports.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, Result, bail, ensure};
use clap::Parser;
use modbus_line::{Format, LineFormat};

use crate::case::{Case, Kind};
use crate::endpoint::Endpoint;
use crate::endpoint::exact_line;
use crate::endpoint::stream::Stream;
use crate::frame::Mode;
use crate::profile::Profile;
use crate::program::Files;
use crate::target::Patience;

/// Tests a Modbus serial-line server from outside, case by case, each with the section it comes from.
///
/// Leaves the unit as it was. Exit status: 0 all cases passed or were skipped, 1 some failed, 2 nothing
/// could be tested.
#[derive(Clone, Debug, Parser)]
#[command(name = "modio-conformance")]
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

    /// Test the firmware in the simulator, in exact virtual time: the loader with the image of --image, or without it an
    /// image that runs alone
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "ELF", group = "endpoint")]
    pub sim: Option<PathBuf>,

    /// The image that the loader of --sim starts: the file of an update (.modio), or of one slot (.image)
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "FILE", requires = "sim")]
    pub image: Option<PathBuf>,

    /// The simulated board, which the image must be for
    #[cfg(feature = "sim")]
    #[arg(help = format!("The simulated board, which the image must be for: {}", register_map::Board::ALL.map(|board| board.name).join(", ")))]
    #[arg(long, value_name = "NAME", default_value_t = &register_map::board::MODIO_02, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub board: &'static register_map::Board,

    /// The module in the simulated board's first slot
    #[cfg(feature = "sim")]
    #[arg(help = format!("The module in the simulated board's first slot: {}", register_map::Module::ALL.map(register_map::Module::name).join(", ")))]
    #[arg(long, value_name = "NAME", default_value = "4do", conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub module: register_map::Module,

    /// The module in the simulated board's slot at a port, such as 3=4ai; may be repeated
    #[cfg(feature = "sim")]
    #[arg(long = "slot", value_name = "PORT=MODULE", value_parser = sim::options::slot, conflicts_with_all = ["serial", "tcp", "exact_line"])]
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
    #[arg(long, value_name = "RATE", default_value_t = 9600, value_parser = clap::value_parser!(u32).range(modbus_line::RATES))]
    pub baud: u32,

    /// The line's format: data bits, parity, stop bits
    #[arg(long, value_name = "FORMAT", default_value = "8N2")]
    pub format: Format,

    /// The unit's address [default: the profile's, the DIP switch, or 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub unit: Option<u8>,

    /// The unit speaks ASCII, not RTU
    #[arg(long)]
    pub ascii: bool,

    /// Description of a unit that is not a modio, in TOML
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,

    /// Run also the cases that write a modio's configuration; they restore it
    #[arg(long)]
    pub allow_config: bool,

    /// Time to wait, in ms, before a unit that must not reply counts as silent [default: 250, exact 25]. Where time is
    /// not exact, a reply that is due is waited for four times as long
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub patience: Option<u64>,

    /// Run only cases whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub only: Vec<String>,

    /// Do not run cases whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    pub exclude: Vec<String>,

    /// Run only the cases of the kind standard: no interpretations, no extensions, and no cases about the modio
    #[arg(long, conflicts_with = "strict")]
    pub standard_only: bool,

    /// End with status 1 also when an interpretation of the standard fails. On a modio interpretations always count
    #[arg(long)]
    pub strict: bool,

    /// Write every frame sent and received to the standard error output, with its time
    #[arg(long)]
    pub trace: bool,

    /// List the cases as a page in Markdown and end
    #[arg(long)]
    pub list: bool,

    /// Files for the results
    #[command(flatten)]
    pub reports: Files,
}

#[cfg(feature = "sim")]
fn setting(text: &str) -> Result<(u16, u16), String> {
    use crate::profile::number;
    text.split_once('=')
        .and_then(|(register, value)| Some((number(register)?, number(value)?)))
        .ok_or_else(|| "not REGISTER=VALUE such as 0x0107=1".to_owned())
}

impl Cli {
    /// Returns the line's rate and format.
    pub fn line(&self) -> LineFormat {
        LineFormat::new(self.baud, self.format)
    }

    /// Returns the transmission mode, by the option or the profile.
    pub fn mode(&self, profile: Option<&Profile>) -> Result<Mode> {
        if self.ascii {
            return Ok(Mode::Ascii);
        }
        let mode = profile.map(Profile::mode).transpose()?.flatten();
        Ok(mode.unwrap_or_default())
    }

    /// Returns the unit's address.
    pub fn unit(&self, profile: Option<&Profile>) -> u8 {
        let unit = self.unit.or_else(|| profile.and_then(|p| p.unit));
        #[cfg(feature = "sim")]
        let unit = unit.or_else(|| self.sim.as_ref().map(|_| self.dip));
        unit.unwrap_or(1)
    }

    /// Returns the profile, if one is given.
    pub fn read_profile(&self) -> Result<Option<Profile>> {
        let Some(path) = &self.profile else {
            return Ok(None);
        };
        let read = || {
            let profile = Profile::parse(&std::fs::read_to_string(path)?)?;
            profile.known()?;
            anyhow::Ok(Some(profile))
        };
        read().with_context(|| path.display().to_string())
    }

    /// Opens the endpoint.
    pub fn open(&self, mode: Mode) -> Result<Box<dyn Endpoint>> {
        ensure!(
            self.format.data_bits != 7 || mode == Mode::Ascii,
            "RTU needs 8 data bits: give another --format, or --ascii"
        );
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
                image: self.image.clone(),
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
        bail!(
            "nothing to test: name an endpoint with --serial PORT, --tcp HOST:PORT, --exact-line HOST:PORT{sim}"
        )
    }

    /// Returns the waiting times on this endpoint.
    pub fn waits(&self, endpoint: &dyn Endpoint) -> Patience {
        waits(endpoint, self.patience.map(Duration::from_millis))
    }

    /// Returns the cases to run.
    pub fn cases(&self) -> Result<Vec<Case>> {
        let mut cases = chosen(&self.only)?;
        cases.retain(|case| {
            let excluded = self.exclude.iter().any(|part| case.name.contains(part));
            !excluded && (!self.standard_only || case.kind == Kind::Standard)
        });
        ensure!(
            !cases.is_empty(),
            "--exclude and --standard-only leave no case to run"
        );
        Ok(cases)
    }
}

/// Returns the cases whose names contain one of these parts; all when there is none.
pub fn chosen(parts: &[String]) -> Result<Vec<Case>> {
    let mut cases = crate::cases::all();
    if !parts.is_empty() {
        cases.retain(|case| parts.iter().any(|part| case.name.contains(part)));
    }
    ensure!(
        !cases.is_empty(),
        "no case has such a name: modio-conformance --list shows them"
    );
    Ok(cases)
}

/// Returns the waiting times on an endpoint. Where time is exact, the line sets them. Elsewhere they allow for a slow
/// operating system, and for a simulator that is slower than its clock.
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
        let reply = reply.unwrap_or(Duration::from_millis(250));
        let wait = reply.max(line.t35() * 3);
        Patience {
            // A reply ends the wait, so a long wait costs time only when no reply is received.
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

    fn parse(arguments: &str) -> Cli {
        Cli::try_parse_from(format!("x {arguments}").split_whitespace()).unwrap()
    }

    #[test]
    fn the_options_are_consistent() {
        Cli::command().debug_assert();
        assert!(Cli::try_parse_from(["x", "--serial", "a", "--tcp", "b"]).is_err());
        assert!(Cli::try_parse_from(["x", "--format", "8X1"]).is_err());
        assert!(Cli::try_parse_from(["x", "--unit", "0"]).is_err());
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
}
