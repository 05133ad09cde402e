//! Sends requests to units, one at a time.

use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep, timeout, timeout_at};

use super::adu::{ASCII_MOST, Framing};
use super::endpoint::Endpoint;
use super::gateway::{is_busy, is_from_gateway};
use super::late::Late;
use super::stream::Stream;
use super::{Direction, Waiting};
use crate::failure::Failure;
use register_map::state::PRODUCT_CODE;

/// Silence that ends an answer, in addition to the time of some characters. USB adapters deliver bytes in batches,
/// 16 ms apart and more.
const BATCH: Duration = Duration::from_millis(60);

/// Number of received bytes after which a line counts as never silent: several of the longest frames.
pub const MOST: usize = 4 * ASCII_MOST;

/// Number of bytes in front of a request that are discarded at most.
const STALE: usize = 16 * 1024;

/// Time limit for the system to take the bytes of a frame, in addition to the time of the frame on the line.
const SENDING: Duration = Duration::from_secs(2);

/// Pause before a read is repeated because the unit or a gateway is busy.
const BUSY: Duration = Duration::from_millis(200);

/// Number of times that a read is repeated because the unit or a gateway is busy. It does not depend on `--retries`: that
/// is for lost requests.
const BUSY_TIMES: u8 = 2;

/// Reads one register. The response never equals the request, so this shows whether an adapter returns what it sends.
pub const PROBE: [u8; 5] = {
    let [high, low] = PRODUCT_CODE.to_be_bytes();
    [3, high, low, 0, 1]
};

/// Number of bytes in front of a returned request that are tolerated, as in front of an answer.
const NOISE: usize = 3;

/// Reason why a request had no answer.
#[derive(Debug)]
pub enum Lost {
    /// Nothing was received.
    Silent,
    /// A gateway answered that the unit does not answer it: exception 0A or 0B.
    Absent(u8),
    /// These bytes were received, and they are not an answer.
    Garbled(Vec<u8>),
    /// The port or the connection is lost.
    Broken(io::Error),
}

/// A frame, or bytes that were received instead of one.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Time when it was sent, or was complete.
    pub at: Instant,
    /// Direction of the frame.
    pub direction: Direction,
    /// Framing of the line.
    pub framing: Framing,
    /// Bytes of the frame.
    pub bytes: Vec<u8>,
}

/// Receives every frame, for the trace and the frame log.
pub type Observer = Box<dyn FnMut(&Seen) + Send>;

/// An open line with its settings.
pub struct Master {
    endpoint: Endpoint,
    stream: Stream,
    observer: Option<Observer>,
    pub(super) transaction: u16,
    /// Time from which the next frame may be sent.
    free: Instant,
    /// Number of the latest request whose answer was garbled.
    garbled: u16,
    /// Whether the adapter returns what it sends; `None` while that is not known.
    pub(super) echo: Option<bool>,
    /// Requests whose answer may still be received.
    pub(super) late: Late,
}

impl Master {
    /// Opens the line.
    pub async fn open(endpoint: Endpoint, observer: Option<Observer>) -> Result<Self, Failure> {
        Ok(Self {
            stream: Stream::open(&endpoint).await?,
            endpoint,
            observer,
            transaction: 0,
            garbled: 0,
            free: Instant::now(),
            echo: None,
            late: Late::default(),
        })
    }

    /// Returns the settings of the line.
    pub const fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Returns the number of the latest request whose answer was garbled.
    pub const fn garbled_transaction(&self) -> u16 {
        self.garbled
    }

    /// Returns whether the adapter has returned what it sends.
    pub const fn has_echo(&self) -> bool {
        matches!(self.echo, Some(true))
    }

    /// Notes that the adapter returns what it sends.
    pub(super) const fn note_echo(&mut self) {
        self.echo = Some(true);
    }

    /// Changes rate, format and framing of the line. When the port does not support the settings, the line keeps its
    /// present ones.
    pub fn change_line(&mut self, endpoint: Endpoint) -> Result<(), Failure> {
        self.stream.change(&endpoint)?;
        self.endpoint = endpoint;
        Ok(())
    }

    /// Closes the line and discards bytes that the system has not sent yet. Otherwise a request without an answer
    /// could be delivered late, for example when a cable is plugged in again.
    pub fn close_unsent(self) {
        self.stream.discard_unsent();
    }

    /// Sends a request to a unit. Repeats it without an answer of the unit as often as the endpoint says, and a read also
    /// when the unit is busy. Returns the PDU of the response, which may be an exception. The error is that of the last
    /// attempt, unless an earlier one was garbled.
    pub async fn ask(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        if self.echo.is_none() && !differs(pdu) {
            self.look_for_echo(unit).await?;
        }
        let mut was_silent = false;
        if self.endpoint.framing != Framing::Mbap && self.late.can_be_confused(unit, pdu) {
            was_silent = self.wait_for_order(unit, pdu).await?;
        }
        let result = self.repeat(unit, pdu).await;
        if was_silent && result.is_ok() {
            self.late.has_no_08(unit);
        }
        result
    }

