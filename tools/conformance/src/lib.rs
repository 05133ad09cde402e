//! A suite of cases that a Modbus serial-line server must pass, run from outside: raw bytes on a line,
//! whatever the line is.
//!
//! Each case cites the section it comes from: *V1.02* is Modbus over Serial Line V1.02, *V1.1b3* the
//! Modbus Application Protocol V1.1b3, *map* the register map of the modio. A case says what it needs of
//! the unit and of the endpoint, and is skipped with the reason where that is missing.
//!
//! ```text
//! main, cli,     the command                 case, cases/   what is tried
//! program
//! probe, profile what the unit has: Target   bench, points  what cases ask and judge with
//! endpoint/      what carries the bytes      run, report/   one after another; table, JUnit, JSON
//! frame          CRC, LRC, RTU, ASCII        vectors        worked frames of manuals
//! hil/           a board on a bench: timing,  rate           to another rate and back
//!                wires; command modio-hil    interrupt      Ctrl-C, with the unit put back first
//! ```
//!
//! Nothing here is shared with the server that it judges.

#![forbid(unsafe_code)]

pub mod bench;
pub mod case;
pub mod cases;
pub mod cli;
pub mod endpoint;
pub mod frame;
pub mod hil;
pub mod interrupt;
pub mod line;
pub mod points;
pub mod probe;
pub mod profile;
pub mod program;
pub mod rate;
pub mod report;
pub mod run;
pub mod target;
pub mod vectors;
