//! Sends requests to units, one at a time, and receives what answers them.

use std::io;
use std::time::Duration;

use tokio::time::{Instant, timeout, timeout_at};

use super::adu::{ASCII_MOST, Framing};
use super::answer::{Lost, MOST, differs, present};
use super::endpoint::Endpoint;
use super::late::Late;
use super::stream::Stream;
use super::{Direction, Waiting};
use crate::failure::Failure;

/// Silence that ends an answer, in addition to the time of some characters. USB adapters deliver bytes in batches,
/// 16 ms apart and more.
const BATCH: Duration = Duration::from_millis(60);

/// Number of bytes in front of a request that are discarded at most.
const STALE: usize = 16 * 1024;

/// Time limit for the system to take the bytes of a frame, in addition to the time of the frame on the line.
const SENDING: Duration = Duration::from_secs(2);

/// Number of bytes in front of a returned request that are tolerated, as in front of an answer.
const NOISE: usize = 3;

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

    /// Removes late answers from the beginning of the received bytes. `now` is the pending request. Returns whether there
    /// were any.
    pub(super) fn take_late(&mut self, got: &mut Vec<u8>, now: Option<(u8, &[u8])>) -> bool {
        let mut any = false;
        while let Some((frame, sent)) = self.late.take(self.endpoint.framing, got, now) {
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

    /// Returns the time to wait for an answer.
    pub(super) fn patience(&self) -> Duration {
        let timeout = self.endpoint.timeout;
        match self.endpoint.framing {
            Framing::Mbap => self.late.patience(timeout),
            Framing::Rtu | Framing::Ascii => timeout,
        }
    }

    /// Sends a request once, and waits for its answer.
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
