//! The real release image on the virtual board: what a master on the line, and a person at the board,
//! get to see.
//!
//! The image comes from `MODIO_ELF`, which `cargo xtask test` sets after building it.
//!
//! | what | where |
//! |---|---|
//! | a board and its master | `bench`, `registers` |
//! | the line | `standard_functions`, `ascii`, `framing`, `noise`, `refusals`, `timing`, `dip` |
//! | points | `points`, `functions`, `analog_inputs`, `analog_outputs`, `dac_faults`, `counters` |
//! | configuration | `lock`, `ranges`, `in_force`, `module_choice`, `storing`, `saving`, `flash_faults`, `power_cut`, `erase_cut` |
//! | safety | `boot`, `clock`, `outputs_at_start`, `comm_watchdog`, `hung_task`, `faults` |

mod analog_inputs;
mod analog_outputs;
mod ascii;
mod bench;
mod boot;
mod clock;
mod comm_watchdog;
mod counters;
mod dac_faults;
mod dip;
mod faults;
mod flash_faults;
mod framing;
mod functions;
mod hung_task;
mod in_force;
mod lock;
mod module_choice;
mod noise;
mod outputs_at_start;
mod points;
mod power_cut;
mod pulses;
mod ranges;
mod refusals;
mod registers;
mod saving;
mod standard_functions;
mod storing;
mod timing;
mod upsets;
