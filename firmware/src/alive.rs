//! Checks that every task has run since the watchdog was last refreshed.
//!
//! Every task sets its mark. The watchdog is refreshed only when all marks are set, and the refresh clears them. A
//! task that hangs, or is blocked by one that hangs, therefore causes a watchdog reset. The marks then show which
//! task it was: a task without a mark did not run, and a task with the mark [`BEGUN`] did not finish.

use core::sync::atomic::{AtomicU8, Ordering};

use ports::marks::{ENDED, TASKS};

/// Mark of a task that has begun.
pub const BEGUN: u8 = 2;

/// A task that must set its mark. The interrupts of priority 4 come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The UART of the RS-485 line.
    Uart,
    /// The silences of that line.
    Gap,
    /// The time limit of a reply, and the turns of an arbitration.
    Alarm,
    /// The device's clock.
    Beat,
    /// The UART of the second line.
    SecondUart,
    /// The frames of the second line.
    Second,
    /// The task that serves requests.
    Serve,
    /// The task that scans the modules.
    Scan,
    /// The background task.
    Background,
}

/// Number of tasks that are only marked as begun, because their time is short: the first ones.
const INTERRUPTS: usize = 5;
/// Position of [`Task::Serve`]. The tasks before it belong to a line.
const FIRST_AFTER_LINES: u16 = Task::Serve as u16;

/// The marks, one for each [`Task`] in the order of the variants; 0 means no mark. They may lie in memory that a
/// reset keeps, so that the start after a watchdog reset can report the missing ones.
pub type Marks = [AtomicU8; TASKS];

/// Marks a task as begun. This is a single store, cheap enough for interrupts.
#[inline(always)]
pub fn begin(marks: &Marks, task: Task) {
    marks[task as usize].store(BEGUN, Ordering::Relaxed);
}

/// Marks a task as finished.
#[inline(always)]
pub fn end(marks: &Marks, task: Task) {
    marks[task as usize].store(ENDED, Ordering::Relaxed);
}

/// Marks the interrupts that have begun as finished. They have no time to set a second mark, so a task of lower
/// priority, which runs only after they have returned, calls this for them.
#[inline(never)]
pub fn end_interrupts(marks: &Marks) {
    for mark in marks.iter().take(INTERRUPTS) {
        // An interrupt between the load and the store is also marked as finished, which is correct: it has returned
        // by then.
        if mark.load(Ordering::Relaxed) == BEGUN {
            mark.store(ENDED, Ordering::Relaxed);
        }
    }
}

/// Returns the bits of register MISSING_TASKS for the tasks that are missing, one bit each in the order of the
/// variants of [`Task`]: bit 0 is any task of a line, 1 serve, 2 scan, 3 background.
#[must_use]
pub const fn missing_tasks(missing: u16) -> u16 {
    let line = missing & ((1 << FIRST_AFTER_LINES) - 1) != 0;
    missing >> FIRST_AFTER_LINES << 1 | line as u16
}

/// Returns whether all tasks have set their marks, and clears the marks if so. Call this from `idle`, where every
/// task that has started has also finished. A mark that is set during the clearing may be lost, which only delays
/// the next refresh by one round.
pub fn take_all(marks: &Marks) -> bool {
    let all = marks.iter().all(|mark| mark.load(Ordering::Relaxed) != 0);
    if all {
        marks
            .iter()
            .for_each(|mark| mark.store(0, Ordering::Relaxed));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Task; TASKS] = [
        Task::Uart,
        Task::Gap,
        Task::Alarm,
        Task::Beat,
        Task::SecondUart,
        Task::Second,
        Task::Serve,
        Task::Scan,
        Task::Background,
    ];

    #[test]
    fn all_marks_are_required_and_each_counts_once() {
        for missing in ALL {
            let marks = Marks::default();
            ALL.into_iter()
                .filter(|&task| task != missing)
                .for_each(|task| end(&marks, task));
            assert!(!take_all(&marks), "{missing:?} is missing");
            begin(&marks, missing);
            assert!(take_all(&marks));
            assert!(!take_all(&marks), "the marks were cleared");
        }
    }

    #[test]
    fn a_begun_task_is_distinguished_from_a_finished_one() {
        let marks = Marks::default();
        end_interrupts(&marks);
        let of = |task| marks[task as usize].load(Ordering::Relaxed);
        let left = || [Task::Gap, Task::Scan, Task::Background].map(of);
        assert_eq!(left(), [0; 3], "no interrupt, no mark");
        begin(&marks, Task::Gap);
        begin(&marks, Task::Scan);
        end(&marks, Task::Background);
        assert_eq!(left(), [BEGUN, BEGUN, ENDED]);
        end_interrupts(&marks);
        assert_eq!(left(), [ENDED, BEGUN, ENDED]);
    }

    #[test]
    fn every_task_of_a_line_is_bit_0_of_the_register() {
        let bits = ALL.map(|task| missing_tasks(1 << task as u16));
        assert_eq!(bits, [1, 1, 1, 1, 1, 1, 2, 4, 8]);
        assert_eq!(missing_tasks(0x1FF), 0b1111);
    }
}
