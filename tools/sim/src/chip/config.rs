//! The configuration of a part, and the errors of chips and boards.

use core::fmt;

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
    /// ([`super::Chip::set_crystal`]).
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

/// Reason why a chip or a board refuses a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The image or the contents of the flash do not fit this part, for this reason.
    Image(String),
    /// The call is only possible while the power is off.
    Powered,
    /// The channel does not exist or is of another kind.
    Channel,
    /// The board has no slot at this port.
    Slot(u8),
    /// A value is out of this range.
    Range(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(text) => f.write_str(text),
            Self::Powered => f.write_str("this is only possible while the power is off"),
            Self::Channel => f.write_str("the plugged module has no such input on this channel"),
            Self::Slot(port) => write!(f, "the board has no slot at port {port}"),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}
