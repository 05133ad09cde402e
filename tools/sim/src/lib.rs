//! The virtual modio boards, which run the real firmware image.
//!
//! A [`Board`] is the emulated part of crate [`f103`] on a modio board, with what is plugged into its slots, its switch
//! and its RS-485 line. It dereferences to its [`Chip`], which has power and time: time passes only while a caller runs
//! it, the same calls give the same run to the instruction, and nothing here reads the wall clock.
//!
//! ```text
//! board      the modio and bought boards         line   the RS-485 bus and its frames
//! bus        several boards on one line          slot   what is plugged in, and the world outside it
//! exact_line the protocol by which a client      radio  the LoRa module, and the air with its gateway
//!            lets time pass                        options the options of the command `modio-sim`
//! ```

pub mod board;
pub mod bus;
mod error;
pub mod exact_line;
pub mod line;
pub mod options;
pub mod radio;
pub mod slot;
mod uart;

pub use board::{Board, Config, Leds};
pub use bus::Bus;
pub use error::Error;
pub use f103::{
    Chip, CoreTime, Corner, Finding, Image, Time, Wait, chip, corner, finding, image, machine,
    memory, part, periph, rtt, serial, soc, time,
};
pub use register_map::Module;
pub use slot::Channel;
