//! A scan, without sending: what to send next, and when the scan has ended.

use std::collections::{BTreeMap, BTreeSet};

use super::{Reply, Request};

/// Number of times that a request is sent at most while no unit replies as it should.
const TRIES: u8 = 3;

/// Number of rounds after which a scan ends on a line where no round is undisturbed.
const ROUNDS: u8 = 8;

/// What was received after a request of a scan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A reply.
    Reply(Reply),
    /// Bytes that are no reply.
    Damaged,
    /// Nothing.
    Nothing,
}

/// A scan of one line.
///
/// A unit whose reply was damaged counts itself as found, and a unit that did not receive the start of the scan may do so
/// too. Both are hidden until the next start. So a scan goes on in rounds until two in a row have found the same, and one
/// of them was without disturbance: the same unit may be hidden twice.
#[derive(Debug, Default)]
pub struct Scan {
    units: BTreeMap<u32, u8>,
    /// Units of this round.
    round: BTreeSet<(u32, u8)>,
    /// Units of the round before, and whether each request of that round had its reply.
    before: Option<(BTreeSet<(u32, u8)>, bool)>,
    /// A unit has replied in this round, also if its reply was damaged.
    has_begun: bool,
    /// A request of this round had no reply, or a damaged one.
    has_failed: bool,
    tries: u8,
    rounds: u8,
    has_ended: bool,
    is_disturbed: bool,
}

impl Scan {
    /// Returns the next request; `None` when the scan has ended.
    #[must_use]
    pub fn next(&self) -> Option<Request> {
        let request = if self.has_begun {
            Request::ContinueScan
        } else {
            Request::StartScan
        };
        (!self.has_ended).then_some(request)
    }

    /// Takes what was received after the request.
    pub fn hear(&mut self, heard: Heard) {
        self.is_disturbed |= heard == Heard::Damaged;
        self.has_begun |= heard != Heard::Nothing;
        match heard {
            Heard::Reply(Reply::Found { serial, unit }) => {
                self.units.insert(serial, unit);
                if self.round.insert((serial, unit)) {
                    self.tries = 0;
                } else {
                    // The unit has not understood that it is found.
                    self.failed();
                }
            }
            Heard::Reply(_) => self.end_round(),
            Heard::Damaged | Heard::Nothing => self.failed(),
        }
    }

    /// Returns the serial numbers and addresses of the units that were found.
    #[must_use]
    pub const fn units(&self) -> &BTreeMap<u32, u8> {
        &self.units
    }

    /// Returns whether damaged replies were received.
    #[must_use]
    pub const fn is_disturbed(&self) -> bool {
        self.is_disturbed
    }

    fn failed(&mut self) {
        self.has_failed = true;
        self.tries += 1;
        if self.tries == TRIES {
            self.end_round();
        }
    }

    fn end_round(&mut self) {
        let round = std::mem::take(&mut self.round);
        let is_good = !std::mem::take(&mut self.has_failed);
        let has_begun = std::mem::take(&mut self.has_begun);
        self.tries = 0;
        self.rounds += 1;
        self.has_ended = self.rounds == ROUNDS
            || match &self.before {
                // A line without units needs no undisturbed round.
                Some((before, was_good)) => {
                    *before == round && (is_good || *was_good || self.units.is_empty())
                }
                None => !has_begun,
            };
        self.before = Some((round, is_good));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Units with these serial numbers. `hear` returns what is received instead of a reply, by the number of the
    /// request.
    fn scan(serials: &[u32], hear: impl Fn(usize) -> Option<Heard>) -> (Scan, usize) {
        let mut scan = Scan::default();
        let mut left = BTreeSet::new();
        for n in 0.. {
            let Some(request) = scan.next() else {
                return (scan, n);
            };
            if request == Request::StartScan {
                left = serials.iter().copied().collect();
            }
            let reply = match left.pop_first() {
                Some(serial) => Reply::Found {
                    serial,
                    unit: serial as u8,
                },
                None => Reply::NoneLeft,
            };
            scan.hear(hear(n).unwrap_or(Heard::Reply(reply)));
        }
        unreachable!("the scan has an end")
    }

    fn found(scan: &Scan) -> Vec<u32> {
        scan.units().keys().copied().collect()
    }

    #[test]
    fn two_rounds_that_find_the_same_are_enough() {
        let (scan, requests) = scan(&[3, 1, 2], |_| None);
        assert_eq!(found(&scan), [1, 2, 3]);
        assert_eq!(requests, 2 * 4);
        assert!(!scan.is_disturbed());
    }

    #[test]
    fn a_unit_whose_reply_is_damaged_is_found_in_the_next_round() {
        let (scan, requests) = scan(&[1, 2, 3], |n| (n == 1).then_some(Heard::Damaged));
        assert_eq!(found(&scan), [1, 2, 3]);
        assert_eq!(requests, 3 * 4);
        assert!(scan.is_disturbed());
    }

    #[test]
    fn a_unit_whose_replies_are_damaged_in_two_rounds_is_found_in_the_third() {
        let damaged = |n| [1, 5].contains(&n).then_some(Heard::Damaged);
        let (scan, requests) = scan(&[1, 2, 3], damaged);
        assert_eq!(found(&scan), [1, 2, 3]);
        assert_eq!(requests, 4 * 4);
    }

    #[test]
    fn a_damaged_first_reply_does_not_start_the_scan_again() {
        let (scan, _) = scan(&[1], |n| (n == 0).then_some(Heard::Damaged));
        assert_eq!(found(&scan), [1]);
        let mut scan = Scan::default();
        scan.hear(Heard::Damaged);
        assert_eq!(scan.next(), Some(Request::ContinueScan));
    }

    #[test]
    fn a_request_without_a_reply_is_sent_again() {
        let (scan, _) = scan(&[1, 2], |n| {
            [0, 2, 4].contains(&n).then_some(Heard::Nothing)
        });
        assert_eq!(found(&scan), [1, 2]);
    }

    #[test]
    fn a_silent_line_has_three_requests() {
        let (scan, requests) = scan(&[], |_| Some(Heard::Nothing));
        assert_eq!((found(&scan), requests), (vec![], 3));
    }

    #[test]
    fn a_line_with_only_noise_ends_after_two_rounds() {
        let (scan, requests) = scan(&[], |_| Some(Heard::Damaged));
        assert_eq!((found(&scan), requests), (vec![], 6));
    }

    #[test]
    fn a_scan_ends_on_a_line_where_every_round_finds_something_else() {
        let mut serial = 0;
        let mut scan = Scan::default();
        let mut requests = 0;
        while let Some(request) = scan.next() {
            requests += 1;
            serial += 1;
            scan.hear(match request {
                Request::StartScan => Heard::Reply(Reply::Found { serial, unit: 1 }),
                _ => Heard::Reply(Reply::NoneLeft),
            });
        }
        assert_eq!(requests, 2 * usize::from(ROUNDS));
    }

    #[test]
    fn a_unit_that_is_found_again_and_again_does_not_keep_the_scan_going() {
        let again = Heard::Reply(Reply::Found { serial: 9, unit: 9 });
        let (scan, requests) = scan(&[9], |_| Some(again.clone()));
        assert_eq!(found(&scan), [9]);
        assert_eq!(requests, 4 * usize::from(ROUNDS));
    }
}
