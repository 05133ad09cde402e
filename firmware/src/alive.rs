//! Who has been alive since the watchdog was last fed.
//!
//! Every task leaves its mark, the watchdog is fed only when all marks are there, and feeding takes
//! them back. A task that hangs, or is starved by one that does, so resets the device; the marks then
//! tell which it was: one without a mark did not run, one that has [`BEGUN`] did not come to its end.

use core::sync::atomic::{AtomicU8, Ordering};

/// The mark of a task that has begun.
pub const BEGUN: u8 = 2;
/// The mark of a task that has come to its end.
pub const ENDED: u8 = 1;

/// A task that has to be alive, and the place of its mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The line's interrupts.
    Line,
    /// The serving of requests.
    Serve,
    /// The scan of the modules.
    Scan,
    /// The background work.
    Background,
}

/// Marks, one for each [`Task`] in the order of the variants: 0 is none. They may lie where a reset
/// leaves them alone, so that the start after a bite can tell whose was missing.
pub type Marks = [AtomicU8; 4];

/// Marks a task as begun. A single store: interrupts can afford it.
#[inline]
pub fn begin(marks: &Marks, task: Task) {
    of(marks, task).store(BEGUN, Ordering::Relaxed);
}

/// Marks a task as ended.
#[inline]
pub fn end(marks: &Marks, task: Task) {
    of(marks, task).store(ENDED, Ordering::Relaxed);
}

/// The mark of a task as it is.
#[inline]
#[must_use]
pub fn look(marks: &Marks, task: Task) -> u8 {
    of(marks, task).load(Ordering::Relaxed)
}

/// Puts back the mark that [`look`] saw, after a run that is no proof of life.
#[inline]
pub fn put_back(marks: &Marks, task: Task, mark: u8) {
    of(marks, task).store(mark, Ordering::Relaxed);
}

/// The line's interrupts have no time for a second mark: a task they can interrupt, and which
/// therefore runs after their end, leaves it for them.
#[inline]
pub fn end_line(marks: &Marks) {
    let line = of(marks, Task::Line);
    // One that comes in between is marked as ended, which it is when this goes on.
    if line.load(Ordering::Relaxed) == BEGUN {
        line.store(ENDED, Ordering::Relaxed);
    }
}

#[inline]
const fn of(marks: &Marks, task: Task) -> &AtomicU8 {
    let [line, serve, scan, background] = marks;
    match task {
        Task::Line => line,
        Task::Serve => serve,
        Task::Scan => scan,
        Task::Background => background,
    }
}

/// Whether all tasks have left their marks; if so, they are taken back. For the one who runs when no
/// task does, so that what has begun has ended too. A mark left while they are being taken back may be
/// lost, which costs one round.
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

    const TASKS: [Task; 4] = [Task::Line, Task::Serve, Task::Scan, Task::Background];

    #[test]
    fn only_all_marks_together_count_and_each_only_once() {
        for missing in TASKS {
            let marks = Marks::default();
            TASKS
                .into_iter()
                .filter(|&task| task != missing)
                .for_each(|task| end(&marks, task));
            assert!(!take_all(&marks), "{missing:?} is missing");
            begin(&marks, missing);
            assert!(take_all(&marks));
            assert!(!take_all(&marks), "the marks were taken back");
        }
    }

    #[test]
    fn what_has_begun_is_told_from_what_has_ended() {
        let marks = Marks::default();
        end_line(&marks);
        let left = || TASKS.map(|task| look(&marks, task));
        assert_eq!(left(), [0; 4], "no line, no mark");
        begin(&marks, Task::Line);
        begin(&marks, Task::Scan);
        end(&marks, Task::Background);
        assert_eq!(left(), [BEGUN, 0, BEGUN, ENDED]);
        end_line(&marks);
        end(&marks, Task::Scan);
        assert_eq!(left(), [ENDED, 0, ENDED, ENDED]);
        let before = look(&marks, Task::Serve);
        begin(&marks, Task::Serve);
        put_back(&marks, Task::Serve, before);
        assert_eq!(left(), [ENDED, 0, ENDED, ENDED]);
    }
}