    async fn repeat(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        let mut busy = 0;
        let mut lost = 0;
        let mut result = Err(Lost::Silent);
        loop {
            let next = self.ask_once(unit, pdu).await;
            match &next {
                Ok(answer) if is_busy(pdu, answer) && busy < BUSY_TIMES => {
                    busy += 1;
                    sleep(BUSY).await;
                    continue;
                }
                Ok(_) | Err(Lost::Broken(_)) => return next,
                Err(Lost::Silent | Lost::Absent(_)) if is_garbled(&result) => {}
                Err(_) => result = next,
            }
            if lost == self.endpoint.retries {
                return result;
            }
            lost += 1;
        }
    }

    /// Finds out whether the adapter returns what it sends. Without that a response that equals its request proves
    /// nothing. Silence leaves it open, and the request is sent nevertheless: a unit in listen-only mode obeys without
    /// an answer.
    pub(super) async fn look_for_echo(&mut self, unit: u8) -> Result<(), Lost> {
        let mut result = Ok(());
        for _ in 0..=self.endpoint.retries {
            match self.ask_once(unit, &PROBE).await {
                Err(Lost::Broken(error)) => return Err(Lost::Broken(error)),
                Err(Lost::Silent) => {}
                Err(garbled) if self.echo.is_none() => result = Err(garbled),
                _ => return Ok(()),
            }
        }
        result
    }

    /// Sends a request when the line is free. Returns before the request has been sent completely.
    async fn send(&mut self, unit: u8, pdu: &[u8]) -> io::Result<()> {
        self.settle().await?;
        self.put(unit, pdu).await?;
        Ok(())
    }

