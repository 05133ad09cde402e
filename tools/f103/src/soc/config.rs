//! The configuration of a part.

use crate::corner::Corner;
use crate::part::{Part, STM32F103CB};
use crate::periph::clocks::HSE_HZ;

/// Configuration of a part and its crystal before the first power-on.
#[derive(Clone, Debug)]
pub struct Config {
    /// Type of the part.
    pub part: &'static Part,
    /// Nominal frequency of the crystal (HSE) in Hz; the corner adds its error.
    pub crystal_hz: u32,
    /// Corner of the part.
    pub corner: Corner,
    /// Whether the crystal works. Without it HSERDY is never set. The crystal can also fail later
    /// ([`crate::Chip::set_crystal`]).
    pub crystal: bool,
    /// Contents of the flash before the image is written; erased if `None`. Writing the image erases the pages that it
    /// needs.
    pub flash: Option<Vec<u8>>,
    /// Unique identity of 96 bits, in the byte order of address 0x1FFF_F7E8 (RM0008 30.2).
    pub unique_id: [u8; 12],
    /// FLASH_WRPR (PM0075 3.9): a clear bit `n` protects the `n`th 4 KiB, a clear bit 31 also all following pages.
    pub write_protection: u32,
    /// Seed of everything that is random in the part: which cells an interrupted flash operation leaves unsteady, and
    /// how they are read. Runs with the same seed are the same.
    pub seed: u64,
    /// Whether the core translates all code again, instead of using the code that the core of an earlier chip of this
    /// process has translated. The result is the same, but the run takes longer.
    pub new_core: bool,
}

impl Config {
    /// The default configuration with these contents of the flash.
    #[must_use]
    pub fn holding(flash: Vec<u8>) -> Self {
        Self {
            flash: Some(flash),
            ..Self::default()
        }
    }
}

impl Default for Config {
    fn default() -> Self {
        Self {
            part: &STM32F103CB,
            crystal_hz: HSE_HZ,
            corner: Corner::Nominal,
            crystal: true,
            flash: None,
            unique_id: *b"modio-sim-01",
            write_protection: u32::MAX,
            seed: 0x6D6F_6469_6F00,
            new_core: false,
        }
    }
}
