//! The configuration of a modio board.

use register_map::Module;

use super::{Layout, MODIO_02};
use crate::error::Error;
use crate::radio::Parameters;
use crate::slot;
use f103::chip;
use f103::corner::Corner;

/// Configuration of a board before its first power-on.
#[derive(Clone, Debug)]
pub struct Config {
    /// DIP switch SW01: bit 0 = position 1, a set bit = ON.
    pub dip: u8,
    /// Type of the board.
    pub layout: &'static Layout,
    /// Module in the first slot, unless `slots` names this slot.
    pub module: Module,
    /// Modules in other slots, each with the number of its port. A slot that is not named is empty.
    pub slots: Vec<(u8, Module)>,
    /// The LoRa module, with the parameters that it keeps without power; `None` if no module is fitted.
    pub radio: Option<Parameters>,
    /// Corner of the part.
    pub corner: Corner,
    /// Whether the 8 MHz crystal works. Without it HSERDY is never set. The crystal can also fail later
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
    /// Whether the core translates all code again, instead of using the code that the core of an earlier board of this
    /// process has translated. The result is the same, but the run takes longer.
    pub new_core: bool,
}

impl Default for Config {
    fn default() -> Self {
        let chip::Config {
            part: _,
            crystal_hz: _,
            corner,
            crystal,
            flash,
            unique_id,
            write_protection,
            seed,
            new_core,
        } = chip::Config::default();
        Self {
            dip: 1,
            layout: &MODIO_02,
            module: Module::Di4,
            slots: Vec::new(),
            radio: None,
            corner,
            crystal,
            flash,
            unique_id,
            write_protection,
            seed,
            new_core,
        }
    }
}

impl Config {
    /// Port number and module of every slot of the board.
    #[must_use]
    pub fn plugged(&self) -> Vec<(u8, Module)> {
        let ports = self.layout.slots.iter().map(|slot| slot.port);
        let slots = ports.enumerate().map(|(n, port)| {
            let named = self.slots.iter().rfind(|(named, _)| *named == port);
            let unnamed = if n == 0 { self.module } else { Module::None };
            (port, named.map_or(unnamed, |&(_, module)| module))
        });
        slots.collect()
    }

    /// The configuration of the part.
    pub(super) fn chip(self) -> chip::Config {
        chip::Config {
            part: &self.layout.part,
            corner: self.corner,
            crystal: self.crystal,
            flash: self.flash,
            unique_id: self.unique_id,
            write_protection: self.write_protection,
            seed: self.seed,
            new_core: self.new_core,
            ..chip::Config::default()
        }
    }
}

impl From<slot::Error> for Error {
    fn from(error: slot::Error) -> Self {
        match error {
            slot::Error::Channel => Self::Channel,
            slot::Error::Millivolts => Self::Range("an analog input takes 0 to 3300 mV"),
        }
    }
}
