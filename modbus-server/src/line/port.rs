//! A line as its server has it: characters and silences in, requests out; replies in, characters out.

use super::{Closed, Faults, Framing, Next, Receiver, Transmitter, Units};
use crate::head::Head;
use crate::{Adu, LineCounters};

/// One serial line of a server, without UART, timer or clock.
///
/// The caller drives the hardware and calls these methods:
///
/// | what happens | call | then |
/// |---|---|---|
/// | a character has come | [`received`](Self::received) | measure the silence from its end |
/// | the short silence | [`short_silence`](Self::short_silence) | when `true`, serve |
/// | the long silence | [`long_silence`](Self::long_silence) | when `true`, serve |
/// | a tick of the caller's clock | [`tick`](Self::tick) | [`start`](Self::start) |
/// | the UART can take a character | [`next`](Self::next) | send it, wait, or wait for the last stop bit |
/// | the last stop bit has left | [`sent`](Self::sent) | driver off, receiver on |
///
/// The short and the long silence are t1.5 and t3.5 in RTU mode ([`Gaps`](super::Gaps)), and t3.5 and
/// [`Gaps::ASCII_TIMEOUT`](super::Gaps::ASCII_TIMEOUT) in ASCII mode. None is measured while the unit sends.
///
/// To serve is [`Server::take`](crate::Server::take) and the steps after it. Once the reply may start,
/// [`start`](Self::start) gives its first character: driver on, receiver off.
///
/// A tick is any unit of time, the same for the delay of a reply and for the end of a request; it never has to be fine,
/// for silences are the caller's to measure.
#[derive(Debug)]
pub struct Port<'a, U = u8> {
    receiver: Receiver<'a, U>,
    transmitter: Transmitter<'a>,
    request: Option<Closed<'a>>,
    /// The tick in which the request ended.
    ended: u32,
    reply: Reply,
    /// The good frames on the bus when a reply began to be delayed.
    heard_before: u16,
}

/// How far the reply is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reply {
    /// There is none.
    None,
    /// It waits for ticks to pass, and is given up if the bus goes on without it.
    Delayed(u16),
    /// It may start.
    Ready,
    /// It is being sent.
    Sending,
}

impl<'a, U: Units> Port<'a, U> {
    /// A port that receives into these buffers.
    pub fn new(mut receiver: Receiver<'a, U>, adus: &'a mut [Adu; 2]) -> Self {
        adus.iter_mut().for_each(|adu| receiver.give_back(adu));
        Self {
            receiver,
            transmitter: Transmitter::idle(),
            request: None,
            ended: 0,
            reply: Reply::None,
            heard_before: 0,
        }
    }

    /// A character has come, with what was wrong with it.
    #[inline]
    pub fn received(&mut self, byte: u8, faults: Faults) {
        self.receiver.character(byte, faults);
    }

    /// The short silence has passed, in tick `now`. Whether a request waits to be served: only on an ASCII line, whose
    /// frame was over, and whose sender has left the line by now.
    #[inline]
    pub fn short_silence(&mut self, now: u32) -> bool {
        self.receiver.pause();
        self.receiver.is_over() && self.close(now)
    }

    /// The long silence has passed, in tick `now`: a frame of an RTU line is over, one of an ASCII line is spoilt.
    /// Whether a request waits to be served.
    #[inline]
    pub fn long_silence(&mut self, now: u32) -> bool {
        // A frame that was over long ago has found no silence for its reply: it is too late.
        let late = self.receiver.is_over();
        if !self.close(now) {
            return false;
        }
        if late && let Some(closed) = self.request.take() {
            self.receiver.drop_request(closed.adu);
            return false;
        }
        true
    }

    fn close(&mut self, now: u32) -> bool {
        let Some(closed) = self.receiver.close() else {
            return false;
        };
        self.ended = now;
        // One that has not been taken by now will never be answered in time.
        if let Some(late) = self.request.replace(closed) {
            self.receiver.drop_request(late.adu);
        }
        true
    }

