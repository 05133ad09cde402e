//! The command line: the endpoint, the unit, the cases and the reports.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail, ensure};
use clap::Parser;
use modbus_line::{Format, LineFormat};
use register_map::Module;

use crate::case::{Case, Kind, Need};
use crate::cases;
use crate::endpoint::Endpoint;
use crate::endpoint::exact_line;
use crate::endpoint::stream::Stream;
use crate::frame::Mode;
use crate::hil::Hil;
use crate::hil::bench_file::BenchFile;
use crate::hil::options::Options;
use crate::profile::Profile;
use crate::report::files::Files;
use crate::target::Patience;

/// Tests a Modbus serial-line server from outside, case by case, each with the section it comes from.
///
/// Leaves the unit as it was, also after Ctrl-C. Exit status: 0 all cases passed or were skipped, 1 some failed, 2 nothing
/// could be tested, 130 interrupted.
#[derive(Clone, Debug, Parser)]
#[command(name = "modio-conformance")]
pub struct Cli {
    /// Test a modio on a bench (docs/hil.md): measure, too, how soon and how reliably it answers
    #[arg(value_parser = ["hil"])]
    pub hil: Option<String>,

    /// Test through this serial port or pseudo-terminal
    #[arg(long, visible_alias = "port", value_name = "PORT", group = "endpoint")]
    pub serial: Option<PathBuf>,

    /// Test through raw bytes over TCP: the simulator's --tcp, Renode's socket, a serial device server
    #[arg(long, value_name = "HOST:PORT", group = "endpoint")]
    pub tcp: Option<String>,

    /// Test through the exact-line protocol, in virtual time: the simulator's --exact-line, Renode's
    /// exact-line.py
    #[arg(long, value_name = "HOST:PORT", group = "endpoint", conflicts_with_all = ["baud", "format", "flash", "reset_cmd", "update", "power_cmd"])]
    pub exact_line: Option<String>,

    /// Test the firmware in the simulator, in exact virtual time: the loader with the image of --image, or without it an
    /// image that runs alone
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "ELF", group = "endpoint", conflicts_with_all = ["flash", "reset_cmd", "update", "power_cmd"])]
    pub sim: Option<PathBuf>,

    /// The image that the loader of --sim starts: the file of an update (.modio), or of one slot (.image)
    #[cfg(feature = "sim")]
    #[arg(long, value_name = "FILE", requires = "sim")]
    pub image: Option<PathBuf>,

    /// The simulated board, which the image must be for
    #[cfg(feature = "sim")]
    #[arg(help = format!("The simulated board, which the image must be for: {}", register_map::Row::ALL.map(|board| board.name).join(", ")))]
    #[arg(long, value_name = "NAME", default_value_t = &register_map::board::MODIO_02, conflicts_with_all = ["serial", "tcp", "exact_line"])]
    pub board: &'static register_map::Row,

    /// The module in the first slot: that of the simulated board [default: 4do], or that which a real board must have
    #[arg(long, value_name = "NAME")]
    pub module: Option<Module>,

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

    /// The line's rate in bit/s [default: 9600]
    #[arg(long, value_name = "RATE", value_parser = clap::value_parser!(u32).range(modbus_line::RATES))]
    pub baud: Option<u32>,

    /// The line's format: data bits, parity, stop bits [default: 8N2]
    #[arg(long, value_name = "FORMAT")]
    pub format: Option<Format>,

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

    /// The options about a bench
    #[command(flatten, next_help_heading = "A modio on a bench")]
    pub on_bench: Options,
}

#[cfg(feature = "sim")]
fn setting(text: &str) -> Result<(u16, u16), String> {
    use crate::profile::number;
    text.split_once('=')
        .and_then(|(register, value)| Some((number(register)?, number(value)?)))
        .ok_or_else(|| "not REGISTER=VALUE such as 0x0107=1".to_owned())
}

