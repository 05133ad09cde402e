//! The kept region: the last 512 bytes of RAM, which keep their content over every reset that is not a power-on.
//!
//! The region lies at the same address in every image of a board, so that another image finds what the last one has
//! kept. The start-up code does not initialise it, and the stack, at the other end of the RAM, cannot reach it. Fields
//! are only ever appended.
//!
//! ```text
//! word  0-15  16-31   sealed part, twice: magic, layout, length, words, CRC-32           changes seldom
//!       32    33      seconds since power-on, complement                                 live
//!       34    35 ...  pulse counter of a point, complement; from the first slot's on     live
//!       98-113        what each output has: a half-word for each point, by address         of this run, or not valid
//!       114           the modules in force, 4 bits for each port, port 1 lowest            as 98-113
//!       115           outputs that a link holds, a bit for each point                      as 98-113
//!       116           outputs that are at SAFE, a bit for each point                       as 98-113
//!       117-123       free
//!       124-127       marks of the tasks, a byte each                                    neither sealed nor live
//! ```
//!
//! A reset at any instruction loses at most the update that it interrupts; `sealed` and `live` say why. Without a valid
//! sealed part the region counts as after power-on.
//!
//! The outputs are valid while the sealed word OWNER is the complement of STARTED. An image that keeps outputs writes both
//! words in one update, after all half-words have the values of its run. An older image writes STARTED alone, and so ends
//! the values of the run before.

use ports::marks::TASKS;

#[cfg(any(target_os = "none", test))]
mod live;
#[cfg(all(target_os = "none", feature = "loader"))]
mod loading;
#[cfg(target_os = "none")]
mod region;
#[cfg(any(target_os = "none", test))]
mod sealed;

#[cfg(all(target_os = "none", feature = "loader"))]
pub(crate) use loading::{at_loading, keep_chosen};
#[cfg(target_os = "none")]
pub(crate) use region::{at_start, forget, keep_dip, take_as_255, take_cause};
#[cfg(target_os = "none")]
pub use region::{
    end_choice, keep_as_255, keep_asked, keep_held, keep_output, keep_outputs, keep_pulses,
    keep_records, keep_recovery, keep_saves, keep_uptime, marks, note, outputs, pulses, records,
};

/// Words of one copy of the sealed part: 12 words, room for fields to come, and the CRC-32.
const COPY: usize = 16;
/// First word of the seconds since power-on.
const UPTIME: usize = 2 * COPY;
/// First word of the pulse counters.
const PULSES: usize = UPTIME + 2;
/// First word of the outputs.
const OUTPUTS: usize = PULSES + 2 * POINTS;
/// Number of points.
const POINTS: usize = 32;
/// Word of the modules in force.
const MODULES: usize = OUTPUTS + POINTS / 2;
/// Word of the outputs that a link holds.
const HELD: usize = MODULES + 1;
/// Word of the outputs that are at SAFE.
const AT_SAFE: usize = HELD + 1;
/// First word of the marks.
const MARKS: usize = WORDS - 4;
/// Words of the region.
const WORDS: usize = 128;

// Every image of a board has the outputs at the same place.
const _: () = assert!(OUTPUTS == 98 && AT_SAFE < MARKS && TASKS <= 4 * (WORDS - MARKS));
