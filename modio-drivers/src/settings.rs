//! Settings of a channel.

use register_map::limits::{BETA_DEFAULT, DEBOUNCE_DEFAULT_MS, LOW_PASS_DEFAULT};

use crate::{Kind, Scale, Signal};

/// The settings of one channel. Each kind of channel uses those that apply to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelSettings {
    /// For a digital input the debounce in milliseconds, 0 to [`DEBOUNCE_MAX_MS`]. For an analog input the
    /// exponent n of a low-pass over 2^n samples, 0 to [`LOW_PASS_MAX`].
    ///
    /// [`DEBOUNCE_MAX_MS`]: register_map::limits::DEBOUNCE_MAX_MS
    /// [`LOW_PASS_MAX`]: register_map::limits::LOW_PASS_MAX
    pub filter: u16,
    /// The thermistor's B constant in K, [`BETA_MIN`](register_map::limits::BETA_MIN) to
    /// [`BETA_MAX`](register_map::limits::BETA_MAX).
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
            beta: BETA_DEFAULT,
            signal: Signal::Voltage,
            scale: Scale::Raw,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
