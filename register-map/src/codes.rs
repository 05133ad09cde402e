//! Registers whose values are codes: one enum for each, with the code and a name for every value.

/// Declares an enum of codes. The name of a value is also its documentation.
macro_rules! codes {
    ($(#[$attribute:meta])* $name:ident {
        $($(#[$of_variant:meta])* $variant:ident = $code:literal $text:literal,)+
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name {
            $(#[doc = $text] $(#[$of_variant])* $variant = $code,)+
        }

        impl $name {
            /// Every value, in the order of the codes.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];
            /// Every code, in ascending order.
            pub const CODES: &'static [u16] = &[$($code),+];
            /// Every code with its name, for people.
            pub const NAMES: &'static [(u16, &'static str)] = &[$(($code, $text)),+];

            /// Returns the code in the register.
            #[inline]
            #[must_use]
            pub const fn code(self) -> u16 {
                self as u16
            }

            /// Returns the name, for people.
            #[inline]
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }

            /// Returns the value with this code, if there is one.
            #[inline]
            #[must_use]
            pub const fn from_code(code: u16) -> Option<Self> {
                match code {
                    $($code => Some(Self::$variant),)+
                    _ => None,
                }
            }
        }
    };
}

codes! {
    /// RANGE: the signal of an analog point, which must match the position of the jumper.
    #[derive(Default)]
    Signal {
        #[default]
        Voltage = 0 "0-10 V",
        Current = 1 "4-20 mA",
        /// A thermistor of 10 kOhm. Inputs only; an output treats it as [`Voltage`](Self::Voltage).
        Ntc = 2 "NTC",
    }
}

codes! {
    /// SCALE: the number format of an analog point.
    #[derive(Default)]
    Scale {
        /// The converter's code, 0 to 4095.
        #[default]
        Raw = 0 "raw 12-bit",
        /// mV, uA or 0.1 degC, depending on the [`Signal`].
        Engineering = 1 "engineering units",
    }
}

codes! {
    /// The validity of an analog input's word, and what the stage does with a digital output. Always good for any other kind
    /// of point.
    #[derive(Default)]
    ChannelStatus {
        #[default]
        Good = 0 "good",
        /// The value is below the range of the signal.
        UnderRange = 1 "under range",
        /// The value is above the range of the signal or of the converter.
        OverRange = 2 "over range",
        /// Nothing is connected, or a wire is broken.
        OpenCircuit = 3 "open circuit",
        /// The sensor's wires touch.
        ShortCircuit = 4 "short circuit",
        /// The output is to be on, and waits for DEAD_TIME or MIN_OFF, or its pair is switched by hand. No fault.
        Waits = 5 "waits",
        /// MAX_ON has ended the output. No fault.
        Ended = 6 "ended by MAX_ON",
    }
}

codes! {
    /// BAUD: the baud rate of the RS-485 line; its code is in units of 100 bit/s.
    Baud {
        B1200 = 12 "1200 bit/s",
        B2400 = 24 "2400 bit/s",
        B4800 = 48 "4800 bit/s",
        B9600 = 96 "9600 bit/s",
        B19200 = 192 "19200 bit/s",
        B38400 = 384 "38400 bit/s",
        B57600 = 576 "57600 bit/s",
        B115200 = 1152 "115200 bit/s",
        B230400 = 2304 "230400 bit/s",
        B460800 = 4608 "460800 bit/s",
        B921600 = 9216 "921600 bit/s",
    }
}

impl Baud {
    /// Returns the baud rate in bit/s, 1200 to 921600.
    #[inline]
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        self.code() as u32 * 100
    }
}

codes! {
    /// FORMAT: data bits, parity and stop bits of the RS-485 line.
    Format {
        F8N2 = 0 "8N2",
        F8E1 = 1 "8E1",
        F8O1 = 2 "8O1",
        F8N1 = 3 "8N1",
        F7E1 = 4 "7E1",
        F7O1 = 5 "7O1",
        F7N2 = 6 "7N2",
    }
}

impl Format {
    /// Returns the data bits of a character: 7 or 8.
    #[inline]
    #[must_use]
    pub const fn data_bits(self) -> u8 {
        match self {
            Self::F8N2 | Self::F8E1 | Self::F8O1 | Self::F8N1 => 8,
            Self::F7E1 | Self::F7O1 | Self::F7N2 => 7,
        }
    }

    /// Returns whether the mode can use this format: RTU needs 8 data bits (V1.02 2.5.1 and 2.5.2).
    #[inline]
    #[must_use]
    pub const fn suits(self, mode: Mode) -> bool {
        matches!(mode, Mode::Ascii) || self.data_bits() == 8
    }
}

codes! {
    /// MODE: the transmission mode of the RS-485 line.
    Mode {
        Rtu = 0 "RTU",
        Ascii = 1 "ASCII",
    }
}

