//! The virtual modio-02: a simulated STM32F103CB and the board around it, running the real firmware image.
//!
//! A [`board::Board`] holds the part, what is plugged into its slot, its switch and its RS-485 line. It has
//! no clock but its own: time passes only while a caller runs it, the same calls give the same run to the
//! instruction, and nothing here reads the wall clock. What the firmware does that no real part would take
//! well is collected as [`finding::Finding`]s.
//!
//! ```text
//! board      the public face                     line   the RS-485 bus, its waveforms and frames
//! machine    core, memories, run loop            slot   what is plugged in, and the world outside it
//! exact_line the protocol by which a client lets time pass
//! soc        register blocks, clocks, wires      periph one register block of the part in each file
//! ```

pub mod board;
pub mod corner;
pub mod exact_line;
pub mod finding;
pub mod image;
pub mod line;
pub mod machine;
pub mod periph;
pub mod peripheral;
pub mod rtt;
pub mod serial;
pub mod slot;
pub mod soc;
pub mod time;

pub use board::{Board, Config, CoreTime, Error, Leds, Wait};
pub use corner::Corner;
pub use finding::Finding;
pub use image::Image;
pub use register_map::Module;
pub use slot::Channel;
pub use time::Time;
