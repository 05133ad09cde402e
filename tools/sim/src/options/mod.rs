//! The command-line options of the simulator.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use register_map::{Module, Row, board::MODIO_02};

use crate::Corner;
use crate::line::Settings;

mod files;
mod fitting;
mod terminals;
mod values;

pub use files::Files;
pub use fitting::{Fitting, toml_error};
pub use values::slot;
use values::{OfBoard, address, line, of_board, unit};

/// Whether the simulator has pseudo-terminals on this system. macOS has them, too, but they were never tested there.
pub const PTY: bool = cfg!(all(unix, not(target_os = "macos")));

/// The options of the simulator's command line.
#[derive(clap::Args, Clone, Debug, PartialEq, Eq)]
#[group(skip)]
pub struct Options {
    /// DIP switch SW01 as a number, 0 to 255: the unit address
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub dip: u8,

    /// Type of the board
    #[arg(long, value_name = "NAME", default_value_t = &MODIO_02)]
    #[arg(help = format!("Type of the board: {}", Row::ALL.map(|board| board.name).join(", ")))]
    pub board: &'static Row,

    /// Module in the board's first slot
    #[arg(long, value_name = "NAME", default_value = "4di")]
    #[arg(help = format!("Module in the board's first slot: {}", Module::ALL.map(Module::name).join(", ")))]
    pub module: Module,

    /// Module in the slot at a port, such as 3=4do; may be repeated, and overrides --module for the first slot
    #[arg(long = "slot", value_name = "PORT=MODULE", value_parser = slot)]
    pub slots: Vec<(u8, Module)>,

    /// Board on an RS-485 line with several boards, repeated: its unit address and the module in its first slot, such
    /// as 5:4do; without a module, that of --module
    #[arg(long = "unit", value_name = "N[:MODULE]", value_parser = unit)]
    #[arg(conflicts_with_all = ["dip", "slots", "flash", "gdb", "exact_line"])]
    pub units: Vec<(u8, Option<Module>)>,

    /// Several boards on one RS-485 line, from a TOML file with a table for each: name, board, dip, module, slots,
    /// flash
    #[arg(long, value_name = "FILE")]
    #[arg(conflicts_with_all = ["units", "board", "dip", "module", "slots", "flash", "gdb", "exact_line"])]
    pub bus: Option<PathBuf>,

    /// Corner of the part (its clocks, its ADC, the time of instructions and radio packets): nominal, slow, fast or gd32
    #[arg(long, value_name = "NAME", default_value = "nominal")]
    pub corner: Corner,

    /// Store the modules of all slots in the configuration, and with --lora that the radio is on, if nothing is stored
    /// yet (default)
    #[arg(long, overrides_with = "no_preset")]
    preset: bool,

    /// Do not change the stored configuration
    #[arg(long)]
    no_preset: bool,

    /// Keep the flash in FILE, so that stored settings survive; the file is made if it does not exist
    #[arg(long, value_name = "FILE")]
    pub flash: Option<PathBuf>,

    /// Make LINK a symlink to the pseudo-terminal of the RS-485 line
    #[arg(long, value_name = "LINK")]
    pub pty: Option<PathBuf>,

    /// Also offer the RS-485 line as raw bytes over TCP, at HOST:PORT
    #[arg(long, value_name = "ADDR", value_parser = address)]
    pub tcp: Option<SocketAddr>,

    /// Serve Modbus TCP at HOST:PORT, as a gateway to the RS-485 line: the unit identifier is the unit address
    #[arg(long, value_name = "ADDR", value_parser = address)]
    pub modbus_tcp: Option<SocketAddr>,

    /// Write every frame on the RS-485 line to FILE as pcapng, for Wireshark; a file that exists is replaced
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,

    /// Offer the RS-485 line in virtual time at HOST:PORT, by the exact-line protocol of docs/conformance.md. Time
    /// stands still between its requests, so the endpoints that follow the wall clock are not offered
    #[arg(long, value_name = "ADDR", value_parser = address, conflicts_with_all = ["pty", "tcp", "modbus_tcp", "gdb", "lora", "rs232"])]
    pub exact_line: Option<SocketAddr>,

    /// Fit a LoRa module to every board, and make LINK a symlink to a second pseudo-terminal: the serial side, 9600
    /// 8N1, of a gateway radio on the same air
    #[arg(long, value_name = "LINK")]
    pub lora: Option<PathBuf>,

    /// Make LINK a symlink to a pseudo-terminal of the RS-232 socket of an fx3u, with 9600 8N1; not with several boards
    #[arg(long, value_name = "LINK", conflicts_with_all = ["units", "bus"])]
    pub rs232: Option<PathBuf>,

