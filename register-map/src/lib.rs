//! The registers of the device as data. The firmware and every tool use it, so that an address means the same for
//! all.
//!
//! Addresses are PDU addresses, counted from zero as in the frame.
//!
//! Each block of registers is a module with a constant for every address; `RULES`, the numbers of its registers
//! ([`Rule`]); and `BLOCK`, the same with the texts for people ([`Block`], [`Text`]). The firmware uses only the
//! numbers: its image contains the texts only in the self-description. [`codes`] has an enum for each register that
//! holds codes, and [`record`] describes the format of a configuration in flash. `cargo xtask docs` writes
//! `docs/register-map.md` from all of it.
//!
//! ```
//! use register_map::{BLOCKS, InForce, Values, configuration, rule_at};
//!
//! let (rule, _) = rule_at(configuration::RULES, configuration::FRAME_GAP).unwrap();
//! assert_eq!(rule.values, Values::range(2, 1000).or(0));
//! assert_eq!(rule.in_force, InForce::Restart);
//!
//! let mut registers = BLOCKS.iter().flat_map(|block| block.registers());
//! let (rule, text) = registers.find(|(_, text)| text.name == "BETA").unwrap();
//! assert_eq!((rule.first, rule.default, text.value.unit().code), (0x0160, 3950, "K"));
//! ```

#![no_std]
#![forbid(unsafe_code)]

mod block;
pub mod board;
pub mod codes;
mod commit;
pub mod configuration;
mod count;
pub mod counters;
pub mod deadband;
pub mod edges;
pub mod fault;
mod fixed;
mod kind;
pub mod layout;
pub mod limits;
pub mod links;
mod module;
pub mod name;
pub mod part;
pub mod points;
mod port;
pub mod record;
mod rule;
pub mod second;
pub mod stage;
pub mod state;
pub mod update;
mod value;
mod values;

pub use block::{Block, Scope, Text};
pub use board::{Board, Row};
pub use commit::first_32_bits;
pub use fixed::FixedPort;
#[doc(hidden)]
pub use git_version::git_version;
pub use module::{Module, UnknownModule};
pub use rule::{Access, InForce, Narrower, Rule, Run, Runs, rule_at, runs};
pub use value::{Field, Unit, Value};
pub use values::Values;

/// Every block, in ascending order of the addresses.
pub static BLOCKS: [&Block; 11] = [
    &points::BLOCK,
    &name::BLOCK,
    &configuration::BLOCK,
    &state::BLOCK,
    &fault::BLOCK,
    &second::BLOCK,
    &counters::BLOCK,
    &edges::BLOCK,
    &links::BLOCK,
    &deadband::BLOCK,
    &stage::BLOCK,
];
