//! The modio-02: an STM32F103CB with an RS-485 line, a slot, a switch and LEDs. What is connected to which pin is in
//! [`circuit`], what a person or a test does to the board in [`outside`].

mod circuit;
mod config;
mod outside;

pub use circuit::Modio;
pub use config::Config;
pub use outside::Leds;

use crate::chip::{Chip, Error};
use crate::image::Image;
use crate::part::{Part, STM32F103CB};

/// The part of the modio-02.
pub const PART: Part = STM32F103CB;

/// The virtual modio-02.
pub type Board = Chip<Modio>;

impl Board {
    /// A board with `image` in its flash, powered on at time 0.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when `config.flash` is not 128 KiB.
    pub fn new(image: &Image, config: Config) -> Result<Self, Error> {
        let circuit = Modio::new(config.module, config.dip);
        Self::in_circuit(image, config.chip(), circuit)
    }
}
