//! The modes and the parameters of the module (manual 6 and 7.5).

use f103::serial::{Format, Settings};
use f103::time::Time;

/// Mode of the module, by its pins M0 and M1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// M0 = 0, M1 = 0: UART and radio are on.
    Normal,
    /// M0 = 1, M1 = 0: as normal, and each packet has a wake-up preamble in front.
    WakeUp,
    /// M0 = 0, M1 = 1: the UART does not receive, and the radio receives only packets with a wake-up preamble.
    PowerSaving,
    /// M0 = 1, M1 = 1: the radio is off, and the UART takes commands at 9600 8N1.
    Sleep,
}

impl Mode {
    /// Returns the mode of these levels at M0 and M1.
    #[must_use]
    pub const fn of_pins(m0: bool, m1: bool) -> Self {
        match (m0, m1) {
            (false, false) => Self::Normal,
            (true, false) => Self::WakeUp,
            (false, true) => Self::PowerSaving,
            (true, true) => Self::Sleep,
        }
    }

    /// Returns the name of the mode in the HTTP interface.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::WakeUp => "wake-up",
            Self::PowerSaving => "power-saving",
            Self::Sleep => "sleep",
        }
    }

    /// Returns whether bytes at the UART are sent over the air.
    #[must_use]
    pub const fn sends(self) -> bool {
        matches!(self, Self::Normal | Self::WakeUp)
    }
}

/// Rate and format of the UART in sleep, whatever is set.
pub(crate) const SLEEP_UART: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};

/// The parameters of a module: ADDH, ADDL, SPED, CHAN and OPTION.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameters([u8; 5]);

impl Default for Parameters {
    /// Returns [`Parameters::FACTORY`].
    fn default() -> Self {
        Self::FACTORY
    }
}

impl Parameters {
    /// State of delivery: address 0, 433 MHz, 2.4 kbit/s, UART 9600 8N1, FEC on, 20 dBm.
    pub const FACTORY: Self = Self([0x00, 0x00, 0x1A, 0x17, 0x44]);

    /// Address that receives from all addresses of its channel, and sends to all of them.
    pub const EVERY_ADDRESS: u16 = 0xFFFF;

