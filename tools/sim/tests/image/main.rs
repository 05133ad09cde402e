//! The release image behind its loader on the virtual board: its behaviour for a master on the line and for a person at
//! the board.
//!
//! What a master sees of the unit's functions, registers and frames is tested by the conformance suite, and logic by
//! the crates' own tests on the host. The tests here are about time, power, disturbances and the circuit.
//!
//! The board is a modio-02, as after the first start of its loader. `MODIO_IMAGES_MODIO_02`, which `cargo xtask test` sets,
//! names the directory of loader and images. The tests of the modio-08's image are in `tests/image_08`; they use most of
//! the files here as well, which name the board's first slot by [`rig::PORT`], [`rig::SLOT`] and [`rig::MODULE`].
//!
//! | what | where |
//! |---|---|
//! | a board and its master | `rig`, `registers` |
//! | the description | `self_description` |
//! | the line | `noise`, `pulses`, `timing`, `silences`, `dip`, `bus` |
//! | points | `points`, `analog_inputs`, `analog_outputs`, `dac_faults`, `counters`, `edges` |
//! | configuration | `in_force`, `saving`, `flash_faults`, `power_cut` |
//! | the simulator | `programmed`: loader and image in its flash |
//! | the radio | `radio`, `air` |
//! | the loader, and an update over the line | `loading`, `updating`, `campaign` |
//! | the image without a loader, as on a Blue Pill | `alone` |
//! | safety | `boot`, `clock`, `outputs_at_start`, `comm_watchdog`, `hung_task`, `faults`, `upsets`, `kept`, `stack`, `log`, `long_run` |

use sim::board::{Layout, MODIO_02};

/// The board that the image is for.
const LAYOUT: &Layout = &MODIO_02;

mod air;
mod alone;
mod analog_inputs;
mod analog_outputs;
mod boot;
mod bus;
mod campaign;
mod campaigns;
mod clock;
mod comm_watchdog;
mod counters;
mod dac_faults;
mod dip;
mod edges;
mod faults;
mod flash_faults;
mod hung_task;
mod in_force;
mod in_slots;
mod kept;
mod kept_region;
mod loading;
mod log;
mod long_run;
mod noise;
mod outputs_at_start;
mod points;
mod power_cut;
mod programmed;
mod pulses;
mod radio;
mod registers;
mod rig;
mod saving;
mod self_description;
mod silences;
mod stack;
mod timing;
mod updating;
mod upsets;
