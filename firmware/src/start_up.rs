//! Decisions that the device makes once, when it starts.

use modbus_server::{crc, fast::Part};

use crate::config::LineConfig;

/// Meaning of the position of DIP switch SW01.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Address {
    /// Serve the line as this unit, 1 to 247.
    Unit(u8),
    /// Serve the line as unit [`RECOVERY_UNIT`] with the factory's line settings, so that a unit with unknown
    /// settings can be reached.
    Recovery,
    /// Not a unit address (0 and 248 to 253, without a loader 254, too): blink the fault LED, and take part only in scans
    /// with function 70 and in requests by serial number.
    Invalid,
}

/// The unit address of recovery mode.
pub const RECOVERY_UNIT: u8 = 255;

impl Address {
    /// Returns the meaning of the switch's number. Behind the loader, 254 has chosen the other image at power-on, and
    /// serves as 255 does.
    #[must_use]
    pub const fn from_dip(dip: u8, has_loader: bool) -> Self {
        match dip {
            1..=247 => Self::Unit(dip),
            254 if has_loader => Self::Recovery,
            RECOVERY_UNIT => Self::Recovery,
            0 | 248..=254 => Self::Invalid,
        }
    }

    /// Returns the unit address, if there is one.
    #[must_use]
    pub const fn unit(self) -> Option<u8> {
        match self {
            Self::Unit(unit) => Some(unit),
            Self::Recovery => Some(RECOVERY_UNIT),
            Self::Invalid => None,
        }
    }
}

/// Returns the serial number for function 70: in the range that the extension leaves to everyone, with a hash of the
/// unique identity, or `low` if that is not 0 (SERIAL_LOW, for two units with the same hash).
#[must_use]
pub fn serial_number(unique_id: [u16; 6], low: u16) -> u32 {
    let hash = unique_id.iter().fold(crc::START, |hash, word| {
        let [low, high] = word.to_le_bytes();
        crc::step(crc::step(hash, low), high)
    });
    0x0D00_0000 | u32::from(if low == 0 { hash } else { low })
}

/// Returns what a unit takes part in with function 70. `accurate`: its clock is a crystal's.
#[must_use]
pub const fn part(address: Address, accurate: bool) -> Part {
    match address {
        _ if !accurate => Part::Requests,
        Address::Unit(_) => Part::Everything,
        Address::Recovery => Part::Scans,
        Address::Invalid => Part::NoEvents,
    }
}

/// Returns the line settings to use: the configured ones, or the factory settings in recovery mode.
#[must_use]
pub const fn line(address: Address, configured: LineConfig) -> LineConfig {
    match address {
        Address::Unit(_) | Address::Invalid => configured,
        Address::Recovery => LineConfig::FACTORY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_switch_position_has_the_documented_meaning() {
        for dip in 0..=255u8 {
            let expected = match dip {
                1..=247 => Some(dip),
                255 => Some(255),
                _ => None,
            };
            assert_eq!(Address::from_dip(dip, false).unit(), expected, "{dip}");
            if dip != 254 {
                let both = [true, false].map(|loader| Address::from_dip(dip, loader));
                assert_eq!(both[0], both[1], "{dip}");
            }
        }
        assert_eq!(Address::from_dip(255, false), Address::Recovery);
        assert_eq!(Address::from_dip(254, true), Address::Recovery);
    }

    #[test]
    fn serial_number_is_a_hash_of_the_identity_or_set() {
        let id = [0x0031, 0x0047, 0x5107, 0x3530, 0x3930, 0x3836];
        let number = serial_number(id, 0);
        assert_eq!(number >> 16, 0x0D00);
        assert_ne!(
            number,
            serial_number([0x0032, 0x0047, 0x5107, 0x3530, 0x3930, 0x3836], 0)
        );
        assert_eq!(serial_number(id, 0x1234), 0x0D00_1234);
    }

    #[test]
    fn recovery_mode_uses_the_factory_line_settings() {
        let configured = LineConfig {
            baud: 115_200,
            ..LineConfig::FACTORY
        };
        assert_eq!(line(Address::Unit(1), configured), configured);
        assert_eq!(line(Address::Recovery, configured), LineConfig::FACTORY);
    }
}
