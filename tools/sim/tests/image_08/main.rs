//! The release image of the modio-08 on the virtual board. The image comes from `MODIO_ELF_08`, which `cargo xtask
//! test` sets after building it.
//!
//! The tests of the four slots are in `slots`, `analog`, `digital` and `faults_of_slots`. The other files are those of
//! the modio-02's tests, with one module in the first slot.

use sim::board::{Layout, MODIO_08};

/// The board that the image is for.
const LAYOUT: &Layout = &MODIO_08;
/// The variable that names the image.
const ELF: &str = "MODIO_ELF_08";

mod analog;
mod digital;
mod faults_of_slots;
mod fitted;
mod slots;

#[path = "../image/ascii.rs"]
mod ascii;
#[path = "../image/bench.rs"]
mod bench;
#[path = "../image/boot.rs"]
mod boot;
#[path = "../image/clock.rs"]
mod clock;
#[path = "../image/dip.rs"]
mod dip;
#[path = "../image/framing.rs"]
mod framing;
#[path = "../image/functions.rs"]
mod functions;
#[path = "../image/identify.rs"]
mod identify;
#[path = "../image/in_force.rs"]
mod in_force;
#[path = "../image/lock.rs"]
mod lock;
#[path = "../image/module_choice.rs"]
mod module_choice;
#[path = "../image/power_cut.rs"]
mod power_cut;
#[path = "../image/radio/mod.rs"]
mod radio;
#[path = "../image/registers.rs"]
mod registers;
#[path = "../image/saving.rs"]
mod saving;
#[path = "../image/self_description.rs"]
mod self_description;
#[path = "../image/silences.rs"]
mod silences;
#[path = "../image/stack.rs"]
mod stack;
#[path = "../image/storing.rs"]
mod storing;
#[path = "../image/timing.rs"]
mod timing;
