//! Asynchronous serial characters: how they look on a wire, and how a receiver samples them.
//!
//! A wire is a level over time ([`Wave`]). A transmitter puts [`Character`]s on it; a [`Receiver`] samples it at its
//! own rate. The USARTs of the part and everything that is connected to their pins are built on these.

mod character;
mod receiver;
mod settings;
mod wave;

pub use character::Character;
pub use receiver::{Framing, Receiver, Word};
pub use settings::{Format, Parity, Rate, Settings};
pub use wave::Wave;