    /// Rate and format of the line's client, such as 9600,7N2, whatever the unit does. Without this option the client
    /// has the rate and format of the unit, except 7N2: the unit's UART is set to 8N1 then
    #[arg(long, value_name = "RATE,FORMAT", value_parser = line)]
    pub line: Option<Settings>,

    /// Let the line's client keep its own rate and format, as on a real bus: the rate that the master sets on the
    /// pseudo-terminal, and the format that the unit has at the start. Also let the gateway radio of --lora keep its
    /// factory parameters
    #[arg(long, conflicts_with = "line")]
    pub fixed_line: bool,

    /// Change inputs, power and faults at given times, by a TOML file with a table for each step
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,

    /// Address of the HTTP interface, HOST:PORT; with port 0 the system chooses a free port
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8502", value_parser = address)]
    pub http: SocketAddr,

    /// Serve GDB on the core, at HOST:PORT
    #[arg(long, value_name = "ADDR", value_parser = address)]
    pub gdb: Option<SocketAddr>,

    /// Start with this loader (an ELF file) instead of building one; with BOARD= only boards of that type; may be
    /// repeated
    #[arg(long, value_name = "[BOARD=]FILE", value_parser = of_board)]
    pub loader: Vec<OfBoard>,

    /// Write this image into the slot that it is for instead of building one: the file of an update (.modio, the image
    /// for slot A), or of one slot (.image). The signature is not checked, as if the unit had been started once
    #[arg(long, value_name = "[BOARD=]FILE", value_parser = of_board)]
    pub image: Vec<OfBoard>,

    /// Write loader and image again into a flash file that an update over the line has changed
    #[arg(long, requires = "flash")]
    pub reflash: bool,

    /// Run the image that needs no loader, as on a board that is not updated over the line
    #[arg(long, conflicts_with_all = ["loader", "image", "reflash"])]
    pub no_loader: bool,

    /// Run this image (an ELF file) alone, without loader; with BOARD= only on boards of that type; may be repeated
    #[arg(long, value_name = "[BOARD=]FILE", value_parser = of_board)]
    pub elf: Vec<OfBoard>,

    /// Print the files that the options do not name, such as "loader modio-02", and end: `cargo xtask sim` builds them
    #[arg(long, hide = true)]
    pub missing_files: bool,

    /// Stop after this much time, such as 10s or 2m
    #[arg(long = "for", value_name = "DURATION", value_parser = humantime::parse_duration)]
    pub run_for: Option<Duration>,
}

impl Options {
    /// Returns whether to store the modules of all slots in the configuration if nothing is stored yet.
    #[must_use]
    pub fn preset(&self) -> bool {
        !self.no_preset
    }
}

