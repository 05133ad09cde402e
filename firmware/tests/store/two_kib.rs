//! The same tests on a flash whose pages have 2 KiB.

mod cuts;
mod flash;
mod outputs;
mod running;
mod wear;

use register_map::board::Board;

/// A board with four slots, DEADBAND and START = as it was, whose pages have 2 KiB.
type B = register_map::board::Modio08;

/// Bytes of a page.
const PAGE_SIZE: usize = B::ROW.store().bytes as usize;
