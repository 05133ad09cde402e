//! The times of the last edges of digital inputs, 0x0380 to 0x03BF: two registers per point. And the log of the last edges
//! of all digital inputs, file 3.

use crate::block::block;
use crate::rule::Rule;
use crate::value::Value;

block! {
    "Last edges of digital inputs", 0x0380..=0x03BF;

    /// Uptime of the last edge; 0 = none
    LAST_EDGE "last edge": 0x0380 x 64, Value::long("ms"), Rule::read_only();
}

/// The log of edges: a file that is read with function 14.
///
/// ```text
///  record    0       1       2      3      4            190 191 192
///         +-------+-------+------+------+-------+-----+-----------------+
///         | count | point | time | time | point | ... | the newest edge |
///         +-------+-------+------+------+-------+-----+-----------------+
/// ```
pub mod log {
    /// File number.
    pub const FILE: u16 = 3;
    /// Number of edges in the log.
    pub const EDGES: u16 = 64;
    /// First record of the oldest edge. Record 0 is the number of edges since the start, modulo 65,536.
    pub const FIRST: u16 = 1;
    /// Records of an edge: the point with the marks below, and the uptime in ms, high word first. All are 0 for an edge
    /// that has not happened yet.
    pub const RECORDS: u16 = 3;
    /// Number of records of the file.
    pub const END: u16 = FIRST + EDGES * RECORDS;
    /// Lowest bit of the new level in the first record of an edge. The address of the point is below it.
    pub const LEVEL_SHIFT: u32 = 8;
    /// Mark in the first record of an edge: the input was not read while flash was erased, so the edge may have happened
    /// earlier than its time says.
    pub const LATE: u16 = 1 << 15;
}
