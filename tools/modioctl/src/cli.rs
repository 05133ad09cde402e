//! The command line.

mod fast;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use register_map::codes::{Baud, Format};

use crate::bus::Options;
use crate::bus::endpoint::{RATES, duration};
use crate::export::ExportFormat;
use crate::names::port_number;

pub use fast::{Address, Events, High};

/// Finds, sets up, watches and updates modio units over Modbus
#[derive(Parser, Debug)]
#[command(name = "modioctl", version, max_term_width = 100)]
#[command(after_help = "\
Exit status: 0 done; 1 the unit refused; 2 wrong usage; 3 no answer (also 0A and 0B of a gateway); 4 garbled answers; \
5 the port cannot be opened; 130 stopped with Ctrl-C.

Options of the endpoint may also stand in the environment (MODIO_PORT, MODIO_BAUD, ...), or under a name in a file:
`--at office` takes those of [office] in endpoints.toml, where the system keeps settings (Linux: ~/.config/modio/).")]
pub struct Cli {
    /// Address and settings of the unit.
    #[command(flatten)]
    pub endpoint: Options,

    /// Endpoint with this name in the file of endpoints [env: MODIO_AT]
    #[arg(long, global = true, value_name = "NAME", help_heading = "Endpoint")]
    pub at: Option<String>,

    /// The file of named endpoints
    #[arg(long, global = true, value_name = "FILE", help_heading = "Endpoint")]
    pub endpoints: Option<PathBuf>,

    /// Print data as JSON
    #[arg(long, global = true)]
    pub json: bool,

    /// Read the unit's description of its registers again, even if it is stored on this computer
    #[arg(long, global = true)]
    pub refresh: bool,

    /// Print every frame on standard error, in words and with times
    #[arg(long, global = true)]
    pub trace: bool,

    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

const LINK_HELP: &str = "\
p1.1 toggles p2.1                                a button: each press inverts the output
p1.1 toggles p2.1 at each edge                   a switch that is no button: each move inverts the output
p1.1 sets p2.1, p1.1 resets p2.1                 a press switches the output on, off
p1.1 pulses p2.1 for 90s                         a press switches the output on for 90 s
p2.1 follows p1.1, p2.1 inverts p1.1             the output is as the input, or its opposite
p3.1 switches p2.1 on above 18.0 off below 15.0  an analog input, in its unit
p3.1 switches p2.1 on below 15.0 off above 18.0
... if alone                                     the link acts only while the master is gone
none p2.1                                        deletes the links of the output

An output has two links. The command writes the one that has this input, or else a free one. It acts a second later; \
`modioctl config save` keeps it.

`follows`, `inverts` and `switches` hold the output: while such a link acts, a write by a master has no effect. Use \
`toggles` for an output that a master writes, too.";

/// A command.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// List the serial ports of this computer
    Ports,
    /// Look for units on the line
    Scan(Scan),
    /// Show identity, state and counters of the unit
    Info,
    /// Read points and registers
    Read(Read),
    /// Write points and registers
    Write(Write),
    /// Set the module of a slot
    #[command(subcommand)]
    Module(Module),
    /// Read and change the unit's settings
    #[command(subcommand)]
    Config(Config),
    /// List the links of the unit: inputs that switch outputs without a master
    Links,
    /// Let an input switch a digital output of the same unit without a master
    #[command(after_help = LINK_HELP)]
    Link {
        /// The link in words, such as p1.1 toggles p2.1
        #[arg(required = true, value_name = "WORD", allow_negative_numbers = true)]
        words: Vec<String>,
    },
    /// Print values repeatedly, until Ctrl-C
    Watch(Watch),
    /// Print what changes in all units, as soon as it does, until Ctrl-C (Fast Modbus)
    Events(Events),
    /// Set the address of a unit, which is found by its serial number (Fast Modbus)
    Address(Address),
    /// Show the unit on the whole screen: live values, outputs to switch, chart, counters, frames
    Monitor(Monitor),
    /// Send a PDU and show both frames
    Raw(Raw),
    /// Show the frames of other devices on the line, until Ctrl-C, without sending anything
    Sniff(Sniff),
    /// List the unit's points and registers with their meaning
    Describe,
    /// Write a configuration of another system for the unit, or for several units of the line
    Export(Export),
    /// Bring new firmware to the unit, or to several units of the line
    Update(Update),
    /// Restart the unit
    Reboot,
    /// Blink all LEDs of the unit for 10 s
    Identify,
    /// Print a completion script for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

/// Look for units on the line.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Each address has 25 ms to answer. Silent addresses are asked once more, with 150 ms each: about 40 s for all. Ctrl-C keeps \
what was found. With --timeout there is a single pass that waits so long: for a RESPONSE_DELAY above 100 ms, or over the \
air.

--fast takes about 0.2 s for each unit at 9600 bit/s, and also finds units with the same address. It finds units with \
Fast Modbus (function 70) in RTU, such as a modio-08 whose crystal runs, also those of other makers. While units of \
several makers are on the line, a unit may be missing: their arbitration can differ.")]
pub struct Scan {
    /// Let units report themselves with their serial numbers, instead of asking every address
    #[arg(long, conflicts_with = "units")]
    pub fast: bool,
    /// Addresses to ask, such as 1-20,40
    #[arg(long, value_name = "LIST", default_value = "1-247", value_parser = units)]
    pub units: List<u8>,
    /// Rates to try in bit/s, such as 9600,19200, or all; default: that of the endpoint
    #[arg(long, value_name = "LIST", value_parser = rates)]
    pub rates: Option<List<u32>>,
    /// Formats to try, such as 8N2,8E1, or all; default: that of the endpoint. Those with 7 data bits are tried in ASCII
    /// mode
    #[arg(long, value_name = "LIST", value_parser = formats)]
    pub formats: Option<List<modbus_line::Format>>,
}

/// A list in one argument. The parser takes a `Vec` for several arguments.
pub type List<T> = Vec<T>;

fn units(text: &str) -> Result<List<u8>, String> {
    let wrong = || format!("{text:?} is not a list of unit addresses 1 to 247, such as 1-20,40");
    let mut units = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u8>().map_err(|_| wrong());
        let (first, last) = (number(first)?, number(last)?);
        if first == 0 || last > 247 || first > last {
            return Err(wrong());
        }
        units.extend(first..=last);
    }
    units.sort_unstable();
    units.dedup();
    Ok(units)
}

