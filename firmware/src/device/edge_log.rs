//! The log of the last edges of all digital inputs, file 3.

use modbus_server::{Exception, Span};
use register_map::edges::log::{EDGES, END, FIRST, LATE, LEVEL_SHIFT, RECORDS};

use super::points::words_of;

/// Bits of a mark: the point, the level, and whether the scan was late.
const POINT: u8 = 0b1_1111;
const HIGH: u8 = 1 << 5;
const LATE_SCAN: u8 = 1 << 7;

/// The last edges. The times and the marks are separate, because together they would need padding.
#[derive(Debug)]
pub(super) struct EdgeLog {
    times: [u32; EDGES as usize],
    marks: [u8; EDGES as usize],
    /// Number of edges since the start, modulo 65,536.
    count: u16,
    /// Time of the last late scan.
    late_ms: Option<u32>,
}

impl EdgeLog {
    /// Returns an empty log.
    pub const fn new() -> Self {
        Self {
            times: [0; _],
            marks: [0; _],
            count: 0,
            late_ms: None,
        }
    }

    /// Stores that a scan at this time was late: inputs were not read for some milliseconds.
    pub const fn set_late(&mut self, ms: u32) {
        self.late_ms = Some(ms);
    }

    /// Adds an edge of a point to this level at a time, which is not 0. `debounce_ms`: the time for which the input has had
    /// the new level.
    // Not inlined, which takes 32 bytes less.
    #[inline(never)]
    pub fn add(&mut self, point: u16, level: bool, ms: u32, debounce_ms: u16) {
        // The first of the samples with the new level may be that of the late scan.
        let window = u32::from(debounce_ms.max(1));
        let late = self
            .late_ms
            .is_some_and(|late_ms| ms.wrapping_sub(late_ms) < window);
        let mark =
            point as u8 & POINT | if level { HIGH } else { 0 } | if late { LATE_SCAN } else { 0 };
        let index = usize::from(self.count % EDGES);
        if let (Some(time), Some(own)) = (self.times.get_mut(index), self.marks.get_mut(index)) {
            (*time, *own) = (ms, mark);
        }
        self.count = self.count.wrapping_add(1);
    }

    /// Checks whether these records can be read.
    ///
    /// # Errors
    ///
    /// Exception 02 for records after the end.
    pub fn check_read(records: Span) -> Result<(), Exception> {
        if records.end() <= u32::from(END) {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    /// Returns a record that [`Self::check_read`] has accepted.
    pub fn record(&self, record: u16) -> u16 {
        let Some(record) = record.checked_sub(FIRST) else {
            return self.count;
        };
        // The place of the next edge is that of the oldest.
        let index = usize::from(self.count.wrapping_add(record / RECORDS) % EDGES);
        let (Some(time), Some(mark)) = (self.times.get(index), self.marks.get(index)) else {
            return 0;
        };
        let [high, low] = words_of(*time);
        match record % RECORDS {
            0 => {
                let late = if mark & LATE_SCAN != 0 { LATE } else { 0 };
                let level = u16::from(mark & HIGH != 0) << LEVEL_SHIFT;
                u16::from(mark & POINT) | level | late
            }
            1 => high,
            _ => low,
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    /// Returns the edges from the oldest to the newest.
    fn edges(log: &EdgeLog) -> Vec<[u16; 3]> {
        let first = (FIRST..END).step_by(RECORDS.into());
        first
            .map(|first| [0, 1, 2].map(|n| log.record(first + n)))
            .collect()
    }

    #[test]
    fn the_newest_edge_is_the_last_of_the_log() {
        let mut log = EdgeLog::new();
        assert_eq!((log.record(0), edges(&log)), (0, std::vec![[0; 3]; 64]));
        log.add(31, true, 0x0001_0002, 5);
        log.add(16, false, 0x0001_0003, 5);
        assert_eq!(log.record(0), 2);
        let expected = [[0; 3], [0x011F, 1, 2], [0x0010, 1, 3]];
        assert_eq!(edges(&log)[61..], expected);
    }

    #[test]
    fn a_full_log_drops_the_oldest_edge_and_the_count_wraps() {
        let mut log = EdgeLog::new();
        for ms in 1..=65_538 {
            log.add(3, ms % 2 == 1, ms, 0);
        }
        assert_eq!(log.record(0), 2);
        let edges = edges(&log);
        assert_eq!(edges[0], [0x0103, 0, 65_475]);
        assert_eq!(edges[63], [0x0003, 1, 2]);
    }

    #[test]
    fn an_edge_is_late_when_its_debounce_began_with_a_late_scan() {
        let mut log = EdgeLog::new();
        let late = |log: &mut EdgeLog, ms, debounce_ms| {
            log.add(0, true, ms, debounce_ms);
            log.record(END - RECORDS) & LATE != 0
        };
        assert!(!late(&mut log, 1, 1000), "no scan was late yet");
        log.set_late(40);
        assert!(late(&mut log, 40, 0) && !late(&mut log, 41, 0));
        assert!(late(&mut log, 40, 1) && !late(&mut log, 41, 1));
        assert!(late(&mut log, 44, 5) && !late(&mut log, 45, 5));
    }
}
