//! A suite of cases that a Modbus serial-line server must pass. The suite tests the server from outside, by raw bytes
//! on a serial line, a socket or a simulated line.
//!
//! Each case cites its source: *V1.02* is Modbus over Serial Line V1.02, *V1.1b3* the Modbus Application Protocol
//! V1.1b3, *map* the register map of the modio. A case lists what it needs of the unit and of the endpoint. If
//! something is missing, the case is skipped with the reason.
//!
//! ```text
//! main, cli      the command                  case, cases/   the cases
//! probe, profile the unit under test: Target  tester, points steps of cases: requests and checks
//! endpoint/      the lines                    run, report/   runs cases; table, JUnit, JSON
//! frame          RTU and ASCII frames         vectors        worked frames of manuals
//! hil/           a bench with a board         interrupt      Ctrl-C
//!                                             about          unit, adapter, host and date of a run
//! ```
//!
//! The suite shares no code with the server that it tests.

#![forbid(unsafe_code)]

pub mod about;
pub mod case;
pub mod cases;
pub mod check;
pub mod cli;
pub mod endpoint;
pub mod frame;
pub mod hil;
pub mod interrupt;
pub mod points;
pub mod probe;
pub mod profile;
pub mod rate;
pub mod report;
pub mod run;
pub mod target;
pub mod tester;
pub mod vectors;
