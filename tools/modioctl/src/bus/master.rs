//! Asks units, one request at a time.

use std::io;
use std::time::Duration;

use tokio::time::{Instant, timeout_at};

use super::adu::Framing;
use super::endpoint::Endpoint;
use super::stream::Stream;
use super::{Direction, Waiting};
use crate::failure::Failure;

/// The pause after a broadcast, in which every unit carries it out (V1.02, 2.4.1: 100 to 200 ms).
const TURNAROUND: Duration = Duration::from_millis(100);

/// A silence that ends what arrives, beyond the time of some characters: adapters hand on bytes in batches, 16 ms apart
/// and more.
const BATCH: Duration = Duration::from_millis(60);

/// Why a request had no answer.
#[derive(Debug)]
pub enum Lost {
    /// Nothing came back.
    Silent,
    /// These bytes came back, and they are no answer.
    Garbled(Vec<u8>),
    /// The port or the connection is gone.
    Broken(io::Error),
}

/// A frame, or what arrived in place of one.
#[derive(Clone, Debug)]
pub struct Seen {
    /// When it was sent, or was complete.
    pub at: Instant,
    /// Which way it went.
    pub direction: Direction,
    /// How frames are marked off.
    pub framing: Framing,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// Receives every frame, for the trace and the frame log.
pub type Observer = Box<dyn FnMut(&Seen) + Send>;

/// An open line, and how to talk to units on it.
pub struct Master {
    endpoint: Endpoint,
    stream: Stream,
    observer: Option<Observer>,
    transaction: u16,
    /// From when on the next frame may be sent.
    free: Instant,
    /// Whether the adapter returns what it sends.
    echo: bool,
    /// The unit and the function of a request whose answer may still come.
    owed: Option<(u8, Vec<u8>)>,
}

impl Master {
    /// Opens the line.
    ///
    /// # Errors
    ///
    /// Why it cannot be opened.
    pub async fn open(endpoint: Endpoint, observer: Option<Observer>) -> Result<Self, Failure> {
        Ok(Self {
            stream: Stream::open(&endpoint).await?,
            endpoint,
            observer,
            transaction: 0,
            free: Instant::now(),
            echo: false,
            owed: None,
        })
    }

    /// How the line is set.
    #[must_use]
    pub const fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Opens the line anew with other settings.
    ///
    /// # Errors
    ///
    /// Why it cannot be opened.
    pub async fn reopen(self, endpoint: Endpoint) -> Result<Self, Failure> {
        let observer = self.observer;
        drop(self.stream);
        Self::open(endpoint, observer).await
    }

    /// Closes the line without sending what the system still holds. A request that got no answer is then not delivered
    /// late, when a cable is plugged in again for instance.
    pub fn close_unsent(self) {
        self.stream.discard_unsent();
    }

    /// Asks a unit, and asks again as often as the endpoint says. The response's PDU, which may be an exception's.
    ///
    /// # Errors
    ///
    /// What happened to the last attempt, unless an earlier one was garbled.
    pub async fn ask(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        let mut garbled = None;
        for _ in 0..=self.endpoint.retries {
            match self.ask_once(unit, pdu).await {
                Err(Lost::Silent) => {}
                Err(Lost::Garbled(bytes)) => garbled = Some(bytes),
                result => return result,
            }
        }
        Err(garbled.map_or(Lost::Silent, Lost::Garbled))
    }

    /// Sends a broadcast to all units.
    ///
    /// # Errors
    ///
    /// Those of the port.
    pub async fn tell_all(&mut self, pdu: &[u8]) -> io::Result<()> {
        self.send(0, pdu).await?;
        self.free = self.free.max(Instant::now() + TURNAROUND);
        Ok(())
    }

    /// Sends a request when the line is free, and returns before it is out.
    async fn send(&mut self, unit: u8, pdu: &[u8]) -> io::Result<()> {
        self.settle(unit, pdu).await?;
        self.put(unit, pdu).await?;
        Ok(())
    }

