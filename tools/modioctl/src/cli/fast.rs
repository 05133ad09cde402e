//! The commands of Fast Modbus, function 70.

use clap::Args;

use super::{List, times, units};

/// Print the events of units.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
Fast Modbus (function 70) in RTU: units report what has changed, and one request fetches the events of all of them. A \
change is printed once, and none is lost while the unit has room for 32 edges; events that waited before the command began \
come first. Only one program can fetch events on a line.

Fetching counts as traffic: it keeps the outputs of a unit with COMM_TIMEOUT alive, unless COMM_SOURCE is 1 or 3. Events \
of units of other makers are printed too, but this command does not switch them on. With units of several makers on one \
line replies may collide: their arbitration can differ.")]
pub struct Events {
    /// Addresses of the units, such as 1-3,7; default: all units that a scan with function 70 finds
    #[arg(long, value_name = "LIST", value_parser = units)]
    pub units: Option<List<u8>>,
    /// Points whose events go before those of other points
    #[arg(long, value_enum, default_value_t)]
    pub high: High,
    /// Number of events to print
    #[arg(long, value_name = "N", value_parser = times)]
    pub count: Option<u64>,
}

/// Points with high priority.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum High {
    /// Digital inputs
    #[default]
    Inputs,
    /// All points
    All,
    /// No points
    None,
}

/// Set the unit address of a unit.
#[derive(Args, Clone, Debug)]
#[command(after_help = "\
The unit is found by its serial number, also when two units have the same address: see `modioctl scan --fast`. Units with \
a switch for their address refuse; the error says which of its positions must be ON.")]
pub struct Address {
    /// Serial number in hexadecimal, such as 0D00A1B2
    #[arg(value_name = "SERIAL", value_parser = serial)]
    pub serial: u32,
    /// The new address, 1 to 247
    // The ID `unit` belongs to the global option --unit.
    #[arg(id = "address", value_name = "N", value_parser = clap::value_parser!(u8).range(1..=247))]
    pub unit: u8,
}

fn serial(text: &str) -> Result<u32, String> {
    let digits = text.strip_prefix("0x").or(text.strip_prefix("0X"));
    let digits = digits.unwrap_or(text);
    // The function of the standard library also accepts a sign.
    let number = u32::from_str_radix(digits, 16).ok();
    number
        .filter(|_| !digits.starts_with('+'))
        .ok_or_else(|| format!("{text:?} is not a serial number in hexadecimal, such as 0D00A1B2"))
}

#[cfg(test)]
mod tests {
    use super::serial;

    #[test]
    fn a_serial_number_is_hexadecimal() {
        assert_eq!(serial("0D00A1b2"), Ok(0x0D00_A1B2));
        assert_eq!(serial("0x1EB37"), Ok(0x0001_EB37));
        for wrong in ["", "0x", "+1", "-1", "G", "100000000"] {
            assert!(serial(wrong).is_err(), "{wrong}");
        }
    }
}