fn rates(text: &str) -> Result<List<u32>, String> {
    if text == "all" {
        let all = Baud::ALL.iter();
        return Ok(all.map(|baud| baud.bits_per_second()).collect());
    }
    let each = text.split(',').map(|part| part.trim().parse::<u32>());
    let rates = each.collect::<Result<Vec<_>, _>>();
    match rates {
        Ok(rates) if rates.iter().all(|rate| RATES.contains(rate)) => Ok(rates),
        _ => Err(format!(
            "{text:?} is not a list of rates such as 9600,19200, nor `all`"
        )),
    }
}

fn formats(text: &str) -> Result<List<modbus_line::Format>, String> {
    let names: Vec<_> = match text {
        "all" => Format::NAMES.iter().map(|(_, name)| *name).collect(),
        text => text.split(',').map(str::trim).collect(),
    };
    names.into_iter().map(str::parse).collect()
}

/// Read points and registers.
#[derive(Args, Debug)]
pub struct Read {
    /// Names such as p5.1, p5.1.filter, BAUD, or addresses such as 0x0010
    #[arg(required = true, value_name = "NAME|ADDR")]
    pub names: Vec<String>,
    /// Print raw numbers as in the registers, without units and names
    #[arg(long)]
    pub raw: bool,
}

/// Write points and registers.
#[derive(Args, Debug)]
pub struct Write {
    /// Values to write, such as p5.1=on, p5.3=12000, BAUD=19200. A setting takes effect immediately or after a
    /// restart, as its register says; it is kept only if it is saved
    #[arg(required = true, value_name = "NAME|ADDR=VALUE", value_parser = assignment)]
    pub values: Vec<(String, String)>,
    /// Write raw numbers as in the registers
    #[arg(long)]
    pub raw: bool,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.trim().to_owned(), value.trim().to_owned()))
        }
        _ => Err(format!("{text:?} is not NAME=VALUE")),
    }
}

/// Set the module of a slot.
#[derive(Subcommand, Debug)]
pub enum Module {
    /// Set the module, save, restart and check the result
    Set {
        /// The port of the slot, such as p5 or 5
        #[arg(id = "slot", value_name = "PORT", value_parser = port)]
        port: u8,
        /// The name of the module
        #[arg(help = format!("The module: {}", register_map::Module::ALL.map(register_map::Module::name).join(", ")))]
        module: String,
    },
}