    /// Sends a request immediately. Returns its frame.
    pub(super) async fn put(&mut self, unit: u8, pdu: &[u8]) -> io::Result<Vec<u8>> {
        self.transaction = self.transaction.wrapping_add(1);
        let frame = self.endpoint.framing.frame(self.transaction, unit, pdu);
        self.see(Direction::Request, &frame);
        let time = self.endpoint.time_of(frame.len());
        // A port whose other end reads nothing takes no more bytes when its buffer is full.
        timeout(SENDING + time, self.stream.write(&frame))
            .await
            .unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))?;
        // The system takes all bytes together and sends them one by one.
        let sent = Instant::now() + time;
        self.free = sent + self.endpoint.frame_gap();
        Ok(frame)
    }

    /// Sets time-out and retries. Returns the previous values.
    pub(crate) const fn be_patient(&mut self, timeout: Duration, retries: u8) -> (Duration, u8) {
        let before = (self.endpoint.timeout, self.endpoint.retries);
        (self.endpoint.timeout, self.endpoint.retries) = (timeout, retries);
        before
    }

    /// Returns the time from which the next frame may be sent.
    pub const fn free(&self) -> Instant {
        self.free
    }

    /// Sets the time from which the next frame may be sent.
    pub(super) const fn free_from(&mut self, time: Instant) {
        self.free = time;
    }

    /// Waits until the line is free, and discards received bytes: they answer no pending request.
    pub(super) async fn settle(&mut self) -> io::Result<()> {
        // On a line that is never silent, the request is sent nevertheless.
        let most = self.free + self.endpoint.timeout;
        let mut discarded = 0;
        loop {
            let mut stale = Vec::new();
            let count = self.read_until(self.free, &mut stale).await?;
            discarded += count;
            if count == 0 || self.free > most || discarded > STALE {
                return Ok(());
            }
            self.take_late(&mut stale, None);
            if !stale.is_empty() {
                self.see(Direction::Response, &stale);
            }
            let gap = Instant::now() + self.endpoint.frame_gap();
            self.free = self.free.max(gap);
        }
    }

    /// Reads once, until `until` at most. Returns 0 when nothing was received.
    pub async fn read_until(&mut self, until: Instant, into: &mut Vec<u8>) -> io::Result<usize> {
        let mut chunk = [0; 512];
        match timeout_at(until, self.stream.read(&mut chunk)).await {
            Err(_) => Ok(0),
            Ok(Ok(0)) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(Ok(count)) => {
                into.extend(chunk.get(..count).unwrap_or_default());
                Ok(count)
            }
            Ok(Err(error)) => Err(error),
        }
    }

    pub(super) async fn ask_once(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        self.send(unit, pdu).await.map_err(Lost::Broken)?;
        let sent = self.free;
        let waiting = Waiting {
            framing: self.endpoint.framing,
            transaction: self.transaction,
            unit,
            pdu,
        };
        let own = waiting.framing.frame(self.transaction, unit, pdu);
        let mut last = sent + self.patience();
        // An answer that has begun in time has the same time again. Nothing is longer, except a line that is never
        // silent.
        let longest = self.endpoint.timeout + self.endpoint.time_of(ASCII_MOST);
        let mut end = last + longest;
        let idle = BATCH + self.endpoint.time_of(12);
        let mut returned = false;
        let mut junk = Vec::new();
        let mut got = Vec::new();
        let mut until = last;
        loop {
            let never_silent = junk.len() + got.len() >= MOST || Instant::now() >= end;
            let read = match never_silent {
                true => Ok(0),
                false => self.read_until(until.min(end), &mut got).await,
            };
            if read.map_err(Lost::Broken)? > 0 {
                returned = returned || self.drop_echo(&own, &mut got);
                if self.take_late(&mut got, Some((unit, pdu))) {
                    // The unit, or a gateway, begins this request only now.
                    last = Instant::now() + self.patience();
                    end = last + longest;
                    if got.is_empty() {
                        until = last;
                        continue;
                    }
                }
                // A busy computer delivers an answer, or an echo, in pieces with a pause between them.
                let mut all = [junk.as_slice(), &got].concat();
                if !returned && self.drop_echo(&own, &mut all) {
                    returned = true;
                    junk.clear();
                    got.clone_from(&all);
                }
                for bytes in [&got, &all] {
                    if let Some((answer, range)) = waiting.find(bytes) {
                        self.received(bytes.get(range).unwrap_or_default());
                        self.note_no_echo(pdu);
                        return present(answer);
                    }
                }
                until = Instant::now() + idle;
                continue;
            }
            // A silence ends the answer: later bytes do not belong to it.
            if let Some(answer) = waiting.whole(&got) {
                self.received(&got);
                self.note_no_echo(pdu);
                return present(answer);
            }
            junk.append(&mut got);
            if never_silent || Instant::now() >= last {
                break;
            }
            until = last;
        }
        self.late.add(&waiting, sent);
        if junk.is_empty() {
            return Err(Lost::Silent);
        }
        self.garbled = self.transaction;
        self.received(&junk);
        Err(Lost::Garbled(junk))
    }

    /// Removes the request from the received bytes if the adapter returns it. Returns whether it did. Bytes that equal
    /// the request are an echo until a response that differs from its request has shown that there is none.
    pub(super) fn drop_echo(&mut self, own: &[u8], got: &mut Vec<u8>) -> bool {
        let starts = 0..=NOISE.min(got.len());
        let mut starts = starts.filter(|start| got[*start..].starts_with(own));
        match starts.next() {
            Some(start) if self.echo.unwrap_or(true) => {
                self.echo = Some(true);
                got.drain(..start + own.len());
                true
            }
            _ => false,
        }
    }

    /// Notes that the adapter does not return what it sends: this request would have shown an echo.
    const fn note_no_echo(&mut self, pdu: &[u8]) {
        if self.echo.is_none() && differs(pdu) {
            self.echo = Some(false);
        }
    }

    /// Passes a frame, or bytes received instead of one, to the observer.
    pub(super) fn received(&mut self, bytes: &[u8]) {
        self.see(Direction::Response, bytes);
        self.free = Instant::now() + self.endpoint.frame_gap();
    }

    fn see(&mut self, direction: Direction, bytes: &[u8]) {
        if let Some(observer) = &mut self.observer {
            observer(&Seen {
                at: Instant::now(),
                direction,
                framing: self.endpoint.framing,
                bytes: bytes.to_vec(),
            });
        }
    }
}

const fn is_garbled(result: &Result<Vec<u8>, Lost>) -> bool {
    matches!(result, Err(Lost::Garbled(_)))
}

/// Returns the answer of a unit. A gateway answers for a unit that is absent.
fn present(answer: Vec<u8>) -> Result<Vec<u8>, Lost> {
    match answer[..] {
        [0x80..=0xFF, code] if is_from_gateway(code) => Err(Lost::Absent(code)),
        _ => Ok(answer),
    }
}

/// Returns whether every response to this request differs from the request.
const fn differs(pdu: &[u8]) -> bool {
    matches!(
        pdu,
        [
            0x01..=0x04 | 0x07 | 0x0B | 0x0C | 0x0F..=0x11 | 0x14 | 0x17 | 0x18,
            ..
        ] | [0x2B, 0x0E, ..]
    )
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::bus::Place;

    /// As a simulator that is stopped: its pseudo-terminal is full at some time.
    #[tokio::test]
    async fn port_whose_other_end_reads_nothing_is_an_error() {
        let pair = portable_pty::native_pty_system()
            .openpty(portable_pty::PtySize::default())
            .unwrap();
        let port = pair.master.tty_name().unwrap();
        let place = Place::Serial(port.to_str().unwrap().to_owned());
        let endpoint = Endpoint::new(place, Framing::Rtu);
        let mut master = Master::open(endpoint, None).await.unwrap();
        let error = loop {
            if let Err(error) = master.put(1, &[0x41; 253]).await {
                break error;
            }
        };
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }
}
