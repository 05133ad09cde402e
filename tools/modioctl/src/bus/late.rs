//! Answers that are received after the time-out of their request.
//!
//! On Modbus TCP the transaction id shows which request an answer belongs to. On a serial line nothing shows it: a late
//! answer to a read looks like the answer to the next read of the same length. But a unit answers in the order of the
//! requests. The master therefore sends function 08/00 with a new word before such a read, and waits for that word: no
//! older answer follows it.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use tokio::time::Instant;

use super::Waiting;
use super::adu::Framing;

/// Time after a time-out from which an answer is no longer expected.
const LATEST: Duration = Duration::from_secs(20);

/// Largest number of requests that are remembered.
const REMEMBERED: usize = 256;

/// Longest time to wait for a late gateway, in time-outs.
const MOST_PATIENCE: u32 = 4;

/// A request without an answer.
#[derive(Debug)]
struct Owed {
    transaction: u16,
    unit: u8,
    pdu: Vec<u8>,
    sent: Instant,
    /// Time of the time-out.
    given_up: Instant,
}

/// The requests whose answer may still be received.
#[derive(Debug, Default)]
pub struct Late {
    owed: VecDeque<Owed>,
    /// Time of the last late answer.
    answered: Option<Instant>,
    /// Longest time for one answer.
    longest: Duration,
    /// Units that answer, and whether they answer function 08, too.
    has_08: BTreeMap<u8, bool>,
}

impl Late {
    /// Adds a request that was sent at this time.
    pub fn add(&mut self, request: &Waiting, sent: Instant) {
        self.forget_old();
        if self.owed.len() == REMEMBERED {
            self.owed.pop_front();
        }
        self.owed.push_back(Owed {
            transaction: request.transaction,
            unit: request.unit,
            pdu: request.pdu.to_vec(),
            sent,
            given_up: Instant::now(),
        });
    }

    /// Returns whether any late answer can be received.
    pub fn is_expected(&mut self) -> bool {
        self.forget_old();
        !self.owed.is_empty()
    }

    /// Returns whether a late answer of this unit can be mistaken for the answer to this request on a serial line. The
    /// answer to a write shows its address.
    pub fn can_be_confused(&mut self, unit: u8, pdu: &[u8]) -> bool {
        self.forget_old();
        if matches!(pdu, [0x05 | 0x06 | 0x0F | 0x10 | 0x16, ..]) {
            return false;
        }
        let of_same = |owed: &Owed| owed.unit == unit && owed.pdu.first() == pdu.first();
        let mut owed = self.owed.iter();
        owed.any(|owed| of_same(owed) && owed.pdu != pdu)
    }

    /// Notes that this unit has answered 08/00, and so all requests before it that it received.
    pub fn passed(&mut self, unit: u8) {
        self.owed
            .retain(|owed| owed.unit != unit || owed.pdu.first() == Some(&8));
        self.has_08.insert(unit, true);
    }

    /// Returns whether this unit has function 08, if that is known.
    pub fn has_08(&self, unit: u8) -> Option<bool> {
        self.has_08.get(&unit).copied()
    }

    /// Returns the time of the last late answer.
    pub const fn answered(&self) -> Option<Instant> {
        self.answered
    }

    /// Forgets what this unit owes.
    pub fn forget(&mut self, unit: u8) {
        self.owed.retain(|owed| owed.unit != unit);
    }

    /// Notes that this unit answers, and was silent to function 08.
    pub fn has_no_08(&mut self, unit: u8) {
        self.has_08.insert(unit, false);
    }

    /// Removes a late answer from the beginning of the received bytes. `now` is the pending request, whose answer stays.
    /// Returns the frame, and when its request was sent.
    pub fn take(
        &mut self,
        framing: Framing,
        bytes: &mut Vec<u8>,
        now: Option<(u8, &[u8])>,
    ) -> Option<(Vec<u8>, Instant)> {
        let first = match framing {
            Framing::Rtu => bytes.as_slice(),
            Framing::Ascii | Framing::Mbap => bytes.get(..framing.length(bytes)?)?,
        };
        let mut owed = self.owed.iter().enumerate();
        let (n, range) = owed.find_map(|(n, owed)| {
            // On a serial line the answer to an earlier attempt is accepted: it cannot be distinguished.
            if framing != Framing::Mbap && now == Some((owed.unit, &owed.pdu)) {
                return None;
            }
            let waiting = Waiting {
                framing,
                transaction: owed.transaction,
                unit: owed.unit,
                pdu: &owed.pdu,
            };
            let (answer, range) = waiting.find(first)?;
            // An exception does not show the word that was sent. It also proves the order when it is the answer to an
            // earlier 08, if that was sent after all that the order is for.
            let is_for_08 = matches!(now, Some((unit, [8, ..])) if unit == owed.unit);
            let mut later = self.owed.iter().skip(n);
            let proves = framing != Framing::Mbap
                && (is_for_08 && answer.first() == Some(&0x88))
                && !later.any(|later| later.unit == owed.unit && later.pdu.first() != Some(&8));
            (!proves).then_some((n, range))
        })?;
        let owed = self.owed.remove(n)?;
        Some((bytes.drain(..range.end).collect(), owed.sent))
    }

    /// Notes that a late answer has just been received.
    pub fn received(&mut self, sent: Instant) {
        let now = Instant::now();
        // A gateway handles one request after another.
        let begin = self.answered.map_or(sent, |answered| answered.max(sent));
        self.longest = self.longest.max(now - begin);
        self.answered = Some(now);
    }

    /// Returns the longest time for one late answer; zero if there was none.
    pub const fn longest(&self) -> Duration {
        self.longest
    }

    fn forget_old(&mut self) {
        self.owed.retain(|owed| owed.given_up.elapsed() < LATEST);
    }

    /// Returns the time to wait for an answer of a gateway. One that was late is given more than the time-out: otherwise
    /// the requests that wait in it would become more and more.
    pub fn patience(&self, timeout: Duration) -> Duration {
        (self.longest * 5 / 4).clamp(timeout, timeout * MOST_PATIENCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    /// A switch that restarts delays one answer.
    #[test]
    fn patience_with_a_gateway_is_some_time_outs_at_most() {
        let mut late = Late::default();
        assert_eq!(late.patience(SECOND), SECOND);
        late.received(Instant::now() - 15 * SECOND);
        assert_eq!(late.patience(SECOND), 4 * SECOND);
        assert!(late.longest() >= 15 * SECOND);
    }

    #[test]
    fn answer_after_a_time_out_of_any_length_is_expected() {
        let mut late = Late::default();
        let request = Waiting {
            framing: Framing::Rtu,
            transaction: 1,
            unit: 1,
            pdu: &[3, 0, 0, 0, 1],
        };
        late.add(&request, Instant::now() - 25 * SECOND);
        assert!(late.can_be_confused(1, &[3, 0, 1, 0, 1]));
        assert!(!late.can_be_confused(2, &[3, 0, 1, 0, 1]));
    }
}