fn port(text: &str) -> Result<u8, String> {
    let port = port_number(text).filter(|port| (1..=8).contains(port));
    port.ok_or_else(|| "a port is 1 to 8, such as p5 or 5".to_owned())
}

/// The unit's settings.
#[derive(Subcommand, Debug)]
pub enum Config {
    /// Show these settings, or all settings without a name
    Get {
        /// Names such as BAUD, p5.1.filter
        names: Vec<String>,
    },
    /// Change settings; `config save` stores them
    Set {
        /// Such as BAUD=19200
        #[arg(required = true, value_name = "NAME=VALUE", value_parser = assignment)]
        values: Vec<(String, String)>,
    },
    /// Store the settings, so that a restart keeps them
    Save,
    /// Show differences between the settings and a file, or the factory settings
    Diff {
        /// A file that `config export` wrote
        file: Option<PathBuf>,
    },
    /// Write all settings as TOML
    Export {
        /// The file; without it, print on standard output
        file: Option<PathBuf>,
        /// Overwrite an existing file
        #[arg(long)]
        force: bool,
    },
    /// Check all settings of a file, show those that change, then write and save them
    Import {
        /// A file that `config export` wrote
        file: PathBuf,
        /// Do not ask before the module of a port changes
        #[arg(long)]
        yes: bool,
        /// Restart the unit afterwards if a setting needs it
        #[arg(long)]
        restart: bool,
    },
    /// Set all settings to the factory defaults, and save
    Reset {
        /// Restart the unit afterwards
        #[arg(long)]
        restart: bool,
    },
}

/// Print values repeatedly.
#[derive(Args, Debug)]
pub struct Watch {
    /// Names; without them, all points
    pub names: Vec<String>,
    /// Interval between values
    #[arg(long, value_name = "TIME", default_value = "1s", value_parser = duration)]
    pub every: Duration,
    /// Print CSV, for spreadsheets. While the unit does not answer, rows have no values
    #[arg(long, conflicts_with = "json_lines")]
    pub csv: bool,
    /// Print one JSON object per line. While the unit does not answer, values are null
    #[arg(long)]
    pub json_lines: bool,
    /// Print raw numbers as in the registers
    #[arg(long)]
    pub raw: bool,
    /// Number of times to print the values. Rows without values do not count
    #[arg(long, value_name = "N", value_parser = times)]
    pub count: Option<u64>,
}

/// Show the unit on the whole screen.
#[derive(Args, Debug)]
#[command(after_help = "\
Keys: arrows select, Space or Enter switches an output or opens the slider of an analog one, ? shows all keys, q quits.

The monitor sends every request once, so --retries has no effect: polling goes on anyway, and a failed write is repeated \
only when you ask for it. Polling counts as traffic: the unit's communication watchdog does not trip while the monitor \
runs.")]
pub struct Monitor {
    /// Interval at which the points are read, 50ms to 10s
    #[arg(long, value_name = "TIME", default_value = "250ms", value_parser = poll_interval)]
    pub every: Duration,
}

fn poll_interval(text: &str) -> Result<Duration, String> {
    let interval = duration(text)?;
    if (50..=10_000).contains(&interval.as_millis()) {
        Ok(interval)
    } else {
        Err("a time from 50ms to 10s is needed".to_owned())
    }
}

/// Send a PDU.
#[derive(Args, Debug)]
pub struct Raw {
    /// Function code and data in hexadecimal, such as 03 0000 0001; the CRC or LRC is added
    #[arg(required = true, value_name = "PDU-HEX")]
    pub pdu: Vec<String>,
}

/// Show the frames of other devices on the line.
#[derive(Args, Debug)]
pub struct Sniff {
    /// Write a capture file (pcapng) for Wireshark as well
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    pub force: bool,
}

/// Write a configuration of another system for the unit.
#[derive(Args, Debug)]
pub struct Export {
    // The ID `format` belongs to the global option --format.
    /// The system
    #[arg(id = "system", value_name = "SYSTEM", value_enum)]
    pub format: ExportFormat,
    /// Addresses of the units on the line, such as 1-3,7; default: the unit of the endpoint
    #[arg(long, value_name = "LIST", value_parser = units)]
    pub units: Option<List<u8>>,
    /// Name of the line, in front of the names of its units; needed when the system has other lines with modio units
    #[arg(long, value_name = "NAME", value_parser = line_name)]
    pub name: Option<String>,
    /// Write to this file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Overwrite an existing file
    #[arg(long)]
    pub force: bool,
}

