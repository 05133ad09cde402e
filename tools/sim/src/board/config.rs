//! How a modio board is fitted.

use register_map::Module;

use super::{Layout, MODIO_02};
use crate::chip::{self, Error};
use crate::corner::Corner;
use crate::slot;

/// How the board is fitted before power first comes on.
#[derive(Clone, Debug)]
pub struct Config {
    /// SW01, bit 0 = position 1, a set bit = ON.
    pub dip: u8,
    /// Which board it is.
    pub layout: &'static Layout,
    /// What is plugged into the first slot, unless `slots` names it.
    pub module: Module,
    /// What is plugged into other slots, by the numbers of their ports. A slot that is not named is empty.
    pub slots: Vec<(u8, Module)>,
    /// The corner that the part is at.
    pub corner: Corner,
    /// Whether the 8 MHz crystal works. Without it HSERDY never comes. It can die later as well
    /// ([`crate::Board::set_crystal`]).
    pub crystal: bool,
    /// The flash's contents before the image is written into it, which erases the pages that it needs;
    /// erased when `None`.
    pub flash: Option<Vec<u8>>,
    /// The 96-bit unique identity, as its bytes stand at 0x1FFF_F7E8 (RM0008 30.2).
    pub unique_id: [u8; 12],
    /// FLASH_WRPR (PM0075 3.9): bit n clear protects pages 4n to 4n + 3.
    pub write_protection: u32,
    /// Decides what chance decides in the part: which cells an interrupted flash operation leaves unsteady,
    /// and how they read. Runs with the same seed are the same.
    pub seed: u64,
    /// Has the core translate everything anew, instead of going on with what the core of an earlier board of this
    /// process has translated. The run is the same, it only takes longer.
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
    /// What is plugged into every slot of the board, with the numbers of the ports.
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

    /// What of it concerns the part.
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
