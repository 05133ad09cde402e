//! The release image of the modio-08 behind its loader, on the virtual board. `MODIO_IMAGES_MODIO_08`, which `cargo xtask
//! test` sets, names the directory of loader and images.
//!
//! The tests of the four slots are in `analog`, `digital` and `faults_of_slots`, those of function 70 in `fast`, those of
//! links in `links`, of START = 0xFFFE in `as_it_was`. The other files are those of the modio-02's tests whose result
//! depends on the board, with one module in the first slot: start, store, edges, timing, stack, the pins of the radio, and
//! an update.

use sim::board::{Layout, MODIO_08};

/// The board that the image is for.
const LAYOUT: &Layout = &MODIO_08;

mod analog;
mod as_it_was;
mod clones;
mod digital;
mod fast;
mod faults_of_slots;
mod fitted;
mod kept_outputs;
mod links;
mod outputs;

#[path = "../image/boot.rs"]
mod boot;
#[path = "../image/campaign.rs"]
mod campaign;
#[path = "../image/edges.rs"]
mod edges;
#[path = "../image/fast_master.rs"]
mod fast_master;
#[allow(dead_code, reason = "other tests of the modio-02 use the rest")]
#[path = "../image/in_slots.rs"]
mod in_slots;
#[path = "../image/kept_region.rs"]
mod kept_region;
#[path = "../image/power_cut.rs"]
mod power_cut;
#[allow(dead_code, reason = "the tests over the air use the rest")]
#[path = "../image/radio/mod.rs"]
mod radio;
#[allow(dead_code, reason = "other tests of the modio-02 use the rest")]
#[path = "../image/registers.rs"]
mod registers;
#[allow(dead_code, reason = "other tests of the modio-02 use the rest")]
#[path = "../image/rig.rs"]
mod rig;
#[path = "../image/saving.rs"]
mod saving;
#[allow(dead_code, reason = "other tests of the modio-02 use the rest")]
#[path = "../image/self_description.rs"]
mod self_description;
#[path = "../image/stack.rs"]
mod stack;
#[path = "../image/stage.rs"]
mod stage;
#[path = "../image/timing.rs"]
mod timing;
