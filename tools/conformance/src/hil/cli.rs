//! The command line of `modio-hil`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;
use register_map::codes::Baud;

use crate::case::Case;
use crate::cli::waits;
use crate::endpoint::stream::Stream;
use crate::endpoint::{Broken, Endpoint};
use crate::hil::Plan;
use crate::hil::fixture::Fixture;
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
    /// The serial port
    #[arg(long, value_name = "PORT", group = "endpoint", required = true)]
    pub port: Option<PathBuf>,

    /// Raw bytes over TCP in its place: a serial device server
    #[arg(long, value_name = "HOST:PORT", group = "endpoint")]
    pub tcp: Option<String>,

    /// The unit's address
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    pub unit: u8,

    /// The line's rate in bit/s
    #[arg(long, value_name = "RATE", default_value_t = 9600, value_parser = clap::value_parser!(u32).range(300..=4_000_000))]
    pub baud: u32,

    /// The line's format: 8N2, 8E1, 8O1 or 8N1
    #[arg(long, value_name = "FORMAT", default_value = "8N2")]
    pub format: CharacterFormat,

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

    /// Try the wires of this fixture
    #[arg(long, value_name = "FILE")]
    pub fixture: Option<PathBuf>,

    /// What stays silent for so long, in ms, is silent [default: 250]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=60_000))]
    pub patience: Option<u64>,

    /// Check options, fixture, report files and port, and end
    #[arg(long)]
    pub check: bool,

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

impl Cli {
    /// Opens the line.
    ///
    /// # Errors
    ///
    /// When it cannot be opened, or the device has no such format, in one line.
    pub fn open(&self) -> Result<Box<dyn Endpoint>, Broken> {
        let line = LineFormat::new(self.baud, self.format);
        if !["8N2", "8E1", "8O1", "8N1"].contains(&self.format.to_string().as_str()) {
            let what = format!("a modio has no format {}: 8N2, 8E1, 8O1, 8N1", self.format);
            return Err(Broken(what));
        }
        Ok(match (&self.port, &self.tcp) {
            (Some(port), _) => Box::new(Stream::serial(port, line)?),
            (None, Some(address)) => Box::new(Stream::tcp(address, line)?),
            // The parser wants one of them.
            (None, None) => return Err(Broken("no --port".to_owned())),
        })
    }

    /// What to do, on this line.
    ///
    /// # Errors
    ///
    /// When the fixture is missing or wrong, or no case has a name as wanted, in one line.
    pub fn plan(&self, endpoint: &dyn Endpoint) -> Result<Plan, String> {
        if self.no_suite && self.requests == 0 && self.fixture.is_none() {
            return Err(
                "nothing is left to do: no suite, no requests, and no --fixture".to_owned(),
            );
        }
        let fixture = match &self.fixture {
            None => None,
            Some(path) => {
                let told = |why: String| format!("{}: {why}", path.display());
                let text =
                    std::fs::read_to_string(path).map_err(|error| told(error.to_string()))?;
                Some(Fixture::parse(&text, self.unit).map_err(told)?)
            }
        };
        Ok(Plan {
            unit: self.unit,
            patience: waits(endpoint, self.patience.map(Duration::from_millis)),
            allow_config: self.allow_config,
            cases: self.cases()?,
            requests: self.requests,
            rates: self.rates.clone().map_or_else(Vec::new, |rates| rates.0),
            limit: self.limit.map(Duration::from_millis),
            fixture,
        })
    }

    fn cases(&self) -> Result<Vec<Case>, String> {
        if self.no_suite {
            return Ok(Vec::new());
        }
        crate::cli::chosen(&self.only)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_options_are_consistent() {
        Cli::command().debug_assert();
        let parse = |arguments: &[&str]| Cli::try_parse_from([&["x"], arguments].concat());
        assert!(parse(&["--port", "a"]).is_ok());
        for wrong in [
            &[][..],
            &["--port", "a", "--tcp", "b"],
            &["--port", "a", "--unit", "0"],
            &["--port", "a", "--rates", "9601"],
            &["--port", "a", "--rates", ""],
            &["--port", "a", "--no-suite", "--only", "x"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn rates_are_those_of_the_device() {
        assert_eq!(rates("9600, 115200"), Ok(Rates(vec![9600, 115_200])));
        assert_eq!(rates("all").unwrap().0.len(), Baud::ALL.len());
        let text = rates("9600,300").unwrap_err();
        assert!(text.starts_with("\"300\" is none of 1200 "), "{text}");
    }
}
