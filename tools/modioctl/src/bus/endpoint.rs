//! Address and settings of the unit: from the command line, a file of named endpoints, and the environment.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, CommandFactory, FromArgMatches, Parser};
use etcetera::BaseStrategy;
use modbus_line::{Format, LineFormat, t35};

use super::adu::Framing;
use crate::failure::Failure;
use crate::input;

/// Possible rates of a line in bit/s.
pub const RATES: RangeInclusive<u32> = 50..=4_000_000;

/// Connection to the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A serial port by its path or name.
    Serial(String),
    /// RTU or ASCII frames over TCP, at `HOST:PORT`.
    Tcp(String),
    /// Modbus TCP, at `HOST:PORT`.
    ModbusTcp(String),
}

impl Place {
    /// Returns whether a change of the unit's line settings also concerns this computer's port.
    pub const fn is_serial(&self) -> bool {
        matches!(self, Self::Serial(_))
    }
}

/// Address and settings of the unit.
#[derive(Clone, Debug)]
pub struct Endpoint {
    /// Connection to the line.
    pub place: Place,
    /// Baud rate in bit/s.
    pub baud: u32,
    /// Data bits, parity and stop bits.
    pub format: Format,
    /// Framing of the line.
    pub framing: Framing,
    /// Unit address, 1 to 247, or 255.
    pub unit: u8,
    /// Time to wait for the beginning of an answer.
    pub timeout: Duration,
    /// Number of times that a request is repeated.
    pub retries: u8,
    /// Whether the time-out was given by the user.
    pub timeout_given: bool,
}

impl Endpoint {
    /// Returns the endpoint at this place with the usual settings.
    pub fn new(place: Place, framing: Framing) -> Self {
        Self {
            place,
            baud: 9600,
            format: Format::default(),
            framing,
            unit: 1,
            timeout: Duration::from_secs(1),
            retries: 2,
            timeout_given: false,
        }
    }

    /// Returns rate and format of the line.
    pub const fn line(&self) -> LineFormat {
        LineFormat::new(self.baud, self.format)
    }

    /// Returns the duration of `bytes` bytes on the line, also for a gateway in transparent mode. Returns zero for
    /// Modbus TCP, whose server handles the timing of its line itself.
    pub fn time_of(&self, bytes: usize) -> Duration {
        if self.framing == Framing::Mbap {
            return Duration::ZERO;
        }
        self.line().characters(bytes)
    }

    /// Returns the silence between frames on a serial line: t3.5, in characters of the line's format.
    pub fn frame_gap(&self) -> Duration {
        match self.framing {
            Framing::Mbap => Duration::ZERO,
            Framing::Rtu | Framing::Ascii => t35(self.baud, self.format.bits()),
        }
    }
}

/// Options of the endpoint: from the command line, a named endpoint, or the environment.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Endpoint")]
pub struct Options {
    /// Serial port of the line: /dev/ttyUSB0, COM3, a pseudo-terminal [env: MODIO_PORT]
    #[arg(long, global = true, value_name = "PORT", group = "where")]
    pub port: Option<String>,

    /// RTU or ASCII frames over TCP, for gateways in transparent mode [env: MODIO_TCP]
    #[arg(long, global = true, value_name = "HOST:PORT", group = "where", value_parser = address)]
    pub tcp: Option<String>,

    /// Modbus TCP [env: MODIO_MODBUS_TCP]
    #[arg(long, global = true, value_name = "HOST:PORT", group = "where", value_parser = address)]
    pub modbus_tcp: Option<String>,

    /// Baud rate of the serial port in bit/s [default: 9600] [env: MODIO_BAUD]
    #[arg(long, global = true, value_name = "RATE", value_parser = baud)]
    pub baud: Option<u32>,

    /// Data bits, parity, stop bits [default: 8N2] [env: MODIO_FORMAT]
    #[arg(long, global = true)]
    pub format: Option<Format>,

