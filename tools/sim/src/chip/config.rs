//! How a part is set up, and why it refuses something.

use core::fmt;

use crate::corner::Corner;
use crate::part::{Part, STM32F103CB};
use crate::periph::clocks::HSE_HZ;

/// What may differ from one part to the next, and its crystal, before power first comes on.
#[derive(Clone, Debug)]
pub struct Config {
    /// Which part it is.
    pub part: &'static Part,
    /// The frequency of the crystal (HSE) in Hz, without its error.
    pub crystal_hz: u32,
    /// The corner that the part is at.
    pub corner: Corner,
    /// Whether the crystal works. Without it HSERDY never comes. It can die later as well
    /// ([`super::Chip::set_crystal`]).
    pub crystal: bool,
    /// The flash's contents before the image is written into it, which erases the pages that it needs;
    /// erased when `None`.
    pub flash: Option<Vec<u8>>,
    /// The 96-bit unique identity, as its bytes stand at 0x1FFF_F7E8 (RM0008 30.2).
    pub unique_id: [u8; 12],
    /// FLASH_WRPR (PM0075 3.9): bit n clear protects the `n`th 4 KiB, bit 31 all that follow, too.
    pub write_protection: u32,
    /// Decides what chance decides in the part: which cells an interrupted flash operation leaves unsteady,
    /// and how they read. Runs with the same seed are the same.
    pub seed: u64,
    /// Has the core translate everything anew, instead of going on with what the core of an earlier chip of this
    /// process has translated. The run is the same, it only takes longer.
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

/// Why a chip or a board refuses something.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The image or the flash contents are not fit for this part: the reason.
    Image(String),
    /// That can only be done while the power is off.
    Powered,
    /// No such channel, or nothing of that kind on it.
    Channel,
    /// The board has no slot with this port.
    Slot(u8),
    /// A value out of range: what it may be.
    Range(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(text) => f.write_str(text),
            Self::Powered => f.write_str("only while the power is off"),
            Self::Channel => f.write_str("the plugged module has no such input on that channel"),
            Self::Slot(port) => write!(f, "the board has no slot at port {port}"),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}