/// Bring new firmware to the unit.
#[derive(Args, Debug)]
#[command(after_help = "\
The units serve their points until they restart with the new firmware. It stays once they have reported it over this line; \
otherwise the one before comes back, after half an hour at most. Nothing is sent unless the file suits every unit. After an \
interruption the same command goes on where it stopped.

All units get the same blocks together, by broadcast. When anything answers a broadcast, when broadcasts do not arrive, and \
over Modbus TCP, each unit gets them alone. Over the air use --unicast.")]
pub struct Update {
    /// The file with the firmware, such as modio-02.modio
    #[arg(value_name = "FILE", required_unless_present_any = ["status", "back"])]
    pub file: Option<PathBuf>,
    /// Addresses of the units, such as 1-30; default: the unit of the endpoint
    #[arg(long, value_name = "LIST", value_parser = units)]
    pub units: Option<List<u8>>,
    /// Show what the units run and what their other slots hold
    #[arg(long, conflicts_with = "file")]
    pub status: bool,
    /// Start the firmware that the units ran before, and keep it
    #[arg(long, conflicts_with_all = ["file", "status"])]
    pub back: bool,
    /// Show what is in the file, without a unit
    #[arg(long, conflicts_with_all = ["status", "back", "units", "unicast", "force", "end_first_key", "poll"])]
    pub show: bool,
    /// Send the blocks to each unit alone
    #[arg(long, conflicts_with_all = ["status", "back"])]
    pub unicast: bool,
    /// Also send the firmware to units that run it already, and update units whose settings are not saved, which the
    /// restart loses
    #[arg(long, conflicts_with = "status")]
    pub force: bool,
    /// Let firmware that is signed with the second key of the units end their first key, for good
    #[arg(long, conflicts_with_all = ["status", "back"])]
    pub end_first_key: bool,
    /// Print these points of the endpoint's unit every second between the blocks, such as p5.1,p5.2
    #[arg(
        long,
        value_name = "NAME",
        value_delimiter = ',',
        conflicts_with = "status"
    )]
    pub poll: Vec<String>,
}

/// Parses the number of times of a command.
fn times(text: &str) -> Result<u64, String> {
    match text.parse() {
        Ok(times) if times > 0 => Ok(times),
        _ => Err("a number of times is a whole number from 1 on".to_owned()),
    }
}

fn line_name(text: &str) -> Result<String, String> {
    let is_name = text.chars().any(|c| c.is_ascii_alphanumeric())
        && text.chars().all(crate::export::is_plain)
        && text.len() <= 64;
    if is_name {
        Ok(text.trim().to_owned())
    } else {
        Err(format!(
            "{text:?} is not a name of letters A to Z, digits, spaces and `.`, `_`, `-`, 64 at most"
        ))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn export_and_sniff_parse_with_options_of_the_endpoint() {
        for line in [
            "modioctl --format 8E1 --port a export home-assistant --output b",
            "modioctl --port a sniff --record b --format 8E1 --json",
        ] {
            let cli = Cli::try_parse_from(line.split(' ')).unwrap();
            assert_eq!(cli.endpoint.format.unwrap().to_string(), "8E1");
        }
    }

    #[test]
    fn a_line_has_a_name_that_every_system_takes() {
        assert_eq!(line_name("Hall 2"), Ok("Hall 2".to_owned()));
        let long = "x".repeat(65);
        for wrong in ["", " ", "-", "{{ x }}", "a\nb", "$HOME", "Größe", &long] {
            assert!(line_name(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_port_is_a_number_with_or_without_p() {
        assert_eq!([port("p5"), port("P5"), port("5")], [Ok(5), Ok(5), Ok(5)]);
        for wrong in ["", "p", "0", "9", "p9", "pp5", "p5.1"] {
            assert!(port(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn lists_of_units_are_parsed() {
        assert_eq!(units("3,1-2,2"), Ok(vec![1, 2, 3]));
        for wrong in ["", "0", "248", "5-3", "1-", "x"] {
            assert!(units(wrong).is_err(), "{wrong}");
        }
        assert_eq!(rates("all").unwrap().len(), 11);
        assert!(rates("9600,x").is_err());
        assert_eq!(formats("all").unwrap().len(), 7);
    }
}