    /// Framing on a serial line: rtu or ascii [default: rtu] [env: MODIO_MODE]
    #[arg(long, global = true, value_enum)]
    pub mode: Option<Mode>,

    /// Address of the unit, 1 to 247; 255 for recovery mode [default: 1] [env: MODIO_UNIT]
    #[arg(long, global = true, value_name = "N", value_parser = unit)]
    pub unit: Option<u8>,

    /// Time to wait for an answer, such as 200ms or 1s [default: 1s] [env: MODIO_TIMEOUT]
    #[arg(long, global = true, value_name = "TIME", value_parser = duration)]
    pub timeout: Option<Duration>,

    /// Number of times to repeat a request [default: 2] [env: MODIO_RETRIES]
    #[arg(long, global = true, value_name = "N", value_parser = retries)]
    pub retries: Option<u8>,
}

/// The transmission mode of a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// RTU.
    Rtu,
    /// ASCII.
    Ascii,
}

fn address(text: &str) -> Result<String, String> {
    host_and_port(text).map(|_| text.to_owned())
}

/// Returns host and port of a network address.
pub fn host_and_port(address: &str) -> Result<(String, u16), String> {
    let (host, port) = address.rsplit_once(':').unwrap_or((address, ""));
    match port.parse() {
        Ok(port) if !host.is_empty() => {
            let host = host.trim_start_matches('[').trim_end_matches(']');
            Ok((host.to_owned(), port))
        }
        _ => {
            let host = if host.is_empty() { "192.168.1.5" } else { host };
            Err(format!("a host with a port is needed, such as {host}:502"))
        }
    }
}

fn baud(text: &str) -> Result<u32, String> {
    number(text, RATES, "9600")
}

fn retries(text: &str) -> Result<u8, String> {
    number(text, 0..=20, "2")
}

/// Parses a number of this range.
fn number<T: FromStr + PartialOrd + Display>(
    text: &str,
    range: RangeInclusive<T>,
    example: &str,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| {
        let (first, last) = range.into_inner();
        format!("a number from {first} to {last} is needed, such as {example}")
    })
}

fn unit(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(unit @ (1..=247 | 255)) => Ok(unit),
        _ => Err("a unit address is 1 to 247 (255 for recovery mode)".to_owned()),
    }
}

/// Parses a duration with its unit, or a number of seconds.
pub fn duration(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok();
    let duration = match seconds.map(Duration::try_from_secs_f64) {
        Some(Ok(duration)) => duration,
        _ => humantime::parse_duration(text).unwrap_or_default(),
    };
    match duration.as_millis() {
        1..=3_600_000 => Ok(duration),
        _ => Err("a time from 1ms to 1h is needed, such as 200ms".to_owned()),
    }
}

/// Parses options from a file or the environment in the same way as those of the command line.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Elsewhere {
    #[command(flatten)]
    options: Options,
}

/// Returns the names of the options in files. In the environment they are in capitals after `MODIO_`.
fn names() -> Vec<String> {
    let command = Elsewhere::command();
    let names = command.get_arguments().filter_map(clap::Arg::get_long);
    names.map(str::to_owned).collect()
}

impl Options {
    /// Returns the endpoint. Each option is from the command line, or else from the named endpoint, or else from
    /// the environment.
    pub fn endpoint(self, at: Option<&str>, file: Option<&Path>) -> Result<Endpoint, Failure> {
        let environment = Self::from_environment()?;
        let at = at.map(str::to_owned).or_else(|| variable("AT"));
        let named = match at {
            Some(name) => Self::named(&name, file)?,
            None => Self::default(),
        };
        let merged = self.or(named).or(environment);
        let place = merged.place().ok_or_else(|| {
            Failure::usage("no endpoint is given: use --port, --tcp, --modbus-tcp or --at; `modioctl ports` lists the serial ports")
        })?;
        let framing = match (&place, merged.mode) {
            (Place::ModbusTcp(_), _) => Framing::Mbap,
            (_, Some(Mode::Ascii)) => Framing::Ascii,
            _ => Framing::Rtu,
        };
        let usual = Endpoint::new(place, framing);
        let format = merged.format.unwrap_or(usual.format);
        if framing == Framing::Rtu && format.data_bits == 7 && usual.place.is_serial() {
            return Err(Failure::usage(format!(
                "--format {format}: RTU needs 8 data bits; 7 are for --mode ascii"
            )));
        }
        Ok(Endpoint {
            baud: merged.baud.unwrap_or(usual.baud),
            format,
            unit: merged.unit.unwrap_or(usual.unit),
            timeout: merged.timeout.unwrap_or(usual.timeout),
            retries: merged.retries.unwrap_or(usual.retries),
            timeout_given: merged.timeout.is_some(),
            ..usual
        })
    }

