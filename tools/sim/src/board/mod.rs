//! The modio boards: an STM32F103 with an RS-485 line, slots, a DIP switch, LEDs and a LoRa module. [`layout`] has the
//! pins of each board, [`circuit`] what is connected to them, [`radio`] the LoRa module, and [`outside`] the methods that
//! operate and read a board.

mod circuit;
mod config;
mod layout;
mod outside;
mod radio;
mod stored;

pub use circuit::Modio;
pub use config::Config;
pub use layout::{Layout, MODIO_02, MODIO_08, SlotPins};
pub use outside::Leds;
pub use radio::{Radio, RadioPins};

use crate::chip::Chip;
use crate::error::Error;
use crate::image::Image;

/// A virtual modio board.
pub type Board = Chip<Modio>;

impl Board {
    /// A board with `image` in its flash, powered on at time 0.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] if the image does not fit into the flash or `config.flash` has another size, [`Error::Slot`] if
    /// `config.slots` names a slot that the board does not have.
    pub fn new(image: &Image, config: Config) -> Result<Self, Error> {
        let ports = config.layout.slots.iter().map(|slot| slot.port);
        let mut named = config.slots.iter().map(|&(port, _)| port);
        if let Some(port) = named.find(|port| !ports.clone().any(|known| known == *port)) {
            return Err(Error::Slot(port));
        }
        let circuit = Modio::new(&config);
        Self::in_circuit(image, config.chip(), circuit)
    }
}
