//! Who has been alive since the watchdog was last fed.
//!
//! Every task leaves its mark, the watchdog is fed only when all marks are there, and feeding takes
//! them back. A task that hangs, or is starved by one that does, so resets the device.

use core::sync::atomic::{AtomicBool, Ordering};

/// A task that has to be alive.
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

/// The marks.
#[derive(Debug, Default)]
pub struct Alive([AtomicBool; 4]);

impl Alive {
    /// No mark yet.
    #[must_use]
    pub const fn new() -> Self {
        Self([const { AtomicBool::new(false) }; 4])
    }

    /// Leaves a task's mark. A single store: interrupts can afford it.
    #[inline]
    pub fn mark(&self, task: Task) {
        let Self([line, serve, scan, background]) = self;
        let mark = match task {
            Task::Line => line,
            Task::Serve => serve,
            Task::Scan => scan,
            Task::Background => background,
        };
        mark.store(true, Ordering::Relaxed);
    }

    /// Whether all tasks have left their marks; if so, they are taken back. A mark left while they
    /// are being taken back may be lost, which costs one round.
    pub fn take_all(&self) -> bool {
        let all = self.0.iter().all(|mark| mark.load(Ordering::Relaxed));
        if all {
            self.0
                .iter()
                .for_each(|mark| mark.store(false, Ordering::Relaxed));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_all_marks_together_count_and_each_only_once() {
        let tasks = [Task::Line, Task::Serve, Task::Scan, Task::Background];
        for missing in tasks {
            let alive = Alive::new();
            tasks
                .into_iter()
                .filter(|&task| task != missing)
                .for_each(|task| alive.mark(task));
            assert!(!alive.take_all(), "{missing:?} is missing");
            alive.mark(missing);
            assert!(alive.take_all());
            assert!(!alive.take_all(), "the marks were taken back");
        }
    }
}