    fn place(&self) -> Option<Place> {
        let serial = self.port.clone().map(Place::Serial);
        let tcp = || self.tcp.clone().map(Place::Tcp);
        let modbus_tcp = || self.modbus_tcp.clone().map(Place::ModbusTcp);
        serial.or_else(tcp).or_else(modbus_tcp)
    }

    /// Returns these options, with missing ones from `rest`. The place is a single option in three forms.
    fn or(self, rest: Self) -> Self {
        let (port, tcp, modbus_tcp) = if self.place().is_some() {
            (self.port, self.tcp, self.modbus_tcp)
        } else {
            (rest.port, rest.tcp, rest.modbus_tcp)
        };
        Self {
            port,
            tcp,
            modbus_tcp,
            baud: self.baud.or(rest.baud),
            format: self.format.or(rest.format),
            mode: self.mode.or(rest.mode),
            unit: self.unit.or(rest.unit),
            timeout: self.timeout.or(rest.timeout),
            retries: self.retries.or(rest.retries),
        }
    }

    fn from_environment() -> Result<Self, Failure> {
        let variables = names().into_iter().filter_map(|name| {
            let value = variable(&name.to_uppercase().replace('-', "_"))?;
            Some((name, value))
        });
        Self::parse(variables).map_err(|what| {
            Failure::usage(format!("in the environment (MODIO_PORT and so on): {what}"))
        })
    }

    fn named(name: &str, file: Option<&Path>) -> Result<Self, Failure> {
        let path = match file {
            Some(path) => path.to_owned(),
            None => usual_file()?,
        };
        let shown = path.display();
        let bytes = input::read(&path)
            .map_err(|what| Failure::usage(format!("--at {name}: cannot read {shown}: {what}")))?;
        let text = input::text(&bytes)
            .map_err(|what| Failure::usage(format!("--at {name}: {shown} {what}")))?;
        let mut tables: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            Failure::usage(format!("{shown}: {}", error.message()))
        })?;
        let known: Vec<_> = tables.keys().cloned().collect();
        let Some(toml::Value::Table(table)) = tables.remove(name) else {
            return Err(Failure::usage(format!(
                "{shown} has no endpoint {name}; it has: {}",
                known.join(", ")
            )));
        };
        let names = names();
        if let Some(unknown) = table.keys().find(|key| !names.contains(key)) {
            return Err(Failure::usage(format!(
                "{shown}, endpoint {name}: unknown option {unknown}; there are {}",
                names.join(", ")
            )));
        }
        let values = table.into_iter().map(|(key, value)| {
            let text = match value {
                toml::Value::String(text) => text,
                other => other.to_string(),
            };
            (key, text)
        });
        Self::parse(values)
            .map_err(|what| Failure::usage(format!("{shown}, endpoint {name}: {what}")))
    }

    fn parse(values: impl Iterator<Item = (String, String)>) -> Result<Self, String> {
        let arguments = values.map(|(name, value)| format!("--{name}={value}"));
        let elsewhere = Elsewhere::command()
            .try_get_matches_from(arguments)
            .and_then(|matches| Elsewhere::from_arg_matches(&matches));
        elsewhere
            .map(|elsewhere| elsewhere.options)
            .map_err(|error| one_line(&error))
    }
}