    /// Sends a request at once. Its frame.
    pub(super) async fn put(&mut self, unit: u8, pdu: &[u8]) -> io::Result<Vec<u8>> {
        self.transaction = self.transaction.wrapping_add(1);
        let frame = self.endpoint.framing.frame(self.transaction, unit, pdu);
        self.see(Direction::Request, &frame);
        self.stream.write(&frame).await?;
        // The system takes all bytes at once, and sends them one by one.
        let sent = Instant::now() + self.endpoint.time_of(frame.len());
        self.free = sent + self.endpoint.frame_gap();
        Ok(frame)
    }

    /// Sets time-out and retries. Those before.
    pub(super) fn be_patient(&mut self, timeout: Duration, retries: u8) -> (Duration, u8) {
        let before = (self.endpoint.timeout, self.endpoint.retries);
        (self.endpoint.timeout, self.endpoint.retries) = (timeout, retries);
        before
    }

    /// From when on the next frame may be sent.
    pub(super) const fn free(&self) -> Instant {
        self.free
    }

    /// Waits until the line is free, and forgets what arrived: it answers nothing that is still waited for.
    async fn settle(&mut self, unit: u8, pdu: &[u8]) -> io::Result<()> {
        if let Some((asked, request)) = self.owed.take()
            && self.endpoint.framing != Framing::Mbap
            && asked == unit
            && request != pdu
        {
            // A late answer could be taken for the answer to this.
            self.free = self.free.max(Instant::now() + self.endpoint.timeout);
        }
        // On a line that is never quiet the request goes out nevertheless.
        let most = self.free + self.endpoint.timeout;
        loop {
            let mut stale = Vec::new();
            if self.read_until(self.free, &mut stale).await? == 0 || self.free > most {
                return Ok(());
            }
            self.see(Direction::Response, &stale);
            let gap = Instant::now() + self.endpoint.frame_gap();
            self.free = self.free.max(gap);
        }
    }

    /// Reads once, until then at most; 0 when nothing came.
    ///
    /// # Errors
    ///
    /// Those of the port.
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

    async fn ask_once(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        self.send(unit, pdu).await.map_err(Lost::Broken)?;
        let sent = self.free;
        let waiting = Waiting {
            framing: self.endpoint.framing,
            transaction: self.transaction,
            unit,
            pdu,
        };
        let own = waiting.framing.frame(self.transaction, unit, pdu);
        let last = sent + self.endpoint.timeout;
        let idle = BATCH + self.endpoint.time_of(12);
        let mut junk = Vec::new();
        let mut got = Vec::new();
        let mut until = last;
        loop {
            if self
                .read_until(until, &mut got)
                .await
                .map_err(Lost::Broken)?
                > 0
            {
                self.drop_echo(&own, pdu, &mut got);
                // A busy computer hands on an answer in pieces, with a pause between them.
                let all = [junk.as_slice(), &got].concat();
                for bytes in [&got, &all] {
                    if let Some((answer, range)) = waiting.find(bytes) {
                        self.received(bytes.get(range).unwrap_or_default());
                        return Ok(answer);
                    }
                }
                until = Instant::now() + idle;
                continue;
            }
            // A silence: nothing more belongs to what came before it.
            if let Some(answer) = waiting.whole(&got) {
                self.received(&got);
                return Ok(answer);
            }
            junk.append(&mut got);
            if Instant::now() >= last {
                break;
            }
            until = last;
        }
        self.owed = Some((unit, pdu.to_vec()));
        if junk.is_empty() {
            return Err(Lost::Silent);
        }
        self.received(&junk);
        Err(Lost::Garbled(junk))
    }

    /// Takes the request out of what arrived, where the adapter returns it. That it does is seen at a function whose
    /// response is not the request.
    fn drop_echo(&mut self, own: &[u8], pdu: &[u8], got: &mut Vec<u8>) {
        let differs = !matches!(pdu.first(), Some(0x05 | 0x06 | 0x08 | 0x16));
        if (self.echo || differs) && got.starts_with(own) && self.endpoint.framing != Framing::Mbap
        {
            self.echo = true;
            got.drain(..own.len());
        }
    }

    /// Passes a frame, or bytes that came in place of one, to the observer.
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
