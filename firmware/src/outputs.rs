//! The outputs that start as they were: their values as they are stored, and how often they are.

use heapless::Vec;
use register_map::configuration::{RECORD_AFTER_S, RECORD_EVERY_S, RECORDS};
use register_map::points;

use crate::budget::Budget;

/// Number of records that are possible after a power-on: a few, so that a supply that fails again and again does not wear
/// the flash.
pub const AFTER_POWER_ON: u8 = 4;

/// The values of the outputs that are to start as they were, as pairs of a record.
pub type Outputs = Vec<(u16, u16), { points::COUNT as usize }>;

/// When outputs are compared with the stored ones, and stored if they differ.
#[derive(Debug)]
pub struct Schedule {
    budget: Budget<RECORDS, RECORD_EVERY_S>,
    compared_ms: u32,
}

impl Schedule {
    /// Returns the schedule of a start. `kept` is the number of records that were possible before it, above [`RECORDS`]
    /// after a power-on.
    #[must_use]
    pub const fn new(kept: u8) -> Self {
        let left = if kept > RECORDS { AFTER_POWER_ON } else { kept };
        Self {
            budget: Budget::new(left),
            compared_ms: 0,
        }
    }

    /// Returns whether the outputs are to be compared now, `now_ms` milliseconds after the start: every
    /// [`RECORD_AFTER_S`] seconds, while a record is possible.
    pub const fn is_due(&mut self, now_ms: u32) -> bool {
        let passed = now_ms.wrapping_sub(self.compared_ms);
        if passed < RECORD_AFTER_S * 1000 {
            return false;
        }
        self.compared_ms = now_ms;
        self.budget.tick(passed);
        self.budget.left() > 0
    }

    /// Returns the number of records that are possible now, to be kept over a reset.
    #[must_use]
    pub const fn left(&self) -> u8 {
        self.budget.left()
    }

    /// Uses one record up.
    pub const fn take(&mut self) {
        self.budget.take();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a schedule for some seconds with outputs that change all the time. Returns the number of records.
    fn records(schedule: &mut Schedule, now_ms: &mut u32, seconds: u32) -> u32 {
        let mut records = 0;
        for _ in 0..seconds * 100 {
            *now_ms = now_ms.wrapping_add(10);
            if schedule.is_due(*now_ms) {
                schedule.take();
                records += 1;
            }
        }
        records
    }

    #[test]
    fn outputs_that_change_all_the_time_are_stored_80_times_a_day() {
        let mut schedule = Schedule::new(RECORDS);
        let mut now = 0;
        assert_eq!(records(&mut schedule, &mut now, 9), 0);
        assert_eq!(records(&mut schedule, &mut now, 791), 80, "one in 10 s");
        assert_eq!(schedule.left(), 0);
        assert_eq!(records(&mut schedule, &mut now, 86_400), 80);
        assert_eq!(records(&mut schedule, &mut now, 86_400), 80);
    }

    #[test]
    fn budget_is_kept_over_a_restart_and_small_after_a_power_on() {
        let mut now = u32::MAX - 5_000;
        for (kept, expected) in [(0, 0), (7, 7), (80, 80), (81, 4), (255, 4)] {
            assert_eq!(Schedule::new(kept).left(), expected);
        }
        let mut schedule = Schedule::new(u8::MAX);
        schedule.compared_ms = now;
        assert_eq!(records(&mut schedule, &mut now, 1_079), 4, "over the wrap");
        assert_eq!(records(&mut schedule, &mut now, 1_080), 1);
    }
}