impl Cli {
    /// Reads the bench file, if one is named, and takes from it what the options do not say.
    pub fn with_bench_file(mut self) -> Result<Self> {
        if let Some(path) = &self.on_bench.bench {
            let shown = path.display();
            let text = std::fs::read_to_string(path).with_context(|| shown.to_string())?;
            let file =
                BenchFile::parse(&text, self.unit).map_err(|wrong| anyhow!("{shown}:{wrong}"))?;
            if !self.names_endpoint() {
                self.serial = file.port;
            }
            self.unit = self.unit.or(file.unit);
            self.baud = self.baud.or(file.baud);
            self.format = self.format.or(file.format);
            self.module = self.module.or(file.module);
            // The commands are for a real board.
            let is_real = !self.is_exact();
            let command = |of_file: Option<String>| of_file.filter(|_| is_real);
            let bench = &mut self.on_bench;
            bench.probe = bench.probe.take().or(file.probe);
            bench.reset_cmd = bench.reset_cmd.take().or(command(file.reset_cmd));
            bench.power_cmd = bench.power_cmd.take().or(command(file.power_cmd));
            bench.wires = file.wires;
        }
        let hil = self.of_bench();
        let is_timed = |case: &Case| case.needs.contains(&Need::Requests);
        let asks = hil.requests > 0 && self.cases()?.iter().any(is_timed);
        ensure!(
            asks || hil.rates.is_empty() && hil.limit.is_none(),
            "--rates and --limit need requests: --requests N, and the case timing/each-rate"
        );
        self.can_test(&hil)?;
        Ok(self)
    }

    /// Checks that the bench has what one at least of the cases needs, if some of them need a bench.
    fn can_test(&self, hil: &Hil) -> Result<()> {
        let mut reasons = Vec::new();
        for case in self.cases()? {
            let why = case.needs.iter().find_map(|need| need.unmet(hil));
            // Where time is not exact, the other cases of the group `timing` cannot run.
            if why.is_none() && (self.is_exact() || !case.needs.contains(&Need::Exact)) {
                return Ok(());
            }
            reasons.extend(why);
        }
        ensure!(
            reasons.is_empty(),
            "nothing to test: {}",
            reasons.join("; ")
        );
        Ok(())
    }

    fn is_exact(&self) -> bool {
        let exact = self.exact_line.is_some();
        #[cfg(feature = "sim")]
        let exact = exact || self.sim.is_some();
        exact
    }

    fn names_endpoint(&self) -> bool {
        self.serial.is_some() || self.tcp.is_some() || self.is_exact()
    }

    /// Returns what a bench adds to the cases.
    pub fn of_bench(&self) -> Hil {
        let usual = if self.hil.is_some() { 2000 } else { 0 };
        self.on_bench.adds(usual)
    }

    /// Returns the options with which modioctl reaches the unit.
    pub fn reached(&self) -> Result<Vec<String>> {
        let (option, place) = match (&self.serial, &self.tcp) {
            (Some(port), _) => ("--port", port.display().to_string()),
            (None, Some(address)) => ("--tcp", address.clone()),
            (None, None) => bail!("--update needs a serial port or --tcp"),
        };
        let (line, unit) = (self.line(), self.unit(None).to_string());
        let (baud, format) = (line.baud.to_string(), line.format.to_string());
        let options = [option, &place, "--baud", &baud, "--format", &format];
        let options = options.into_iter().chain(["--unit", &unit]);
        Ok(options.map(str::to_owned).collect())
    }

    /// Returns the line's rate and format.
    pub fn line(&self) -> LineFormat {
        let usual = LineFormat::default();
        let format = self.format.unwrap_or(usual.format);
        LineFormat::new(self.baud.unwrap_or(usual.baud), format)
    }

    /// Returns the transmission mode, by the option or the profile.
    pub fn mode(&self, profile: Option<&Profile>) -> Mode {
        if self.ascii {
            return Mode::Ascii;
        }
        profile.and_then(|profile| profile.mode).unwrap_or_default()
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
            self.line().format.data_bits != 7 || mode == Mode::Ascii,
            "RTU needs 8 data bits: give another --format, or --ascii"
        );
        if let Some(path) = &self.serial {
            let stream = Stream::serial(path, self.line())?;
            return Ok(Box::new(stream.with_power(self.on_bench.power_cmd.clone())));
        }
        if let Some(address) = &self.tcp {
            let stream = Stream::tcp(address, self.line())?;
            return Ok(Box::new(stream.with_power(self.on_bench.power_cmd.clone())));
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
                module: self.module.unwrap_or(Module::Do4),
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
        let mut cases = cases::of_bench();
        if !self.on_bench.no_suite {
            cases.splice(0..0, cases::all());
        }
        let has = |parts: &[String], case: &Case| parts.iter().any(|part| case.name.contains(part));
        cases.retain(|case| self.only.is_empty() || has(&self.only, case));
        ensure!(
            !cases.is_empty(),
            "no case has such a name: modio-conformance --list shows them"
        );
        cases.retain(|case| {
            !has(&self.exclude, case) && (!self.standard_only || case.kind == Kind::Standard)
        });
        ensure!(
            !cases.is_empty(),
            "--exclude and --standard-only leave no case to run"
        );
        Ok(cases)
    }
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
mod tests;
