//! The settings of a radio, and the module's parameters for them.

/// The settings of a [`Lora`](crate::Lora). Two radios understand each other when address, channel and air rate are
/// the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoraSettings {
    /// ADDH, ADDL, SPED, CHAN, OPTION (manual of the E32-433T20D, 7.5).
    parameters: [u8; PARAMETERS],
}

/// Number of bytes of a module's parameters.
pub(super) const PARAMETERS: usize = 5;

/// SPED without the air rate: the UART at 9600 bit/s (bits 5 to 3) without parity (manual of the E32-433T20D, 7.5).
const SPEED: u8 = 3 << 3;
/// OPTION without the power: push-pull outputs and forward error correction. The other bits are 0: transparent
/// transmission, shortest wake-up time (7.5).
const OPTION: u8 = 1 << 6 | 1 << 2;

impl LoraSettings {
    /// Returns these settings, or `None` when one is out of its range.
    ///
    /// - `address`: any. 0xFFFF receives from and sends to all addresses of the channel.
    /// - `channel`: 0 to 31, for 410 to 441 MHz.
    /// - `air_rate`: 0 to 5, for 0.3, 1.2, 2.4, 4.8, 9.6, 19.2 kbit/s.
    /// - `power`: 0 to 3, for 20, 17, 14, 10 dBm.
    #[must_use]
    pub const fn new(address: u16, channel: u8, air_rate: u8, power: u8) -> Option<Self> {
        if channel > 31 || air_rate > 5 || power > 3 {
            return None;
        }
        let [high, low] = address.to_be_bytes();
        Some(Self {
            parameters: [high, low, SPEED | air_rate, channel, OPTION | power],
        })
    }

    /// Returns the longest time that a packet of 58 bytes is on the air, in milliseconds: 4800 at 0.3 kbit/s. The manual
    /// gives only the air rate. This is the time of 58 bytes and 32 more for preamble and header, doubled: 600 at 2.4
    /// kbit/s. For a similar module (manual of the E220, chapter 6) the maker gives a delay of 1.5 s for 100 bytes.
    #[must_use]
    pub fn packet_ms(&self) -> u16 {
        const PACKET_MS: [u16; 6] = [4_800, 1_200, 600, 300, 150, 75];
        let [_, _, speed, _, _] = self.parameters;
        let ms = PACKET_MS.get(usize::from(speed & 7));
        ms.copied().unwrap_or_default()
    }

    /// Returns the module's parameters for these settings: ADDH, ADDL, SPED, CHAN, OPTION (7.5).
    #[must_use]
    pub const fn parameters(&self) -> &[u8; PARAMETERS] {
        &self.parameters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_of_the_register_map_are_the_factory_parameters() {
        let settings = LoraSettings::new(0, 23, 2, 0).unwrap();
        assert_eq!(*settings.parameters(), [0x00, 0x00, 0x1A, 0x17, 0x44]);
    }

    #[test]
    fn every_setting_has_its_place() {
        let settings = LoraSettings::new(0x1234, 31, 5, 3).unwrap();
        assert_eq!(*settings.parameters(), [0x12, 0x34, 0x1D, 0x1F, 0x47]);
    }

    #[test]
    fn time_of_a_packet_is_twice_that_of_its_bits() {
        for (air_rate, bits_per_second) in (0..).zip([300, 1_200, 2_400, 4_800, 9_600, 19_200]) {
            let ms = LoraSettings::new(0, 0, air_rate, 0).unwrap().packet_ms();
            assert_eq!(u32::from(ms), 2 * (58 + 32) * 8 * 1000 / bits_per_second);
        }
    }

    #[test]
    fn a_setting_out_of_range_is_refused() {
        assert_eq!(LoraSettings::new(0, 32, 0, 0), None);
        assert_eq!(LoraSettings::new(0, 0, 6, 0), None);
        assert_eq!(LoraSettings::new(0, 0, 0, 4), None);
    }
}
