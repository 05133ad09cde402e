//! A line as its server uses it: takes characters and silences, returns requests; takes replies, returns
//! characters.

use super::{Arbitration, Ending, Faults, Framing, Receiver, Step, Transmitter, Units};
use crate::{Adu, LineCounters, Reply, Request};

/// One serial line of a server, without UART, timer or clock.
///
/// The caller drives the hardware and calls these methods:
///
/// | event | call | then |
/// |---|---|---|
/// | a character was received | [`received`](Self::received) | measure the silence from its end |
/// | the short silence has passed | [`short_silence`](Self::short_silence) | when `true`, serve |
/// | the long silence has passed | [`long_silence`](Self::long_silence) | when `true`, serve |
/// | a tick of the caller's clock | [`tick`](Self::tick) | [`start`](Self::start) |
/// | the UART can take a character | [`next_byte`](Self::next_byte) | send it, or wait for the last stop bit |
/// | the last stop bit was sent | [`sent`](Self::sent) | driver off, receiver on |
///
/// The short and the long silence are t1.5 and t3.5 in RTU mode ([`Gaps`](super::Gaps)), and t3.5 and
/// [`Gaps::ASCII_TIMEOUT`](super::Gaps::ASCII_TIMEOUT) in ASCII mode. Do not measure silences while the unit sends.
///
/// To serve is to [`take`](Self::take) the request, let a [`Server`](crate::Server) serve it, and [`send`](Self::send)
/// the reply. Once the reply may start, [`start`](Self::start) returns its first character: turn the driver on and the
/// receiver off.
///
/// A tick can be any unit of time, the same for the delay of a reply and for the end of a request. It need not be
/// short, because the caller measures the silences.
#[derive(Debug)]
pub struct Port<'a, U = u8> {
    receiver: Receiver<'a, U>,
    transmitter: Transmitter<'a>,
    /// Unit address and PDU of the request that waits, and the tick in which it ended.
    request: Option<(&'a mut Adu, u32)>,
    reply: State,
    /// Number of valid frames on the bus when the last request ended.
    messages_before: u16,
    /// A reply that is sent if its arbitration is won.
    contender: Option<(&'a mut Adu, Arbitration)>,
    /// How the last arbitration has ended.
    ending: Ending,
}

/// What a port wants at the [deadline](Port::deadline) of an arbitration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Nothing.
    None,
    /// Send this character alone.
    Bit(u8),
    /// Send this first character of the reply.
    Reply(u8),
}

/// State of the reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is no reply.
    None,
    /// The reply may start after this many ticks, unless it is too late by then.
    Waiting(u32),
    /// The reply is being sent.
    Sending,
}

impl<'a, U: Units> Port<'a, U> {
    /// Creates a port that receives into these buffers: one to receive into, and one for the request that is being
    /// served and its reply. A port uses no more than two. With one buffer, a request that begins before the last
    /// reply has ended is lost, and counts as dropped.
    #[inline(always)]
    pub fn new(mut receiver: Receiver<'a, U>, adus: &'a mut [Adu]) -> Self {
        adus.iter_mut().for_each(|adu| receiver.give_back(adu));
        Self {
            receiver,
            transmitter: Transmitter::idle(),
            request: None,
            reply: State::None,
            messages_before: 0,
            contender: None,
            ending: Ending::None,
        }
    }

    /// Sets the unit addresses, which have changed, for the requests that end from now on.
    pub fn set_units(&mut self, units: U) {
        self.receiver.set_units(units);
    }

    /// Processes a received character and its faults. Returns whether [`ends_fast_message`](Self::ends_fast_message)
    /// must be called: only on a line with a [`FastUnit`](super::FastUnit).
    #[inline(always)]
    pub fn received(&mut self, byte: u8, faults: Faults) -> bool {
        self.receiver.character(byte, faults)
    }

    /// Ends the frame if it is a whole message of [Fast Modbus](crate::fast), in tick `now`, which ends without a silence.
    /// Returns whether a request waits to be served.
    pub fn ends_fast_message(&mut self, now: u32) -> bool {
        self.receiver.is_fast_message() && self.close(now)
    }

