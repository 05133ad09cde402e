//! How a part may differ from another: the corners of its core, its clocks and its converter.
//!
//! A chip is created at a corner ([`crate::chip::Config::corner`]). The nominal one has every figure as typical; the
//! other two have all of them at one end of their range at once.

use core::fmt;
use core::str::FromStr;

use crate::costs::Costs;
use crate::periph::clocks::Oscillators;
use crate::periph::flash::Durations;
use crate::time::Time;

/// A corner of the part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Corner {
    /// Every figure typical.
    #[default]
    Nominal,
    /// Instructions and radio packets at their most, oscillators slow, the crystal slow to start.
    Slow,
    /// Oscillators fast; instructions as nominal.
    Fast,
    /// A clone of the part, such as GD32F103: long page erases, an idle bit between two characters that are sent, and LOCK of
    /// FLASH_CR reads 0. The rest as fast.
    Gd32,
}

impl Corner {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Nominal, Self::Slow, Self::Fast, Self::Gd32];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::Slow => "slow",
            Self::Fast => "fast",
            Self::Gd32 => "gd32",
        }
    }

    /// Returns what instructions cost.
    #[must_use]
    pub const fn costs(self) -> Costs {
        match self {
            Self::Slow => Costs::SLOW,
            Self::Nominal | Self::Fast | Self::Gd32 => Costs::NOMINAL,
        }
    }

    /// Returns the oscillators, with a crystal of 8 MHz.
    #[must_use]
    pub const fn oscillators(self) -> Oscillators {
        match self {
            Self::Nominal => Oscillators::TYPICAL,
            // The HSI over temperature: -2 and +2.5 % (DS5319 table 24); the crystal with its capacitors:
            // 100 ppm; the LSI: 30 to 60 kHz (DS5319 table 25). For the crystal's start the data sheet has no
            // maximum: 5 times the typical one.
            Self::Slow => Oscillators {
                hsi: 7_840_000,
                hse: 7_999_200,
                lsi: 30_000,
                hse_start: Time::from_ms(10),
            },
            Self::Fast | Self::Gd32 => Oscillators {
                hsi: 8_200_000,
                hse: 8_000_800,
                lsi: 60_000,
                hse_start: Time::from_us(500),
            },
        }
    }

    /// Returns the cycles of a timer after which the flags of an update event by software (UG) appear in SR.
    ///
    /// On two boards SR read 0 in the next instructions after UG (labwired-core, `f103_conformance.rs`): a delay of at
    /// least 4 cycles at 8 MHz in this simulator. It may be more where a timer runs at twice PCLK.
    #[must_use]
    pub const fn ug_delay(self) -> u32 {
        match self {
            Self::Nominal => 0,
            Self::Slow | Self::Fast | Self::Gd32 => 16,
        }
    }

    /// Returns how far a conversion of the ADC may be off, in LSB either way.
    #[must_use]
    pub const fn adc_noise(self) -> u16 {
        match self {
            Self::Nominal => 0,
            Self::Slow | Self::Fast | Self::Gd32 => 2,
        }
    }

    /// Returns the durations of flash operations.
    #[must_use]
    pub fn flash_durations(self) -> Durations {
        let usual = Durations::default();
        match self {
            Self::Nominal | Self::Slow | Self::Fast => usual,
            // Public measurements of a GD32F103: a page erase takes 60 to 100 ms (docs/boards.md). Its relatives are reported
            // with up to 300.
            Self::Gd32 => Durations {
                erase: Time::from_ms(300),
                ..usual
            },
        }
    }

    /// Returns whether this is a clone of the part.
    #[must_use]
    pub const fn is_clone(self) -> bool {
        matches!(self, Self::Gd32)
    }
}

impl fmt::Display for Corner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Corner {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|corner| corner.name() == text)
            .ok_or_else(|| format!("there is no corner '{text}': nominal, slow, fast or gd32"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_found_by_their_names_and_others_are_refused() {
        for corner in Corner::ALL {
            assert_eq!(corner.name().parse(), Ok(corner));
        }
        let error = "hot".parse::<Corner>().unwrap_err();
        assert_eq!(
            error,
            "there is no corner 'hot': nominal, slow, fast or gd32"
        );
    }
}
