//! How a board is fitted, and why it refuses something.

use core::fmt;

use register_map::Module;

use crate::corner::Corner;
use crate::slot;

/// How the board is fitted before power first comes on.
#[derive(Clone, Debug)]
pub struct Config {
    /// SW01, bit 0 = position 1, a set bit = ON.
    pub dip: u8,
    /// What is plugged into the slot.
    pub module: Module,
    /// The corner that the part is at.
    pub corner: Corner,
    /// Whether the 8 MHz crystal works. Without it HSERDY never comes. It can die later as well
    /// ([`crate::Board::set_crystal`]).
    pub crystal: bool,
    /// The flash's 128 KiB before the image is written into it, which erases the pages that it needs;
    /// erased when `None`.
    pub flash: Option<Vec<u8>>,
    /// The 96-bit unique identity, as its bytes stand at 0x1FFF_F7E8 (RM0008 30.2).
    pub unique_id: [u8; 12],
    /// FLASH_WRPR (PM0075 3.9): bit n clear protects pages 4n to 4n + 3.
    pub write_protection: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            dip: 1,
            module: Module::Di4,
            corner: Corner::Nominal,
            crystal: true,
            flash: None,
            unique_id: *b"modio-sim-01",
            write_protection: u32::MAX,
        }
    }
}

/// Why the board refuses something.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The image or the flash contents are not fit for this board: the reason.
    Image(String),
    /// That can only be done while the power is off.
    Powered,
    /// No such channel, or nothing of that kind on it.
    Channel,
    /// A value out of range: what it may be.
    Range(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(text) => f.write_str(text),
            Self::Powered => f.write_str("only while the power is off"),
            Self::Channel => slot::Error::Channel.fmt(f),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}

impl From<slot::Error> for Error {
    fn from(error: slot::Error) -> Self {
        match error {
            slot::Error::Channel => Self::Channel,
            slot::Error::Millivolts => Self::Range("an analog input takes 0 to 3300 mV"),
        }
    }
}
