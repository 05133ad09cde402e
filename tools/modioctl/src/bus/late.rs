//! Answers that are received after the time-out of their request.
//!
//! On Modbus TCP the transaction id shows which request an answer belongs to. On a serial line nothing shows it: a late
//! answer to a read looks like the answer to the next read of the same length. But a unit answers in the order of the
//! requests. The master therefore sends function 08/00 with a new word before such a read, and waits for that word: no
//! older answer follows it.

use std::collections::VecDeque;
use std::time::Duration;

use tokio::time::Instant;

use super::Waiting;
use super::adu::Framing;
use super::master::{Lost, Master};

/// Time after which an answer is no longer expected.
const LATEST: Duration = Duration::from_secs(20);

/// Largest number of requests that are remembered.
const MOST: usize = 256;

/// A request without an answer.
#[derive(Debug)]
struct Owed {
    transaction: u16,
    unit: u8,
    pdu: Vec<u8>,
    sent: Instant,
}

/// The requests whose answer may still be received.
#[derive(Debug, Default)]
pub struct Late {
    owed: VecDeque<Owed>,
    /// Time of the last late answer.
    answered: Option<Instant>,
    /// Longest time for one answer.
    longest: Duration,
}

impl Late {
    /// Adds a request that was sent at this time.
    pub fn add(&mut self, request: &Waiting, sent: Instant) {
        self.forget_old();
        if self.owed.len() == MOST {
            self.owed.pop_front();
        }
        self.owed.push_back(Owed {
            transaction: request.transaction,
            unit: request.unit,
            pdu: request.pdu.to_vec(),
            sent,
        });
    }

    /// Returns whether any late answer can be received.
    pub fn is_expected(&mut self) -> bool {
        self.forget_old();
        !self.owed.is_empty()
    }

    /// Returns whether a late answer of this unit can be mistaken for the answer to this request on a serial line.
    pub fn can_be_confused(&mut self, unit: u8, pdu: &[u8]) -> bool {
        self.forget_old();
        let of_same = |owed: &Owed| owed.unit == unit && owed.pdu.first() == pdu.first();
        let mut owed = self.owed.iter();
        owed.any(|owed| of_same(owed) && owed.pdu != pdu)
    }

    /// Notes that this unit has answered 08/00, and so all requests before it that it received.
    pub fn passed(&mut self, unit: u8) {
        self.owed
            .retain(|owed| owed.unit != unit || owed.pdu.first() == Some(&8));
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
            waiting.find(first).map(|(_, range)| (n, range))
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
        self.owed.retain(|owed| owed.sent.elapsed() < LATEST);
    }
}

impl Master {
    /// Waits until the unit has answered 08/00 with a new word, and therefore all requests before it.
    pub(super) async fn wait_for_order(&mut self, unit: u8) -> Result<(), Lost> {
        if self.echo.is_none() {
            self.look_for_echo(unit).await?;
        }
        let mut result = Err(Lost::Silent);
        // A unit that answers nothing does not answer this either, and its response could not be distinguished from an
        // echo.
        if self.echo.is_none() {
            return result;
        }
        for _ in 0..=self.endpoint().retries {
            let [high, low] = self.transaction.to_be_bytes();
            result = match self.ask_once(unit, &[8, 0, 0, high, low]).await {
                Ok(_) | Err(Lost::Absent(_)) => {
                    self.late.passed(unit);
                    return Ok(());
                }
                Err(lost @ Lost::Broken(_)) => return Err(lost),
                Err(lost) => Err(lost),
            };
        }
        result
    }

    /// Removes late answers from the beginning of the received bytes. `now` is the pending request. Returns whether there
    /// were any.
    pub(super) fn take_late(&mut self, got: &mut Vec<u8>, now: Option<(u8, &[u8])>) -> bool {
        let mut any = false;
        while let Some((frame, sent)) = self.late.take(self.endpoint().framing, got, now) {
            self.late.received(sent);
            self.received(&frame);
            any = true;
        }
        any
    }

    /// Returns the longest time that a late answer took; zero if no answer was late.
    pub const fn lateness(&self) -> Duration {
        self.late.longest()
    }

    /// Returns the time to wait for an answer. A gateway that was late is given more than the time-out: otherwise the
    /// requests that wait in it would become more and more.
    pub(super) fn patience(&self) -> Duration {
        let timeout = self.endpoint().timeout;
        match self.endpoint().framing {
            Framing::Mbap => timeout.max(self.lateness() * 5 / 4),
            Framing::Rtu | Framing::Ascii => timeout,
        }
    }
}
