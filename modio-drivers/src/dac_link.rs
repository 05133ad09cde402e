//! The link between the fast side of the analog outputs, a module's driver in the scan, and the slow side, a
//! [`DacWorker`](crate::DacWorker) in a background task.

use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering::SeqCst};

use crate::{CHANNELS, Code};

/// A mailbox with the codes for the four DAC channels in one direction and the state of the DAC in the other. It is
/// meant to be a `static`. One driver posts, one worker collects.
///
/// Codes posted together are collected together. The worker compares the number of posts before and after reading,
/// as in a seqlock, so it detects a post that interrupted it and reads again.
#[derive(Debug)]
pub struct DacLink {
    codes: [AtomicU16; CHANNELS],
    /// Number of posts times two; odd during a post.
    posts: AtomicU32,
    /// Codes have been posted since the start.
    posted: AtomicBool,
    failed: AtomicBool,
}

/// Number of attempts to collect before the next call continues. Posts are made once per millisecond, and
/// collecting takes well below a microsecond.
const ATTEMPTS: u8 = 3;

impl DacLink {
    /// Returns a link without codes and without a failure.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            codes: [const { AtomicU16::new(0) }; CHANNELS],
            posts: AtomicU32::new(0),
            posted: AtomicBool::new(false),
            failed: AtomicBool::new(false),
        }
    }

    /// Returns whether the DAC does not answer or its bus is stuck.
    #[must_use]
    pub fn failed(&self) -> bool {
        self.failed.load(SeqCst)
    }

    /// Posts the codes for the channels A to D.
    pub(crate) fn post(&self, wanted: [Code; CHANNELS]) {
        let same = self.codes.iter().zip(wanted);
        if self.posted.load(SeqCst) && same.into_iter().all(|(c, w)| c.load(SeqCst) == w.get()) {
            return;
        }
        self.posts.fetch_add(1, SeqCst);
        for (code, wanted) in self.codes.iter().zip(wanted) {
            code.store(wanted.get(), SeqCst);
        }
        self.posts.fetch_add(1, SeqCst);
        self.posted.store(true, SeqCst);
    }

    /// Returns the codes posted last. Returns `None` before the first post, and in the unlikely case that a post
    /// interrupted every attempt.
    pub(crate) fn wanted(&self) -> Option<[Code; CHANNELS]> {
        self.collect(|| ())
    }

    /// Collects the codes, calling `interrupt` before each code to simulate a post at that point.
    fn collect(&self, mut interrupt: impl FnMut()) -> Option<[Code; CHANNELS]> {
        if !self.posted.load(SeqCst) {
            return None;
        }
        for _ in 0..ATTEMPTS {
            let before = self.posts.load(SeqCst);
            let codes = self.codes.each_ref().map(|code| {
                interrupt();
                Code::new(code.load(SeqCst))
            });
            if before.is_multiple_of(2) && self.posts.load(SeqCst) == before {
                return Some(codes);
            }
        }
        None
    }

    pub(crate) fn set_failed(&self, failed: bool) {
        self.failed.store(failed, SeqCst);
    }
}

impl Default for DacLink {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::thread;

    use super::*;

    #[test]
    fn the_codes_posted_last_are_collected_and_none_before_the_first_post() {
        let link = DacLink::new();
        assert_eq!(link.wanted(), None);
        link.post([0; 4].map(Code::new));
        assert_eq!(
            link.wanted(),
            Some([0; 4].map(Code::new)),
            "zeros count as a post, too"
        );
        link.post([1, 2, 3, 4].map(Code::new));
        link.post([1, 2, 3, 4].map(Code::new));
        assert_eq!(link.wanted(), Some([1, 2, 3, 4].map(Code::new)));
        assert_eq!(
            link.posts.load(SeqCst),
            4,
            "posting equal codes again is no post"
        );
        assert!(!link.failed());
        link.set_failed(true);
        assert!(link.failed());
    }

    #[test]
    fn a_post_that_is_not_finished_is_not_collected() {
        let link = DacLink::new();
        link.post([7; 4].map(Code::new));
        link.posts.fetch_add(1, SeqCst);
        assert_eq!(link.wanted(), None);
        link.posts.fetch_add(1, SeqCst);
        assert_eq!(link.wanted(), Some([7; 4].map(Code::new)));
    }

    #[test]
    fn a_post_that_interrupts_at_any_code_is_collected_completely() {
        for place in 0..CHANNELS {
            let link = DacLink::new();
            link.post([1; 4].map(Code::new));
            let mut calls = 0;
            let collected = link.collect(|| {
                if calls == place {
                    link.post([2; 4].map(Code::new));
                }
                calls += 1;
            });
            assert_eq!(
                collected,
                Some([2; 4].map(Code::new)),
                "before code {place}"
            );
        }

        let link = DacLink::new();
        link.post([0; 4].map(Code::new));
        let mut calls = 0;
        let collected = link.collect(|| {
            calls += 1;
            link.post([calls; 4].map(Code::new));
        });
        assert_eq!(collected, None, "every attempt was interrupted");
        assert_eq!(calls, u16::from(ATTEMPTS) * 4);
        assert_eq!(link.wanted(), Some([calls; 4].map(Code::new)));
    }

    #[test]
    fn codes_posted_together_are_collected_together() {
        static LINK: DacLink = DacLink::new();
        static DONE: AtomicBool = AtomicBool::new(false);
        let poster = thread::spawn(|| {
            for n in (0..4095).cycle() {
                LINK.post([n; 4].map(Code::new));
                if DONE.load(SeqCst) {
                    return n;
                }
                (0..50).for_each(|_| core::hint::spin_loop());
            }
            unreachable!("the numbers never end");
        });
        let mut collected = 0;
        while collected < 10_000 {
            if let Some(codes) = LINK.wanted() {
                assert_eq!(codes, [codes[0]; 4]);
                collected += 1;
            }
        }
        DONE.store(true, SeqCst);
        let last = poster.join().unwrap();
        assert_eq!(LINK.wanted(), Some([last; 4].map(Code::new)));
    }
}
