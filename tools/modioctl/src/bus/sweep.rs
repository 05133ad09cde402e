//! Looks for units: asks every address for its identity with function 11, with a short time-out.
//!
//! A unit answers function 11 from its protocol stack in a few milliseconds, and a unit without the function
//! rejects it as fast. A unit with a RESPONSE_DELAY drops its answer when the next request comes, so it is found only
//! with a longer wait. Answers contain the address of their unit, so a late answer is still assigned to the right
//! unit. When an answer was late, or the received bytes were no answer, the addresses whose requests may have been
//! disturbed are asked again with a longer time-out.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::adu::{ASCII_MOST, Framing, response_length};
use super::answer::{Lost, MOST, is_from_gateway};
use super::master::Master;

/// Report Server ID (V1.1b3, 6.13). Its response differs from the request, so an adapter that returns the request
/// is not mistaken for a unit.
pub const REPORT: u8 = 0x11;

/// Time that an address has for the first byte of its answer: t3.5 at 9600 bit/s and the 16 ms for which adapters
/// hold bytes back, with a margin.
pub const SHORT: Duration = Duration::from_millis(25);

/// The same for an address that was silent. Finds units with a RESPONSE_DELAY up to 100 ms.
pub const LONG: Duration = Duration::from_millis(150);

/// Largest pause between bytes of a response.
const IDLE: Duration = Duration::from_millis(40);

/// Time-out and number of retries for an address that is asked again.
const AGAIN: (Duration, u8) = (Duration::from_millis(300), 1);

/// Result of one or several sweeps of a line.
#[derive(Debug, Default)]
pub struct Found {
    /// Units that answered.
    pub units: BTreeSet<u8>,
    /// Addresses whose answer was garbled.
    pub garbled: BTreeSet<u8>,
    /// Addresses for which a gateway had no time.
    pub busy: BTreeSet<u8>,
    /// Whether bytes were received all the time. The sweep then ended early.
    pub never_silent: bool,
    /// Number of requests to each address for which no answer has been received.
    open: BTreeMap<u8, u8>,
}

impl Found {
    fn asked(&mut self, unit: u8, times: u8) {
        let open = self.open.entry(unit).or_default();
        *open = open.saturating_add(times);
    }

    /// Takes an answer of a unit. An answer without a request is from a second unit with this address. An address
    /// that was never asked is not looked for.
    fn answered(&mut self, unit: u8) {
        match self.open.get_mut(&unit) {
            None => {}
            Some(0) => {
                self.garbled.insert(unit);
            }
            Some(open) => {
                *open -= 1;
                self.units.insert(unit);
            }
        }
    }
}

/// What was received after the request to an address.
enum Turn {
    /// Nothing, or the answer of this address.
    Quiet,
    /// The answer of a unit that was asked earlier.
    Late(u8),
    /// Bytes that are not an answer.
    Garbled,
}

impl Master {
    /// Asks these addresses, except those that are already found. Each has the time `wait` to begin its answer. Calls
    /// `asked` with each address.
    pub async fn sweep(
        &mut self,
        units: &[u8],
        wait: Duration,
        found: &mut Found,
        mut asked: impl FnMut(u8),
    ) -> io::Result<()> {
        let mut suspects = BTreeSet::new();
        let mut got = Vec::new();
        for (n, unit) in units.iter().enumerate() {
            asked(*unit);
            // Its answer may have been late.
            if found.units.contains(unit) {
                continue;
            }
            let before = units.get(..n).unwrap_or_default();
            match self.offer(*unit, wait, &mut got, found).await? {
                Turn::Quiet => {}
                Turn::Late(late) => {
                    // The late answer disturbed the requests that were sent after its own request.
                    let since = before.iter().rev().take_while(|unit| **unit != late);
                    suspects.extend(since);
                    suspects.insert(*unit);
                }
                Turn::Garbled => {
                    suspects.extend(before.last());
                    suspects.insert(*unit);
                }
            }
            if found.never_silent {
                return Ok(());
            }
        }
        // The adapter or a gateway may still hold answers.
        let until = Instant::now() + self.endpoint().timeout.min(Duration::from_millis(300));
        while got.len() < MOST && self.read_until(until, &mut got).await? > 0 {}
        if let Some(late) = self.take(&mut got, found) {
            suspects.extend(units.iter().rev().take_while(|unit| **unit != late));
        }
        let (timeout, retries) = AGAIN;
        let usual = self.be_patient(timeout.min(self.endpoint().timeout), retries);
        for unit in suspects.difference(&found.units.clone()) {
            found.asked(*unit, 1 + retries);
            match self.ask(*unit, &[REPORT]).await {
                Ok(_) => found.answered(*unit),
                Err(Lost::Silent | Lost::Absent(_)) => {}
                Err(Lost::Garbled(mut bytes)) => {
                    // Late answers of other units are not garbled ones of this unit.
                    while next(self.endpoint().framing, &mut bytes, found).is_some() {}
                    if !bytes.is_empty() {
                        found.garbled.insert(*unit);
                    }
                }
                Err(Lost::Broken(error)) => return Err(error),
            }
        }
        self.be_patient(usual.0, usual.1);
        Ok(())
    }

    async fn offer(
        &mut self,
        unit: u8,
        wait: Duration,
        got: &mut Vec<u8>,
        found: &mut Found,
    ) -> io::Result<Turn> {
        // Other units take a request that follows an answer without t3.5 as a part of it.
        sleep_until(self.free()).await;
        got.clear();
        let mut turn = Turn::Quiet;
        let frame = self.put(unit, &[REPORT]).await?;
        found.asked(unit, 1);
        let mut until = self.free() + wait;
        let end = until + wait + self.endpoint().time_of(ASCII_MOST) + IDLE;
        loop {
            if got.len() >= MOST || Instant::now() >= end {
                found.never_silent = true;
                return Ok(Turn::Garbled);
            }
            if self.read_until(until.min(end), got).await? == 0 {
                return Ok(if got.is_empty() { turn } else { Turn::Garbled });
            }
            if got.starts_with(&frame) {
                got.drain(..frame.len());
                self.note_echo();
            }
            match self.take(got, found) {
                Some(answered) if answered == unit && got.is_empty() => return Ok(turn),
                Some(late) if late != unit => turn = Turn::Late(late),
                _ => until = until.max(Instant::now() + IDLE),
            }
        }
    }

    /// Removes complete answers from the received bytes. Returns the unit of the last one.
    fn take(&mut self, got: &mut Vec<u8>, found: &mut Found) -> Option<u8> {
        let mut last = None;
        while let Some((unit, frame)) = next(self.endpoint().framing, got, found) {
            self.received(&frame);
            last = Some(unit);
        }
        last
    }
}

/// Removes a complete answer from the beginning of the received bytes. Returns its unit and its frame.
fn next(framing: Framing, got: &mut Vec<u8>, found: &mut Found) -> Option<(u8, Vec<u8>)> {
    let length = match framing {
        Framing::Rtu => response_length(&[REPORT], got),
        Framing::Ascii | Framing::Mbap => framing.length(got),
    }?;
    let (unit, pdu) = framing.open(got.get(..length)?)?;
    // A gateway answers for a missing unit. The request itself, which an adapter returns late, is no answer.
    let absent = match pdu[..] {
        [function, code] => function == REPORT | 0x80 && is_from_gateway(code),
        _ => pdu == [REPORT],
    };
    if !absent {
        found.answered(unit);
    }
    Some((unit, got.drain(..length).collect()))
}
