//! Settings of a channel.

use crate::{DEBOUNCE_DEFAULT_MS, Kind, LOW_PASS_DEFAULT, ntc};

/// The settings of one channel. Each kind of channel uses those that apply to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelSettings {
    /// For a digital input the debounce in milliseconds, 0 to [`DEBOUNCE_MAX_MS`](crate::DEBOUNCE_MAX_MS). For an
    /// analog input the exponent n of a low-pass over 2^n samples, 0 to [`LOW_PASS_MAX`](crate::LOW_PASS_MAX).
    pub filter: u16,
    /// The thermistor's B constant in K, [`ntc::BETA_MIN`] to [`ntc::BETA_MAX`].
    pub beta: u16,
    /// The signal of an analog channel; it must match the position of the jumper.
    pub signal: Signal,
    /// The unit of an analog channel's word.
    pub scale: Scale,
}

impl ChannelSettings {
    /// Returns the default settings of a channel of this kind: 5 ms for a digital input, 2^4 samples for an analog
    /// one, a thermistor of 3950 K, 0-10 V, raw.
    #[must_use]
    pub const fn default_for(kind: Kind) -> Self {
        Self {
            filter: match kind {
                Kind::BitInput => DEBOUNCE_DEFAULT_MS,
                Kind::WordInput => LOW_PASS_DEFAULT,
                Kind::None | Kind::BitOutput | Kind::WordOutput => 0,
            },
            beta: ntc::BETA_DEFAULT,
            signal: Signal::Voltage,
            scale: Scale::Raw,
        }
    }
}

/// The signal of an analog channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Signal {
    /// 0 to 10 V.
    #[default]
    Voltage = 0,
    /// 4 to 20 mA.
    Current = 1,
    /// A 10 k thermistor. Inputs only; an output treats it as [`Voltage`](Self::Voltage).
    Ntc = 2,
}

impl Signal {
    /// Returns the signal with this code, or `None` above 2.
    #[must_use]
    pub const fn from_code(code: u16) -> Option<Self> {
        match code {
            0 => Some(Self::Voltage),
            1 => Some(Self::Current),
            2 => Some(Self::Ntc),
            _ => None,
        }
    }

    /// Returns the code of this signal, 0 to 2.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }
}

/// Unit of an analog channel's word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Scale {
    /// The converter's code, 0 to 4095.
    #[default]
    Raw = 0,
    /// mV, uA or 0.1 degC, depending on [`Signal`].
    Engineering = 1,
}

impl Scale {
    /// Returns the scale with this code, or `None` above 1.
    #[must_use]
    pub const fn from_code(code: u16) -> Option<Self> {
        match code {
            0 => Some(Self::Raw),
            1 => Some(Self::Engineering),
            _ => None,
        }
    }

    /// Returns the code of this scale, 0 or 1.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_is_restored_by_from_code() {
        for code in 0..=2 {
            assert_eq!(Signal::from_code(code).map(Signal::code), Some(code));
        }
        for code in 0..=1 {
            assert_eq!(Scale::from_code(code).map(Scale::code), Some(code));
        }
        assert_eq!((Signal::from_code(3), Scale::from_code(2)), (None, None));
    }

    #[test]
    fn defaults_are_those_of_the_register_map() {
        let defaults = |kind| ChannelSettings::default_for(kind);
        assert_eq!(defaults(Kind::BitInput).filter, 5);
        assert_eq!(defaults(Kind::WordInput).filter, 4);
        assert_eq!(
            defaults(Kind::WordInput),
            ChannelSettings {
                filter: 4,
                beta: 3950,
                signal: Signal::Voltage,
                scale: Scale::Raw
            }
        );
    }
}
