//! The fuzz targets. Each decodes an input into a script of events, applies it to the code and to an independent
//! model, and panics when the two differ.
//!
//! | target | input | model |
//! |---|---|---|
//! | `receiver_rtu`, `receiver_ascii` | characters, faults, silences, buffers in use by requests | [`modbus_reference::Receiver`] |
//! | `pdu` | requests of any content to one server, and their replies | [`modbus_reference::Server`] |
//! | `store` | flash pages of any content, saves, starts, power cuts, wear | [`pages`]; a start finds what was saved last |
//!
//! Every target accepts any bytes. `examples/seeds` writes the seeds in `corpus/`.

#[path = "../../modbus-server/tests/common/mod.rs"]
#[allow(missing_docs, clippy::all)] // the tests' own
pub mod common;
#[path = "../../firmware/tests/store/flash.rs"]
#[allow(missing_docs, dead_code)] // as above
mod flash;
pub mod pages;
pub mod pdu;
pub mod receiver;
#[path = "../../firmware/tests/store/running.rs"]
#[allow(missing_docs, dead_code)] // as above
mod running;
pub mod script;
pub mod store;

/// Bytes of a page of the store.
const PAGE_SIZE: usize = register_map::board::MODIO_02.store.bytes as usize;
