//! The configuration of a modio board.

use register_map::Module;

use super::{Layout, MODIO_02};
use crate::radio::Parameters;
use f103::chip;

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
    /// The part. [`Board::new`](crate::Board::new) sets its type, which is that of the layout.
    pub chip: chip::Config,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            dip: 1,
            layout: &MODIO_02,
            module: Module::Di4,
            slots: Vec::new(),
            radio: None,
            chip: chip::Config::default(),
        }
    }
}

impl Config {
    /// Returns the port number and module of every slot of the board.
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
}