    /// Returns the parameters with these bytes. Bits 7 to 5 of CHAN are reserved and become 0.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 5]) -> Self {
        let [high, low, sped, channel, option] = bytes;
        Self([high, low, sped, channel & 0x1F, option])
    }

    /// Returns the five bytes, as in the commands C0 and C2.
    #[must_use]
    pub const fn bytes(self) -> [u8; 5] {
        self.0
    }

    /// Returns the same parameters with another address.
    #[must_use]
    pub const fn with_address(mut self, address: u16) -> Self {
        [self.0[0], self.0[1]] = address.to_be_bytes();
        self
    }

    /// Returns the same parameters with another channel, 0 to 31. Higher bits are ignored.
    #[must_use]
    pub const fn with_channel(mut self, channel: u8) -> Self {
        self.0[3] = channel & 0x1F;
        self
    }

    /// Returns the same parameters with another code of the air rate: bits 2 to 0 of SPED. Higher bits are ignored.
    #[must_use]
    pub const fn with_air_rate_code(mut self, code: u8) -> Self {
        self.0[2] = self.0[2] & !7 | code & 7;
        self
    }

    /// Returns the same parameters, with the UART at 9600 8N1.
    pub(super) const fn with_default_uart(mut self) -> Self {
        self.0[2] = self.0[2] & 7 | 0x18;
        self
    }

    /// Returns the address.
    #[must_use]
    pub const fn address(self) -> u16 {
        u16::from_be_bytes([self.0[0], self.0[1]])
    }

    /// Returns the rate and format of the UART outside sleep.
    #[must_use]
    pub const fn uart(self) -> Settings {
        const BAUD: [u32; 8] = [1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200];
        Settings {
            baud: BAUD[(self.0[2] >> 3 & 7) as usize],
            format: match self.0[2] >> 6 {
                1 => Format::O1,
                2 => Format::E1,
                _ => Format::N1,
            },
        }
    }

    /// Returns the air rate in bit/s.
    #[must_use]
    pub const fn air_rate(self) -> u32 {
        match self.0[2] & 7 {
            0 => 300,
            1 => 1200,
            2 => 2400,
            3 => 4800,
            4 => 9600,
            _ => 19_200,
        }
    }

    /// Returns the channel, 0 to 31.
    #[must_use]
    pub const fn channel(self) -> u8 {
        self.0[3]
    }

    /// Returns the frequency of the channel in MHz, 410 to 441.
    #[must_use]
    pub const fn frequency_mhz(self) -> u16 {
        410 + self.0[3] as u16
    }

    /// Returns whether fixed transmission is on: the first bytes at the UART are then the address and channel of the
    /// receiver.
    #[must_use]
    pub const fn fixed_transmission(self) -> bool {
        self.0[4] & 0x80 != 0
    }

    /// Returns whether TXD and AUX are push-pull outputs. Otherwise they are open-drain outputs.
    #[must_use]
    pub const fn push_pull(self) -> bool {
        self.0[4] & 0x40 != 0
    }

    /// Returns the duration of the wake-up preamble, 250 ms to 2 s.
    #[must_use]
    pub const fn wake_up(self) -> Time {
        Time::from_ms(250 * (1 + (self.0[4] >> 3 & 7) as u64))
    }

    /// Returns whether forward error correction is on.
    #[must_use]
    pub const fn fec(self) -> bool {
        self.0[4] & 4 != 0
    }

    /// Returns the power in dBm: 20, 17, 14 or 10.
    #[must_use]
    pub const fn power_dbm(self) -> u8 {
        [20, 17, 14, 10][(self.0[4] & 3) as usize]
    }

    /// Returns whether a module with these parameters receives the packets of a module with `sender`'s: channel, air
    /// rate, FEC and address are the same. [`Parameters::EVERY_ADDRESS`] matches every address.
    #[must_use]
    pub const fn receive(self, sender: Self) -> bool {
        let same_address = self.address() == sender.address()
            || self.address() == Self::EVERY_ADDRESS
            || sender.address() == Self::EVERY_ADDRESS;
        same_address
            && self.channel() == sender.channel()
            && self.air_rate() == sender.air_rate()
            && self.fec() == sender.fec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factory_parameters_are_those_of_the_manual() {
        let factory = Parameters::default();
        assert_eq!(factory.address(), 0);
        assert_eq!(factory.uart(), SLEEP_UART);
        assert_eq!((factory.air_rate(), factory.frequency_mhz()), (2400, 433));
        assert!(factory.fec() && factory.push_pull() && !factory.fixed_transmission());
        assert_eq!((factory.power_dbm(), factory.wake_up().as_ms()), (20, 250));
    }

    #[test]
    fn every_field_has_its_bits() {
        let all = Parameters::from_bytes([0x12, 0x34, 0b01_111_101, 0xFF, 0b1011_1011]);
        assert_eq!(all.address(), 0x1234);
        assert_eq!((all.uart().baud, all.uart().format), (115_200, Format::O1));
        assert_eq!((all.air_rate(), all.channel()), (19_200, 31));
        assert_eq!(all.frequency_mhz(), 441);
        assert!(all.fixed_transmission() && !all.push_pull() && !all.fec());
        assert_eq!((all.power_dbm(), all.wake_up()), (10, Time::from_secs(2)));
        assert_eq!(all.bytes()[3], 0x1F, "the reserved bits of CHAN are 0");
        let even = Parameters::from_bytes([0, 0, 0b10_000_000, 0, 0]);
        assert_eq!((even.uart().baud, even.uart().format), (1200, Format::E1));
        assert_eq!(even.air_rate(), 300);
        let none = Parameters::from_bytes([0, 0, 0b11_000_111, 0, 0]);
        assert_eq!((none.uart().format, none.air_rate()), (Format::N1, 19_200));
        let slow = all.with_air_rate_code(1).with_default_uart();
        assert_eq!((slow.air_rate(), slow.uart()), (1200, SLEEP_UART));
    }

    #[test]
    fn packet_is_received_with_the_same_channel_rate_fec_and_address() {
        let factory = Parameters::FACTORY;
        assert!(factory.receive(factory));
        assert!(!factory.receive(factory.with_channel(22)));
        assert!(!factory.receive(factory.with_air_rate_code(3)));
        assert!(!factory.receive(Parameters::from_bytes([0, 0, 0x1A, 0x17, 0x40])));
        let [five, every] = [5, 0xFFFF].map(|address| factory.with_address(address));
        assert!(!factory.receive(five) && !five.receive(factory));
        assert!(factory.receive(every) && every.receive(factory));
        // The codes 5 to 7 are the same rate.
        let [fast, also_fast] = [5, 7].map(|code| factory.with_air_rate_code(code));
        assert!(fast.receive(also_fast));
        // UART, power and wake-up time do not matter.
        assert!(factory.receive(Parameters::from_bytes([0, 0, 0x3A, 0x17, 0x7F])));
    }
}
