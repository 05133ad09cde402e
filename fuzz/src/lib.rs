//! The fuzz targets. Most decode an input into a script of events, apply it to the code and to an independent model,
//! and panic when the two differ.
//!
//! | target | input | model |
//! |---|---|---|
//! | `receiver_rtu`, `receiver_ascii` | characters, faults, silences, buffers in use by requests | [`modbus_reference::Receiver`] |
//! | `pdu` | requests of any content to one server, and their replies | [`modbus_reference::Server`] |
//! | `fast` | frames of function 70, arbitrations, edges, to a whole device | none: replies are valid, and the unit works in the end |
//! | `store` | flash pages of any content, saves, starts, power cuts, wear | [`pages`]; a start finds what was saved last |
//! | `update` | a slot with any content; pages of the boot state with any content, changes, starts, power cuts | the header read in another way; a start finds what was written last |
//! | `description` | a document with any content | none: its own limits, and the same after encoding and decoding |
//!
//! Every target accepts any bytes.

use register_map::board::Board;

#[path = "../../modbus-server/tests/common/mod.rs"]
#[allow(missing_docs, clippy::all)] // the tests' own
pub mod common;
pub mod description;
pub mod fast;
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
pub mod update;

/// A board that has everything: slots, events, START = as it was.
type B = register_map::board::Modio08;

/// Bytes of a page of the store.
const PAGE_SIZE: usize = B::ROW.store().bytes as usize;
