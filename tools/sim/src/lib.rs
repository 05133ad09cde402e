//! A simulated STM32F103 with a circuit around it, and the virtual modio boards, which are built on it and run the real
//! firmware image.
//!
//! A [`Chip`] is the part in a [`Circuit`](soc::Circuit), which is connected to its pins; [`Board`] is the part on a
//! modio board, with what is plugged into its slots, its switch and its RS-485 line. A chip has no clock but its own:
//! time passes only while a caller runs it, the same calls give the same run to the instruction, and nothing here reads
//! the wall clock. What the firmware does that no real part would take well is collected as [`finding::Finding`]s.
//!
//! The part knows nothing of any board:
//!
//! ```text
//! chip       the part as its user sees it        serial characters on a wire, and how they are sampled
//! machine    core, memories, run loop            periph one register block of the part in each file
//! soc        register blocks, clocks, pins       part   flash, SRAM, pins and identity of each part
//! ```
//!
//! The board knows the part by its pins:
//!
//! ```text
//! board      the modio-02 and the modio-08       line   the RS-485 bus and its frames
//! bus        several boards on one line          slot   what is plugged in, and the world outside it
//! exact_line the protocol by which a client      radio  the LoRa module, and the air with its gateway
//!            lets time pass                        options the options of the command `modio-sim`
//! ```

pub mod board;
pub mod bus;
pub mod chip;
pub mod corner;
mod error;
pub mod exact_line;
pub mod finding;
pub mod image;
pub mod line;
pub mod machine;
pub mod options;
pub mod part;
pub mod periph;
pub mod peripheral;
pub mod radio;
pub mod rtt;
pub mod serial;
pub mod slot;
pub mod soc;
pub mod time;

pub use board::{Board, Config, Leds};
pub use bus::Bus;
pub use chip::{Chip, CoreTime, Wait};
pub use corner::Corner;
pub use error::Error;
pub use finding::Finding;
pub use image::Image;
pub use register_map::Module;
pub use slot::Channel;
pub use time::Time;
