//! Looks for units: asks every address for its identity with function 11, with a short time-out.
//!
//! A unit answers function 11 from its protocol stack in a few milliseconds, and a unit without the function
//! rejects it as fast. Answers contain the address of their unit, so a late answer is still assigned to the right
//! unit. When an answer was late, or the received bytes were no answer, the addresses whose requests may have been
//! disturbed are asked again with a longer time-out.

use std::collections::BTreeSet;
use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep_until};

use super::adu::{Framing, MBAP, response_length};
use super::is_from_gateway;
use super::master::{Lost, Master};

/// Report Server ID (V1.1b3, 6.13). Its response differs from the request, so an adapter that returns the request
/// is not mistaken for a unit.
const REPORT: u8 = 0x11;

/// Time that an address has for the first byte of its answer: t3.5 at 9600 bit/s and the 16 ms for which adapters
/// hold bytes back, with a margin.
pub const SHORT: Duration = Duration::from_millis(25);

/// Largest pause between bytes of a response.
const IDLE: Duration = Duration::from_millis(40);

/// Time-out and number of retries for an address that is asked again.
const AGAIN: (Duration, u8) = (Duration::from_millis(300), 1);

/// Result of a sweep.
#[derive(Debug, Default)]
pub struct Found {
    /// Units that answered.
    pub units: BTreeSet<u8>,
    /// Addresses whose answer was garbled.
    pub garbled: BTreeSet<u8>,
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
    /// Asks these addresses. Each has the time `wait` to begin its answer. Calls `asked` with each address.
    ///
    /// # Errors
    ///
    /// Errors of the port.
    pub async fn sweep(
        &mut self,
        units: &[u8],
        wait: Duration,
        mut asked: impl FnMut(u8),
    ) -> io::Result<Found> {
        let mut found = Found::default();
        let mut suspects = BTreeSet::new();
        let mut got = Vec::new();
        for (n, unit) in units.iter().enumerate() {
            asked(*unit);
            let before = units.get(..n).unwrap_or_default();
            match self.offer(*unit, wait, &mut got, &mut found).await? {
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
        }
        // The adapter or a gateway may still hold answers.
        let until = Instant::now() + self.endpoint().timeout.min(Duration::from_millis(300));
        while self.read_until(until, &mut got).await? > 0 {}
        if let Some(late) = self.take(&mut got, &mut found) {
            suspects.extend(units.iter().rev().take_while(|unit| **unit != late));
        }
        let (timeout, retries) = AGAIN;
        let usual = self.be_patient(timeout.min(self.endpoint().timeout), retries);
        for unit in suspects.difference(&found.units.clone()) {
            match self.ask(*unit, &[REPORT]).await {
                Ok(_) => {
                    found.units.insert(*unit);
                }
                Err(Lost::Silent) => {}
                Err(Lost::Garbled(_)) => {
                    found.garbled.insert(*unit);
                }
                Err(Lost::Broken(error)) => return Err(error),
            }
        }
        self.be_patient(usual.0, usual.1);
        Ok(found)
    }

    /// Asks one address.
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
        let mut until = self.free() + wait;
        loop {
            if self.read_until(until, got).await? == 0 {
                return Ok(if got.is_empty() { turn } else { Turn::Garbled });
            }
            if got.starts_with(&frame) && self.endpoint().framing != Framing::Mbap {
                got.drain(..frame.len());
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
        while let Some(length) = length(self.endpoint().framing, got)
            && let Some(frame) = got.get(..length)
            && let Some((unit, pdu)) = self.endpoint().framing.open(frame)
        {
            self.received(&got[..length]);
            got.drain(..length);
            last = Some(unit);
            // A gateway answers for a missing unit.
            let absent =
                matches!(pdu[..], [f, code] if f == REPORT | 0x80 && is_from_gateway(code));
            // Two answers from one address mean two units.
            if !absent && !found.units.insert(unit) {
                found.garbled.insert(unit);
            }
        }
        last
    }
}

/// Returns the length of the frame at the beginning, if it is known.
fn length(framing: Framing, bytes: &[u8]) -> Option<usize> {
    match framing {
        Framing::Rtu => response_length(&[REPORT], bytes),
        Framing::Ascii => Some(bytes.windows(2).position(|two| two == b"\r\n")? + 2),
        Framing::Mbap => {
            let header = bytes.first_chunk::<MBAP>()?;
            Some(MBAP - 1 + usize::from(u16::from_be_bytes([header[4], header[5]])))
        }
    }
}
