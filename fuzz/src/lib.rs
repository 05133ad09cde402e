//! What the fuzz targets do with an input: read it as a script of events, play it to the code and to an
//! independent model beside it, and panic where the two differ.
//!
//! | target | what it plays | the model |
//! |---|---|---|
//! | `receiver_rtu`, `receiver_ascii` | characters, faults, silences, buffers that are away | [`modbus_reference::Receiver`] |
//! | `pdu` | requests of any content to one server, and their replies | [`modbus_reference::Server`] |
//! | `store` | flash pages of any content, saves, starts, power cuts, wear | [`pages`], and: what was saved last is found |
//!
//! Every target takes any bytes. The seeds in `corpus/` are written by `examples/seeds.rs`.

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