    /// A tick has passed: a reply that is delayed by so many may [`start`](Self::start), unless the bus has gone on
    /// without it.
    pub fn tick(&mut self) {
        match self.reply {
            Reply::Delayed(0) => {
                if self.receiver.is_idle() && self.heard() == self.heard_before {
                    self.reply = Reply::Ready;
                } else {
                    self.give_up();
                }
            }
            Reply::Delayed(ticks) => self.reply = Reply::Delayed(ticks - 1),
            Reply::None | Reply::Ready | Reply::Sending => {}
        }
    }

    /// The first character of a reply that starts now, if one may.
    #[inline]
    pub fn start(&mut self) -> Option<u8> {
        if self.reply != Reply::Ready {
            return None;
        }
        self.reply = Reply::Sending;
        match self.transmitter.next() {
            Next::Byte(byte) => Some(byte),
            Next::Wait | Next::Done => None,
        }
    }

    /// What to send next. After [`Next::Wait`] it is asked again when the reply has been
    /// [answered](crate::Decided::answer) or [finished](crate::Served::finish); after [`Next::Done`] the caller waits
    /// for the last stop bit.
    #[inline(always)]
    #[expect(
        clippy::should_implement_trait,
        reason = "not an iterator: it may have to wait"
    )]
    pub fn next(&mut self) -> Next {
        self.transmitter.next()
    }

    /// The last stop bit of a reply has left the unit, or its line was set up again: there is no reply any more, and
    /// the next character starts a frame.
    #[inline]
    pub fn sent(&mut self) {
        if self.reply == Reply::Sending {
            self.give_up();
        }
        self.receiver.resume();
    }

    /// Whether a reply is being sent.
    #[inline]
    #[must_use]
    pub fn is_sending(&self) -> bool {
        self.reply == Reply::Sending
    }

    /// Whether a reply is on its way, or will be. A delayed one that a request has overtaken will not.
    #[must_use]
    pub fn is_replying(&self) -> bool {
        match self.reply {
            Reply::None => false,
            Reply::Delayed(_) => self.request.is_none(),
            Reply::Ready | Reply::Sending => true,
        }
    }

    /// Whether no frame has begun, so that no silence has to be waited for.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.receiver.is_idle()
    }

    /// The unit address of the request that waits to be served, if any; 0 for a broadcast.
    #[must_use]
    pub fn waiting(&self) -> Option<u8> {
        self.request.as_ref().map(|closed| closed.adu.get(0))
    }

    /// What the line has counted so far.
    #[must_use]
    pub const fn counters(&self) -> &LineCounters {
        self.receiver.counters()
    }

    /// The request that waits, if any, and the tick in which it ended. A reply that has not begun yet is given up: the
    /// master has.
    pub(crate) fn take_request(&mut self) -> Option<(Closed<'a>, u32)> {
        let closed = self.request.take()?;
        if matches!(self.reply, Reply::Delayed(_)) {
            self.give_up();
        }
        Some((closed, self.ended))
    }

    /// A reply of `unit` will come: its first character may leave now, or after some ticks.
    #[inline]
    pub(crate) fn open(&mut self, unit: u8, framing: Framing, delay: u16) {
        self.transmitter = Transmitter::open(unit, framing);
        self.reply = if delay == 0 {
            Reply::Ready
        } else {
            self.heard_before = self.heard();
            Reply::Delayed(delay)
        };
    }

    /// This is how the reply begins.
    #[inline]
    pub(crate) const fn set_head(&mut self, head: Head) {
        self.transmitter.head(head);
    }

    /// The request's buffer comes back: the body of the reply that was begun, if it has one. The next frame ends as
    /// `framing` says.
    #[inline]
    pub(crate) fn finish(&mut self, adu: &'a mut Adu, replying: bool, framing: Framing) {
        self.receiver.set_framing(framing);
        // A reply that has been cut off by now takes no body.
        let unneeded = if replying && self.reply != Reply::None {
            self.transmitter.body(adu)
        } else {
            Some(adu)
        };
        if let Some(adu) = unneeded {
            self.receiver.give_back(adu);
        }
    }

    /// Good frames on the bus so far.
    fn heard(&self) -> u16 {
        self.receiver.counters().bus_messages
    }

    #[inline(always)]
    fn give_up(&mut self) {
        self.reply = Reply::None;
        if let Some(adu) = self.transmitter.take_buffer() {
            self.receiver.give_back(adu);
        }
    }
}
