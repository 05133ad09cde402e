//! `modioctl address`.

use modbus_line::adu::pdu;
use modbus_line::names;

use super::hex;
use crate::bus::{Lost, Master, check_line};
use crate::cli::Address;
use crate::commands::note::Note;
use crate::device::place;
use crate::failure::Failure;
use crate::output;

/// Register of the unit address for clients of function 70: it is stored, and in force after the reply.
const UNIT: u16 = register_map::name::UNIT_BY_SERIAL;

/// Sets the address of the unit with this serial number.
pub async fn run(mut master: Master, options: &Address, note: &Note) -> Result<(), Failure> {
    check_line(master.endpoint())?;
    let (serial, unit) = (hex(options.serial), options.unit);
    let write = pdu(6, UNIT, unit.into());
    note.set(format_args!(
        "it may have address {unit} now: `modioctl scan --fast` shows the addresses"
    ));
    let result = master.ask_serial(options.serial, &write).await;
    if result.is_ok() {
        note.set("");
    }
    match result {
        Ok(reply) => match reply[..] {
            [_, 2] => Err(Failure::Refused(format!(
                "unit {serial} has a switch for its address: for address {unit} set {} of SW01 to ON and all others to OFF, then switch the power off and on",
                positions(unit)
            ))),
            [_, code] => Err(Failure::Refused(format!(
                "unit {serial} refuses the address with exception {code:02X} ({}): try again in a minute, when it may save again",
                names::exception(code).unwrap_or("unknown exception")
            ))),
            _ => output::line(format_args!("unit {serial} has address {unit}")),
        },
        Err(lost) => Err(failure(&serial, &lost, &place(master.endpoint()))),
    }
}

/// Describes the positions of SW01 that are ON for an address.
fn positions(unit: u8) -> String {
    let on = (1..=8).filter(|position| unit >> (position - 1) & 1 == 1);
    let on: Vec<_> = on.map(|position| position.to_string()).collect();
    match on.as_slice() {
        [only] => format!("position {only}"),
        _ => format!("positions {}", on.join(", ")),
    }
}

fn failure(serial: &str, lost: &Lost, place: &str) -> Failure {
    match lost {
        Lost::Silent | Lost::Absent(_) => Failure::NoAnswer(format!(
            "unit {serial} does not answer at {place}: `modioctl scan --fast` lists the serial numbers of the units on the line"
        )),
        Lost::Garbled(_) => Failure::Garbled(format!(
            "something answers at {place}, but garbled: wrong rate or format, two units with serial number {serial} (set SERIAL_LOW in one of them), or no termination"
        )),
        Lost::Broken(error) => Failure::Port(format!("{place} is lost ({error})")),
    }
}

#[cfg(test)]
mod tests {
    use super::positions;

    #[test]
    fn positions_are_the_binary_digits_of_the_address() {
        assert_eq!(positions(1), "position 1");
        assert_eq!(positions(17), "positions 1, 5");
        assert_eq!(positions(247), "positions 1, 2, 3, 5, 6, 7, 8");
    }
}