    /// Returns whether the RTU frame so far has a valid CRC and the length that its function requires: of a request,
    /// or, for a frame of another unit, of a request or a reply. On a line with pauses inside frames, like a radio, the
    /// caller may then end the frame with [`long_silence`](Self::long_silence) without waiting.
    ///
    /// Always `false` for function 08 with more than one data word, for a function of unknown length, for a damaged
    /// frame, while there is no buffer for the frame, and in ASCII mode.
    ///
    /// The beginning of a longer frame can be complete by chance, with a probability of 1 in 65,536. All but the last
    /// byte of a frame of another unit can be complete if that byte is 0, because a CRC that ends in 0 is valid without
    /// it. So a byte 0 that follows immediately belongs to the frame.
    #[inline(always)]
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.receiver.is_complete()
    }

    /// Returns whether the frame so far can never become valid: it is damaged or too long, or its beginning was missed.
    /// On a line with pauses inside frames, the caller may end it at any pause, to find the beginning of the next one.
    #[inline(always)]
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        self.receiver.is_lost()
    }

    /// Ends the short silence, in tick `now`. Returns whether a request waits to be served. That is only possible
    /// on an ASCII line: its frame was complete, and its sender has released the line by now.
    #[inline]
    pub fn short_silence(&mut self, now: u32) -> bool {
        self.receiver.pause();
        self.receiver.is_over() && self.close(now)
    }

    /// Ends the long silence, in tick `now`: a frame of an RTU line is complete, an unfinished frame of an ASCII
    /// line is damaged. Returns whether a request waits to be served.
    #[inline]
    pub fn long_silence(&mut self, now: u32) -> bool {
        // An ASCII frame that was complete before this silence was not served at the short silence, so a reply
        // would be too late.
        if self.receiver.is_over() {
            if let Some(adu) = self.receiver.close() {
                self.receiver.drop_request(adu);
            }
            return false;
        }
        self.close(now)
    }

    fn close(&mut self, ended: u32) -> bool {
        let Some(adu) = self.receiver.close() else {
            return false;
        };
        self.messages_before = self.receiver.counters().bus_messages;
        // A request that has not been taken yet cannot be answered in time any more.
        if let Some((late, _)) = self.request.replace((adu, ended)) {
            self.receiver.drop_request(late);
        }
        true
    }

    /// Takes the waiting request, if any, to be served; [`send`](Self::send) its reply before the next is taken. A reply
    /// that has not begun yet is not sent any more, because the master no longer expects it.
    #[inline]
    pub fn take(&mut self) -> Option<Request<'a>> {
        let (adu, ended) = self.request.take()?;
        if matches!(self.reply, State::Waiting(_)) {
            self.drop_reply();
        }
        if U::FAST && self.contender.is_some() {
            self.withdraw();
        }
        Some(Request {
            adu,
            line: *self.receiver.counters(),
            ended,
            ending: self.ending,
        })
    }

    /// Takes the reply to the last request, if it has one, and the request's buffer back. The reply may
    /// [`start`](Self::start) now, or after `delay` ticks.
    pub fn send(&mut self, reply: Reply<'a>, delay: u16) {
        let framing = self.receiver.framing();
        self.receiver.set_framing(reply.framing);
        if !reply.is_answered {
            return self.receiver.give_back(reply.adu);
        }
        match self.reply {
            State::None => {}
            State::Waiting(_) => self.drop_reply(),
            State::Sending => {
                self.receiver.count_unsent();
                return self.receiver.give_back(reply.adu);
            }
        }
        self.transmitter = Transmitter::new(reply.adu, framing);
        // The request ended within a tick, so the first tick does not count.
        self.reply = State::Waiting(if delay == 0 { 0 } else { 1 + u32::from(delay) });
    }

    /// Takes a reply that is sent if its arbitration is won. Call [`fell`](Self::fell) when the line falls, at the latest in
    /// front of the next turn, and [`turn`](Self::turn) at each [`deadline`](Self::deadline). A frame that has come since
    /// the request ends the arbitration.
    pub fn arbitrate(&mut self, reply: Reply<'a>, arbitration: Arbitration) {
        self.ending = Ending::None;
        let is_late = self.request.is_some() || !self.receiver.is_idle();
        if !reply.is_answered || is_late || self.reply == State::Sending {
            return self.receiver.give_back(reply.adu);
        }
        self.contender = Some((reply.adu, arbitration));
    }

    /// Returns the time at which [`turn`](Self::turn) must be called, while the unit arbitrates.
    #[must_use]
    pub fn deadline(&self) -> Option<u32> {
        self.contender
            .as_ref()
            .map(|(_, arbitration)| arbitration.deadline())
    }

    /// Notes the last time at which the line fell, while the unit arbitrates.
    pub const fn fell(&mut self, at: u32) {
        if let Some((_, arbitration)) = &mut self.contender {
            arbitration.fell(at);
        }
    }

    /// Takes the unit's turn in its arbitration.
    pub fn turn(&mut self) -> Turn {
        let Some((_, arbitration)) = &mut self.contender else {
            return Turn::None;
        };
        match arbitration.step() {
            Step::Wait => Turn::None,
            Step::Send => Turn::Bit(Arbitration::ZERO),
            Step::Lost => {
                self.ending = Ending::Lost(arbitration.left());
                self.withdraw();
                Turn::None
            }
            Step::Won => self.reply_to_all().map_or(Turn::None, Turn::Reply),
        }
    }

    /// Starts the reply of the unit that has won, and returns its first character.
    fn reply_to_all(&mut self) -> Option<u8> {
        let (adu, _) = self.contender.take()?;
        self.transmitter = Transmitter::new(adu, Framing::Rtu);
        self.reply = State::Sending;
        self.ending = Ending::Won;
        self.receiver.end_following();
        self.transmitter.next()
    }

    /// Ends an arbitration without a reply.
    pub fn withdraw(&mut self) {
        if let Some((adu, _)) = self.contender.take() {
            self.receiver.give_back(adu);
        }
    }

    /// Returns whether the unit arbitrates.
    #[inline]
    #[must_use]
    pub const fn is_arbitrating(&self) -> bool {
        self.contender.is_some()
    }

    /// Advances the time by a tick. Returns whether the delay of a reply has passed, so that it may
    /// [`start`](Self::start).
    #[inline(always)]
    pub const fn tick(&mut self) -> bool {
        let State::Waiting(ticks) = &mut self.reply else {
            return false;
        };
        *ticks = ticks.saturating_sub(1);
        *ticks == 0
    }

    /// Starts a reply whose delay has passed, if there is one, and returns its first character. When another frame is
    /// being received, or a valid one has come since the request, the reply is dropped and counted instead.
    pub fn start(&mut self) -> Option<u8> {
        if self.reply != State::Waiting(0) {
            return None;
        }
        let messages = self.receiver.counters().bus_messages;
        let is_late = self.request.is_some() || messages != self.messages_before;
        if is_late || !self.receiver.is_idle() {
            self.drop_reply();
            return None;
        }
        let first = self.transmitter.next()?;
        self.reply = State::Sending;
        Some(first)
    }

    /// Returns the next character to send. After `None`, wait for the last stop bit.
    #[inline(always)]
    pub fn next_byte(&mut self) -> Option<u8> {
        self.transmitter.next()
    }

    /// Ends the reply: its last stop bit was sent, or the line was set up again. The next character starts a frame.
    #[inline]
    pub fn sent(&mut self) {
        if self.reply == State::Sending {
            self.give_up();
        }
        self.receiver.resume();
    }

    /// Returns whether a reply is being sent.
    #[inline]
    #[must_use]
    pub fn is_sending(&self) -> bool {
        self.reply == State::Sending
    }

    /// Returns whether a reply is being sent or will be sent. A reply that waits is not sent when a new request has been
    /// received.
    #[must_use]
    pub fn is_replying(&self) -> bool {
        match self.reply {
            State::None => U::FAST && self.is_arbitrating(),
            State::Waiting(_) => self.request.is_none(),
            State::Sending => true,
        }
    }

    /// Returns whether no frame has begun, so that no silence needs to be measured.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.receiver.is_idle()
    }

    /// Returns the unit address of the request that waits to be served, if any; 0 for a broadcast.
    #[must_use]
    pub fn waiting(&self) -> Option<u8> {
        self.request.as_ref().map(|(adu, _)| adu.get(0))
    }

    /// Returns the counters of the line.
    #[must_use]
    pub const fn counters(&self) -> &LineCounters {
        self.receiver.counters()
    }

    /// Ends a reply that is not sent.
    #[cold]
    #[inline(never)]
    fn drop_reply(&mut self) {
        self.receiver.count_unsent();
        self.give_up();
    }

    #[inline(always)]
    fn give_up(&mut self) {
        self.reply = State::None;
        if let Some(adu) = self.transmitter.take_buffer() {
            self.receiver.give_back(adu);
        }
    }
}
