//! How a channel is read or driven.

use crate::{DEBOUNCE_DEFAULT_MS, Kind, LOW_PASS_DEFAULT, ntc};

/// The settings of one channel. Each kind of channel takes what it needs of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelSettings {
    /// A digital input's debounce in milliseconds, 0 to [`DEBOUNCE_MAX_MS`](crate::DEBOUNCE_MAX_MS);
    /// an analog input's low-pass over 2^n samples, n from 0 to
    /// [`LOW_PASS_MAX`](crate::LOW_PASS_MAX).
    pub filter: u16,
    /// The thermistor's B constant in kelvin, [`ntc::BETA_MIN`] to [`ntc::BETA_MAX`].
    pub beta: u16,
    /// The signal of an analog channel, as its jumper says.
    pub signal: Signal,
    /// What an analog channel's word is in.
    pub scale: Scale,
}

impl ChannelSettings {
    /// What a channel of this kind starts with: 5 ms for a digital input, 2^4 samples for an analog
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
    /// A 10 k thermistor. Inputs only; an output counts it as [`Volts`](Self::Voltage).
    Ntc = 2,
}

impl Signal {
    /// The signal with this code, or `None` above 2.
    #[must_use]
    pub const fn from_code(code: u16) -> Option<Self> {
        match code {
            0 => Some(Self::Voltage),
            1 => Some(Self::Current),
            2 => Some(Self::Ntc),
            _ => None,
        }
    }

    /// The code of this signal, 0 to 2.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }
}

/// What an analog channel's word is in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Scale {
    /// The converter's code, 0 to 4095.
    #[default]
    Raw = 0,
    /// mV, uA or 0.1 degC, by [`Signal`].
    Engineering = 1,
}

impl Scale {
    /// The scale with this code, or `None` above 1.
    #[must_use]
    pub const fn from_code(code: u16) -> Option<Self> {
        match code {
            0 => Some(Self::Raw),
            1 => Some(Self::Engineering),
            _ => None,
        }
    }

    /// The code of this scale, 0 or 1.
    #[must_use]
    pub const fn code(self) -> u16 {
        self as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_lead_back_to_what_they_stand_for() {
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
