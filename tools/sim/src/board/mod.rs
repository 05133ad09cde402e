//! The boards: an STM32F103 with an RS-485 line and LEDs. A modio board has slots, a DIP switch and a LoRa module; a
//! board of [`fixed`] has [`terminals`] and an RS-232 port instead. [`layout`] has the pins of each board, [`circuit`]
//! what is connected to them, [`radio`] the LoRa module, and [`outside`] the methods that operate and read a board.

mod circuit;
mod config;
mod firmware;
mod fixed;
mod layout;
mod outside;
mod radio;
mod rs232;
mod stored;
pub mod terminals;

pub use circuit::Modio;
pub use config::Config;
pub use firmware::{Firmware, InSlot};
pub use fixed::{ETH_IO5R, FX3U_14, FX3U_24};
pub use layout::{Layout, LinePins, MODIO_02, MODIO_08, SlotPins};
pub use outside::Leds;
pub use radio::{Radio, RadioPins};
pub use rs232::Rs232;

use core::ops::{Deref, DerefMut};

use crate::error::Error;
use f103::{Chip, Image, Time, chip};

/// A virtual modio board: a chip in the circuit of a modio board.
#[derive(Debug)]
pub struct Board(Chip<Modio>);

impl Deref for Board {
    type Target = Chip<Modio>;

    fn deref(&self) -> &Chip<Modio> {
        &self.0
    }
}

impl DerefMut for Board {
    fn deref_mut(&mut self) -> &mut Chip<Modio> {
        &mut self.0
    }
}

impl Board {
    /// Returns a board with `image` in its flash, powered on at time 0.
    ///
    /// # Errors
    ///
    /// [`f103::Error::Image`] if the image does not fit into the flash or `config.chip.flash` has another size,
    /// [`Error::Slot`] if `config.slots` names a slot that the board does not have, [`Error::NoRadio`] if `config.radio`
    /// is set and the board has no place for a LoRa module.
    pub fn new(image: &Image, config: Config) -> Result<Self, Error> {
        let ports = config.layout.slots.iter().map(|slot| slot.port);
        let mut named = config.slots.iter().map(|&(port, _)| port);
        if let Some(port) = named.find(|port| !ports.clone().any(|known| known == *port)) {
            return Err(Error::Slot(port));
        }
        if config.radio.is_some() && config.layout.radio.is_none() {
            return Err(Error::NoRadio);
        }
        let circuit = Modio::new(&config);
        let chip = chip::Config {
            part: &config.layout.part,
            ..config.chip
        };
        Ok(Self(Chip::in_circuit(image, chip, circuit)?))
    }

    /// Does the same as [`Chip::run_until`]. A method of the board itself, so that the argument may borrow what
    /// contains the board.
    pub fn run_until(&mut self, t: Time) {
        self.0.run_until(t);
    }

    /// Does the same as [`Chip::run_for`]. A method of the board itself, as [`run_until`](Self::run_until).
    pub fn run_for(&mut self, d: Time) {
        self.0.run_for(d);
    }
}
