//! What the device decides once, when it starts.

use register_map::{Module, preset};

/// What the DIP switch SW01 asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Address {
    /// Serve the line as this unit, 1 to 247.
    Unit(u8),
    /// Serve the line as unit [`LOADER_UNIT`] with the factory's line settings, whatever is stored, so
    /// that a unit with a forgotten setting can be reached.
    Loader,
    /// Not a unit address (0 and 248 to 254): stay silent and blink the fault LED.
    Invalid,
}

/// The unit address of the loader mode.
pub const LOADER_UNIT: u8 = 255;

impl Address {
    /// What the switch, read as a number, asks for.
    #[must_use]
    pub const fn from_dip(dip: u8) -> Self {
        match dip {
            1..=247 => Self::Unit(dip),
            LOADER_UNIT => Self::Loader,
            0 | 248..=254 => Self::Invalid,
        }
    }

    /// The unit address to answer to, if any.
    #[must_use]
    pub const fn unit(self) -> Option<u8> {
        match self {
            Self::Unit(unit) => Some(unit),
            Self::Loader => Some(LOADER_UNIT),
            Self::Invalid => None,
        }
    }
}

/// The slot's module: as preset in flash, else as chosen at build, else a 4DI. A stop-gap until the
/// configuration store's MODULE register.
#[must_use]
pub fn module(preset: Option<[u8; preset::LEN]>, chosen_at_build: Option<&str>) -> Module {
    preset
        .and_then(preset::decode)
        .or_else(|| chosen_at_build?.parse().ok())
        .unwrap_or(Module::Di4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_position_of_the_switch_has_its_meaning() {
        for dip in 0..=255u8 {
            let expected = match dip {
                1..=247 => Some(dip),
                255 => Some(255),
                _ => None,
            };
            assert_eq!(Address::from_dip(dip).unit(), expected, "{dip}");
        }
        assert_eq!(Address::from_dip(255), Address::Loader);
    }

    #[test]
    fn a_preset_module_comes_before_the_one_chosen_at_build() {
        let preset = Some(preset::encode(Module::Do4));
        assert_eq!(module(preset, Some("4ai")), Module::Do4);
        assert_eq!(module(Some([0xFF; 4]), Some("4ai")), Module::Ai4);
        assert_eq!(module(None, Some("nonsense")), Module::Di4);
        assert_eq!(module(None, None), Module::Di4);
    }
}
