//! Checks that every task has run since the watchdog was last refreshed.
//!
//! Every task sets its mark. The watchdog is refreshed only when all marks are set, and the refresh clears them. A
//! task that hangs, or is blocked by one that hangs, therefore causes a watchdog reset. The marks then show which
//! task it was: a task without a mark did not run, and a task with the mark [`BEGUN`] did not finish.

use core::sync::atomic::{AtomicU8, Ordering};

/// Mark of a task that has begun.
pub const BEGUN: u8 = 2;
/// Mark of a task that has finished.
pub const ENDED: u8 = 1;

/// A task that must set its mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The interrupts of the line.
    Line,
    /// The task that serves requests.
    Serve,
    /// The task that scans the modules.
    Scan,
    /// The background task.
    Background,
}

/// The marks, one for each [`Task`] in the order of the variants; 0 means no mark. They may lie in memory that a
/// reset keeps, so that the start after a watchdog reset can report the missing ones.
pub type Marks = [AtomicU8; 4];

/// Marks a task as begun. This is a single store, cheap enough for interrupts.
#[inline]
pub fn begin(marks: &Marks, task: Task) {
    of(marks, task).store(BEGUN, Ordering::Relaxed);
}

/// Marks a task as finished.
#[inline]
pub fn end(marks: &Marks, task: Task) {
    of(marks, task).store(ENDED, Ordering::Relaxed);
}

/// Returns the mark of a task.
#[inline]
#[must_use]
pub fn look(marks: &Marks, task: Task) -> u8 {
    of(marks, task).load(Ordering::Relaxed)
}

/// Restores the mark that [`look`] returned, after a run that does not prove that the task works.
#[inline]
pub fn put_back(marks: &Marks, task: Task, mark: u8) {
    of(marks, task).store(mark, Ordering::Relaxed);
}

/// Marks the line's interrupts as finished if they have begun. They have no time to set a second mark, so a task of
/// lower priority, which runs only after they have returned, calls this for them.
#[inline]
pub fn end_line(marks: &Marks) {
    let line = of(marks, Task::Line);
    // An interrupt between the load and the store is also marked as finished, which is correct: it has returned by
    // then.
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

    const TASKS: [Task; 4] = [Task::Line, Task::Serve, Task::Scan, Task::Background];

    #[test]
    fn all_marks_are_required_and_each_counts_once() {
        for missing in TASKS {
            let marks = Marks::default();
            TASKS
                .into_iter()
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
        end_line(&marks);
        let left = || TASKS.map(|task| look(&marks, task));
        assert_eq!(left(), [0; 4], "no line interrupt, no mark");
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
