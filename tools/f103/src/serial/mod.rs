//! Asynchronous serial characters: their waveform, and a receiver that samples it.
//!
//! A wire is a level over time ([`Wave`]). A transmitter puts [`Character`]s on the wire; a [`Receiver`] samples the
//! wire at its own rate. The USARTs of the part and everything that is connected to their pins use these types.

mod character;
mod receiver;
mod settings;
mod wave;

pub use character::Character;
pub use receiver::{Framing, Receiver, Word};
pub use settings::{Format, Parity, Rate, Settings};
pub use wave::Wave;