codes! {
    /// STRICT_T15: treatment of a frame that contains a gap longer than t1.5.
    GapRule {
        Count = 0 "keep and count",
        Drop = 1 "drop",
    }
}

codes! {
    /// COMMAND: what the device does after its response has been sent.
    Command {
        Save = 1 "save",
        Restart = 2 "restart",
        LoadDefaults = 3 "load defaults",
        DropChanges = 4 "drop unsaved changes",
        ClearWatchdogFlag = 5 "clear the watchdog flag",
        Identify = 6 "identify",
        /// Only behind the loader, as the commands below.
        Prepare = 0xB001 "prepare an update",
        Finish = 0xB002 "check the update and start it",
        Confirm = 0xB003 "keep the running image",
        GoBack = 0xB004 "start the other image",
        RestartAs255 = 0xB007 "restart as with SW01 = 255",
    }
}

codes! {
    /// COMM_SOURCE: which requests restart the communication watchdog. Bit 0: only writes; bit 1: only over RS-485.
    CommSource {
        Any = 0 "any",
        Writes = 1 "writes only",
        Rs485 = 2 "RS-485 only",
        Rs485Writes = 3 "writes over RS-485 only",
    }
}

codes! {
    /// LORA: what the radio serves.
    Lora {
        Off = 0 "off",
        WithSettings = 1 "on with settings",
        PointsOnly = 2 "on for points and reads only",
    }
}

codes! {
    /// LORA_AIR_RATE: the data rate of the radio.
    AirRate {
        K0d3 = 0 "0.3 kbit/s",
        K1d2 = 1 "1.2 kbit/s",
        K2d4 = 2 "2.4 kbit/s",
        K4d8 = 3 "4.8 kbit/s",
        K9d6 = 4 "9.6 kbit/s",
        K19d2 = 5 "19.2 kbit/s",
    }
}

codes! {
    /// LORA_POWER: the transmit power of the radio.
    Power {
        Dbm20 = 0 "20 dBm",
        Dbm17 = 1 "17 dBm",
        Dbm14 = 2 "14 dBm",
        Dbm10 = 3 "10 dBm",
    }
}

codes! {
    /// ACTION of a link, and in the high byte WHEN it acts: 1 stands for *only while the communication watchdog has
    /// expired*.
    LinkAction {
        None = 0x000 "none",
        Follow = 0x001 "follow",
        Invert = 0x002 "invert",
        Toggle = 0x003 "toggle",
        Pulse = 0x004 "pulse",
        Set = 0x005 "set",
        Reset = 0x006 "reset",
        Change = 0x007 "change",
        NoneAlone = 0x100 "none if alone",
        FollowAlone = 0x101 "follow if alone",
        InvertAlone = 0x102 "invert if alone",
        ToggleAlone = 0x103 "toggle if alone",
        PulseAlone = 0x104 "pulse if alone",
        SetAlone = 0x105 "set if alone",
        ResetAlone = 0x106 "reset if alone",
        ChangeAlone = 0x107 "change if alone",
    }
}

codes! {
    /// State of a module.
    ModuleState {
        Good = 0 "good",
        None = 1 "none",
        NotAnswering = 2 "not answering",
        OutOfRange = 3 "a channel out of range",
    }
}

codes! {
    /// Kind of the last fault.
    FaultKind {
        None = 0 "none",
        Panic = 1 "panic",
        HardFault = 2 "hard fault",
        Watchdog = 3 "watchdog reset",
        Crystal = 4 "crystal failure",
        StackOverflow = 5 "stack overflow",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_restored_by_from_code_and_others_are_rejected() {
        for baud in Baud::ALL {
            assert_eq!(Baud::from_code(baud.code()), Some(*baud));
        }
        let taken = (0..=0xFFFF).filter(|code| Baud::from_code(*code).is_some());
        assert!(taken.eq(Baud::CODES.iter().copied()));
        assert_eq!(Command::from_code(0), None);
        assert_eq!(Format::from_code(7), None);
    }

    #[test]
    fn name_of_a_value_is_the_name_of_its_code() {
        for (fault, name) in FaultKind::ALL.iter().zip(FaultKind::NAMES) {
            assert_eq!((fault.code(), fault.name()), *name);
        }
    }

    #[test]
    fn formats_with_seven_data_bits_are_allowed_in_ascii_mode_only() {
        for format in Format::ALL {
            let seven = format.code() >= 4;
            assert_eq!(format.data_bits(), if seven { 7 } else { 8 }, "{format:?}");
            assert_eq!(format.suits(Mode::Rtu), !seven, "{format:?}");
            assert!(format.suits(Mode::Ascii), "{format:?}");
        }
    }

    #[test]
    fn a_baud_rate_is_a_hundred_times_its_code() {
        assert_eq!(Baud::B9600.bits_per_second(), 9600);
        assert_eq!(Baud::B921600.bits_per_second(), 921_600);
    }
}