/// Returns an option in the environment.
fn variable(name: &str) -> Option<String> {
    let value = std::env::var(format!("MODIO_{name}")).ok();
    value.filter(|value| !value.is_empty())
}

/// Returns clap's message as one line, without its heading and the usage.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.to_string();
    let is_about_error = |line: &&str| {
        let starts = ["Usage:", "For more information"];
        !starts.iter().any(|start| line.starts_with(start))
    };
    let lines = text.lines().take_while(is_about_error).map(str::trim);
    let lines: Vec<_> = lines.filter(|line| !line.is_empty()).collect();
    let line = lines.join(" ").replace(" tip: ", "; ");
    line.trim_start_matches("error: ").to_owned()
}

/// Returns the default file of named endpoints: `modio/endpoints.toml` in the system's directory for settings.
pub fn usual_file() -> Result<PathBuf, Failure> {
    let strategy = etcetera::choose_base_strategy()
        .map_err(|_| Failure::usage("there is no home directory: give --endpoints FILE"))?;
    Ok(strategy.config_dir().join("modio").join("endpoints.toml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(values: &str) -> Result<Options, String> {
        let values = values
            .split(' ')
            .map(|value| value.split_once('=').unwrap());
        Options::parse(values.map(|(name, value)| (name.to_owned(), value.to_owned())))
    }

    #[test]
    fn an_option_has_priority_over_that_of_a_file() {
        let given = parse("tcp=a:1 baud=19200").unwrap();
        let file = parse("port=COM3 baud=1200 unit=9").unwrap();
        let endpoint = given.or(file).endpoint(None, None).unwrap();
        assert_eq!(endpoint.place, Place::Tcp("a:1".to_owned()));
        assert_eq!((endpoint.baud, endpoint.unit), (19_200, 9));
        assert_eq!(endpoint.timeout, Duration::from_secs(1));
    }

    #[test]
    fn a_wrong_value_is_reported_with_its_option() {
        let wrong = parse("unit=300").unwrap_err();
        let right = wrong.contains("--unit") && wrong.contains("1 to 247");
        assert!(right, "{wrong}");
        assert!(parse("port=a tcp=b:1").is_err());
        let seven = parse("port=a format=7E1").unwrap();
        assert!(seven.endpoint(None, None).is_err(), "RTU with 7 data bits");
    }

    #[test]
    fn a_wrong_value_is_reported_in_one_line_with_an_example() {
        for (given, example) in [
            ("baud=abc", "from 50 to 4000000 is needed, such as 9600"),
            ("baud=1", "from 50 to 4000000 is needed, such as 9600"),
            ("retries=x", "from 0 to 20 is needed, such as 2"),
            ("tcp=localhost", "is needed, such as localhost:502"),
            (
                "modbus-tcp=a:b",
                "a host with a port is needed, such as a:502",
            ),
            ("tcp=:502", "is needed, such as 192.168.1.5:502"),
            ("timeout=abc", "from 1ms to 1h is needed, such as 200ms"),
            ("mode=x", "[possible values: rtu, ascii]"),
        ] {
            let wrong = parse(given).unwrap_err();
            let (option, value) = given.split_once('=').unwrap();
            assert!(wrong.starts_with(&format!("invalid value '{value}' for '--{option}")));
            assert!(wrong.ends_with(example), "{wrong}");
            assert_eq!(wrong.lines().count(), 1, "{wrong}");
        }
        assert!(parse("modbus-tcp=[::1]:502").is_ok());
    }

    #[test]
    fn times_are_seconds_or_have_a_unit() {
        assert_eq!(duration("0.2"), Ok(Duration::from_millis(200)));
        assert_eq!(duration("20ms"), Ok(Duration::from_millis(20)));
        for wrong in ["", "x", "-1", "0", "2h", "1e99"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }
}
