//! Limits of a description. They leave room for many times the registers of today's units.

use crate::{Description, Reading, Register, Scope};

/// Longest name, version or code of a unit, in bytes.
pub const NAME: usize = 64;
/// Longest text about a register, in bytes.
pub const ABOUT: usize = 512;
/// Most names of the codes or bits of one value, and most values of one set.
pub const CODES: usize = 64;
/// Largest power of ten of a step, and of its reciprocal.
pub const EXPONENT: u8 = 18;
/// Most registers: each run with its count, at least one for each port or point that it belongs to.
pub const REGISTERS: u32 = 4096;
/// Most ports.
pub const PORTS: u8 = 8;
/// Points of a port.
const CHANNELS: u16 = 4;

/// Returns whether a character can control a terminal, break a line or reverse the direction of the text after it.
pub fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{061C}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}'
        )
        || matches!(c, '\u{2066}'..='\u{2069}' | '\u{FEFF}')
}

/// Checks the ports, the addresses and the number of registers.
///
/// # Errors
///
/// A text that names the limit.
pub fn check(description: &Description) -> Result<(), String> {
    let mut last = 0;
    for port in &description.ports {
        if port.number <= last || port.number > PORTS {
            let number = port.number;
            return Err(format!("port {number}: ports ascend from 1 to {PORTS}"));
        }
        last = port.number;
    }
    // Points of a table that a later version adds may be wider than a register.
    let kinds = description.kinds.iter().filter(|kind| kind.table.is_some());
    for Reading { min, max, .. } in kinds.flat_map(|kind| &kind.readings) {
        let highest = if *min < 0 {
            i16::MAX.into()
        } else {
            u16::MAX.into()
        };
        if *min < i16::MIN.into() || *max > highest {
            return Err(format!("{min} to {max} is no range of a register"));
        }
    }
    let mut all = 0;
    for register in &description.registers {
        let span = span(register);
        if register.count == 0 || u32::from(register.address) + span > 0x1_0000 {
            let Register { address, count, .. } = register;
            return Err(format!("{count} registers at address {address:#06X}"));
        }
        all += span;
        if all > REGISTERS {
            return Err(format!("more than {REGISTERS} registers"));
        }
    }
    Ok(())
}

/// Returns the number of registers in a run: its count, but not less than its values need.
fn span(register: &Register) -> u32 {
    let words = u32::from(register.value.registers());
    let values = match register.scope {
        Scope::Unit => 1,
        Scope::Port => u32::from(PORTS),
        Scope::Point => u32::from(PORTS) * u32::from(CHANNELS),
    };
    u32::from(register.count).max(values * words)
}
