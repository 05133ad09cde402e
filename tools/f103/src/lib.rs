//! An emulated STM32F103 in a circuit that you write, which runs anybody's firmware image.
//!
//! A [`Chip`] is the part in a [`Circuit`](soc::Circuit), which is connected to its pins. A chip has no clock but its
//! own: time passes only while a caller runs it, the same calls give the same run to the instruction, and nothing here
//! reads the wall clock. What the firmware does that no real part would take well is collected as
//! [`finding::Finding`]s.
//!
//! ```text
//! chip       the part as its user sees it        serial characters on a wire, and how they are sampled
//! machine    core, memories, power, run loop     periph one register block of the part in each file
//! soc        register blocks, clocks, pins       part   flash, SRAM, pins and identity of each part
//! corner     how a part may differ from another  image  a firmware image from its ELF file
//! costs      cycles of instructions              memory addresses, and memory that core and blocks share
//! ```

pub mod chip;
pub mod corner;
pub mod costs;
mod error;
pub mod finding;
pub mod image;
pub mod machine;
pub mod memory;
pub mod part;
pub mod periph;
pub mod peripheral;
pub mod rtt;
pub mod serial;
pub mod soc;
pub mod time;

pub use chip::{Chip, CoreTime, Wait};
pub use corner::Corner;
pub use error::Error;
pub use finding::Finding;
pub use image::Image;
pub use time::Time;