/// Returns the error of a command line as one line, without clap's hints and usage text.
#[must_use]
pub fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let what: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.is_empty())
        .collect();
    let what = what.join(" ");
    what.strip_prefix("error: ").unwrap_or(&what).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use register_map::codes;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        options: Options,
    }

    pub fn parse(arguments: &[&str]) -> Result<Options, String> {
        Cli::try_parse_from(std::iter::once(&"sim").chain(arguments))
            .map(|cli| cli.options)
            .map_err(|error| one_line(&error))
    }

    #[test]
    fn default_is_unit_1_with_a_4di_and_a_preset() {
        let options = parse(&[]).unwrap();
        assert_eq!((options.dip, options.module), (1, Module::Di4));
        assert_eq!(options.corner, Corner::Nominal);
        assert_eq!(options.http, "127.0.0.1:8502".parse().unwrap());
        assert!(options.preset());
        assert_eq!((options.pty, options.tcp), (None, None));
        assert!(options.elf.is_empty() && options.units.is_empty());
        assert!(options.loader.is_empty() && options.image.is_empty());
        assert_eq!((options.bus, options.scenario), (None, None));
        assert!(!options.fixed_line);
        assert_eq!((options.flash, options.gdb), (None, None));
        assert_eq!((options.modbus_tcp, options.record), (None, None));
        assert_eq!((options.exact_line, options.line), (None, None));
        assert_eq!((options.lora, options.rs232), (None, None));
        assert_eq!(options.run_for, None);
    }

    #[test]
    fn every_module_and_every_dip_value_is_accepted() {
        for module in Module::ALL {
            assert_eq!(parse(&["--module", module.name()]).unwrap().module, module);
        }
        for dip in 0..=255_u8 {
            assert_eq!(parse(&["--dip", &dip.to_string()]).unwrap().dip, dip);
        }
    }

    #[test]
    fn slot_option_names_port_and_module() {
        assert_eq!(parse(&[]).unwrap().board.name, "modio-02");
        let arguments = ["--board", "modio-08", "--slot", "1=4do", "--slot", "4=none"];
        let options = parse(&arguments).unwrap();
        assert_eq!(options.board.name, "modio-08");
        assert_eq!(options.slots, [(1, Module::Do4), (4, Module::None)]);
    }

    #[test]
    fn unit_option_names_an_address_and_optionally_a_module() {
        let units = parse(&["--unit", "5:4do", "--unit", "6"]).unwrap().units;
        assert_eq!(units, [(5, Some(Module::Do4)), (6, None)]);
    }

    #[test]
    fn last_one_of_preset_and_no_preset_counts() {
        assert!(!parse(&["--no-preset"]).unwrap().preset());
        assert!(parse(&["--no-preset", "--preset"]).unwrap().preset());
        assert!(!parse(&["--preset", "--no-preset"]).unwrap().preset());
    }

    #[test]
    fn line_option_accepts_every_format_of_the_register_map() {
        for (_, name) in codes::Format::NAMES {
            let text = format!("19200,{}", name.to_lowercase());
            let line = parse(&["--line", &text]).unwrap().line.unwrap();
            assert_eq!((line.baud, line.format.name()), (19_200, *name));
        }
    }

    #[test]
    fn for_option_accepts_a_duration_with_units() {
        let run_for = |text| parse(&["--for", text]).map(|options| options.run_for);
        assert_eq!(run_for("10s"), Ok(Some(Duration::from_secs(10))));
        assert_eq!(run_for("1m 500ms"), Ok(Some(Duration::from_millis(60_500))));
        assert!(run_for("soon").unwrap_err().contains("'soon'"));
    }

    #[test]
    fn wrong_value_is_reported_in_one_line() {
        for (arguments, part) in [
            (&["--dip", "256"][..], "256 is not in 0..=255"),
            (&["--module", "8di"][..], "one of none, 4di"),
            (&["--corner", "hot"][..], "nominal, slow, fast or gd32"),
            (&["--tcp", "nowhere"][..], "not an address"),
            (&["--http", "127.0.0.1:99999"][..], "not an address"),
            (&["--flash"][..], "--flash <FILE>"),
            (&["--gdb", "x"][..], "not an address"),
            (&["--exact-line", "x"][..], "not an address"),
            (&["--modbus-tcp", "502"][..], "not an address"),
            (&["--modbus-tcp"][..], "--modbus-tcp <ADDR>"),
            (&["--record"][..], "--record <FILE>"),
            (
                &["--exact-line", "127.0.0.1:0", "--pty", "x"][..],
                "cannot be used with",
            ),
            (
                &["--exact-line", "127.0.0.1:0", "--tcp", "127.0.0.1:0"][..],
                "cannot be used with",
            ),
            (
                &["--exact-line", "127.0.0.1:0", "--modbus-tcp", "127.0.0.1:0"][..],
                "cannot be used with",
            ),
            (
                &["--exact-line", "127.0.0.1:0", "--gdb", "127.0.0.1:0"][..],
                "cannot be used with",
            ),
            (
                &["--exact-line", "127.0.0.1:0", "--lora", "x"][..],
                "cannot be used with",
            ),
            (
                &["--exact-line", "127.0.0.1:0", "--rs232", "x"][..],
                "cannot be used with",
            ),
            (&["--unit", "5", "--rs232", "x"][..], "cannot be used with"),
            (&["--bus", "x", "--rs232", "x"][..], "cannot be used with"),
            (&["--lora"][..], "--lora <LINK>"),
            (&["--board", "nucleo"][..], "modio-02, modio-08"),
            (&["--slot", "4do"][..], "3=4do"),
            (&["--slot", "x=4do"][..], "3=4do"),
            (&["--slot", "3=8di"][..], "one of none, 4di"),
            (&["--pty"][..], "--pty <LINK>"),
            (&["--line", "9600"][..], "9600,7N2"),
            (&["--unit", "x"][..], "5:4do"),
            (&["--unit", "256"][..], "5:4do"),
            (&["--unit", "5:8di"][..], "one of none, 4di"),
            (&["--unit", "5", "--dip", "5"][..], "cannot be used with"),
            (&["--unit", "5", "--bus", "x"][..], "cannot be used with"),
            (
                &["--bus", "x", "--module", "4do"][..],
                "cannot be used with",
            ),
            (
                &["--fixed-line", "--line", "9600,8N2"][..],
                "cannot be used with",
            ),
            (&["--elf", ""][..], "name of a file"),
            (&["--elf", "modio-02="][..], "name of a file"),
            (&["--no-loader", "--image", "x"][..], "cannot be used with"),
            (&["--reflash"][..], "--flash <FILE>"),
            (&["--line", "9600,7N1"][..], "9600,7N2"),
            (&["--line", "100,8N2"][..], "9600,7N2"),
        ] {
            let text = parse(arguments).unwrap_err();
            assert!(text.contains(part), "{arguments:?}: {text}");
            assert!(!text.contains('\n'), "{text:?}");
        }
    }
}
