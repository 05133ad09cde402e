//! The last edges of digital inputs, from the log of the unit (docs/time-and-links.md).

use chrono::{DateTime, Local, TimeDelta};
use modbus_line::adu::words;
use register_map::edges::log::{END, LATE, LEVEL_SHIFT, RECORDS};

use crate::value::long;

/// Number of edges that are read, the newest of all inputs.
const EDGES: u16 = 20;
/// Number of records to read.
pub const COUNT: u16 = EDGES * RECORDS;
/// First record to read.
pub const FIRST: u16 = END - COUNT;
/// Bits of a record that are the address of the input.
const POINT: u16 = (1 << LEVEL_SHIFT) - 1;

/// An edge of a digital input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Address of the input.
    pub point: u16,
    /// New level of the input.
    pub on: bool,
    /// Whether the edge may have happened earlier, while flash was erased.
    pub late: bool,
    /// Time of the edge, by the clock of this computer.
    pub at: DateTime<Local>,
    uptime_ms: u32,
}

impl Edge {
    /// Returns the edges in these records, newest first. The unit had the uptime at the time `now`.
    pub fn all(records: &[u8], uptime_ms: u32, now: DateTime<Local>) -> Vec<Self> {
        let words = words(records);
        let (edges, _) = words.as_chunks::<{ RECORDS as usize }>();
        let edges = edges.iter().rev().filter_map(|[first, time @ ..]| {
            let at_ms = long(time);
            // An edge that has not happened yet has the time 0.
            (at_ms != 0).then(|| Self {
                point: first & POINT,
                on: first >> LEVEL_SHIFT & 1 == 1,
                late: first & LATE != 0,
                at: now - TimeDelta::milliseconds(uptime_ms.wrapping_sub(at_ms).into()),
                uptime_ms: at_ms,
            })
        });
        edges.collect()
    }

    /// Returns whether another reading is of this edge. Its time of day differs by the time that the reply took.
    pub fn is_same(&self, other: &Self) -> bool {
        (self.point, self.on, self.uptime_ms) == (other.point, other.on, other.uptime_ms)
            && (self.at - other.at).abs() < TimeDelta::seconds(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_have_the_time_of_day_and_are_newest_first() {
        // The last one is that of docs/time-and-links.md, and the one before is late.
        let words = [0, 0, 0, 0x8010, 0xFFFF, 0xFFFE, 0x0110, 0x0001, 0xE240];
        let now = Local::now();
        let read = |now| Edge::all(words.map(u16::to_be_bytes).as_flattened(), 0x0001_E241, now);
        let edges = read(now);
        let of = |edge: &Edge| {
            (
                edge.point,
                edge.on,
                edge.late,
                (now - edge.at).num_milliseconds(),
            )
        };
        let seen: Vec<_> = edges.iter().map(of).collect();
        // The uptime has wrapped between the edges.
        assert_eq!(
            seen,
            [(0x10, true, false, 1), (0x10, false, true, 0x0001_E243)]
        );
        let again = read(now + TimeDelta::milliseconds(20));
        assert!(edges[0].is_same(&again[0]) && !edges[0].is_same(&again[1]));
        assert!(
            !edges[0].is_same(&read(now + TimeDelta::minutes(1))[0]),
            "another start of the unit"
        );
    }
}
