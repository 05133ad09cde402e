//! Who has been alive since the watchdog was last fed.
//!
//! Every task leaves its mark, the watchdog is fed only when all marks are there, and feeding takes
//! them back. A task that hangs, or is starved by one that does, so resets the device.

use core::sync::atomic::{AtomicU8, Ordering};

/// A task that has to be alive, and the place of its mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The line's interrupt.
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

/// Leaves a task's mark. A single store: interrupts can afford it.
#[inline]
pub fn mark(marks: &Marks, task: Task) {
    let [line, serve, scan, background] = marks;
    let mark = match task {
        Task::Line => line,
        Task::Serve => serve,
        Task::Scan => scan,
        Task::Background => background,
    };
    mark.store(1, Ordering::Relaxed);
}

/// Whether all tasks have left their marks; if so, they are taken back. A mark left while they are
/// being taken back may be lost, which costs one round.
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

    #[test]
    fn only_all_marks_together_count_and_each_only_once() {
        let tasks = [Task::Line, Task::Serve, Task::Scan, Task::Background];
        for missing in tasks {
            let marks = Marks::default();
            tasks
                .into_iter()
                .filter(|&task| task != missing)
                .for_each(|task| mark(&marks, task));
            assert!(!take_all(&marks), "{missing:?} is missing");
            mark(&marks, missing);
            assert!(take_all(&marks));
            assert!(!take_all(&marks), "the marks were taken back");
        }
    }
}
