//! Tests of the configuration store on a strict mock flash, with power cuts at every possible place.

mod cuts;
mod flash;
#[expect(dead_code, reason = "the board keeps no outputs")]
mod running;
mod vectors;
mod wear;

use register_map::board::Board;

/// A board with one slot, whose pages have 1 KiB.
type B = register_map::board::Modio02;

/// Bytes of a page.
const PAGE_SIZE: usize = B::ROW.store().bytes as usize;
