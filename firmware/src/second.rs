//! The second line: what is at its UART, a LoRa radio or an RS-232 socket, and the port that serves Modbus RTU over it.
//!
//! A radio is a serial port over the air with its own timing. It outputs a frame in packets of up to 58 bytes with
//! pauses between them. So a frame ends when its length and its CRC fit, instead of after t3.5, and pauses inside a
//! frame do not count. LORA_FRAME_GAP ends a frame that never becomes complete, and a shorter silence one that cannot:
//! traffic that a unit has joined in the middle becomes too long for a frame soon. On RS-232 t3.5 ends every frame: a pause
//! below it does not, and frames that are t3.5 apart are two.
//!
//! On both the bytes take a millisecond each, so a task that runs once a millisecond moves them.
//!
//! A silence is measured from the call that found the last byte. While flash is erased the task does not run for up to
//! 40 ms, on clones of the part 400. A silence that begins in that time counts as up to as much shorter, and one that ends in
//! it is not seen.

use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal_nb::serial::{Read, Write};
use modbus_server::{
    Adu, LineCounters, Reply, Request,
    line::{Faults, Gaps, Port, Receiver, Units},
};
use modio_drivers::Lora;
use ports::line_settings::LineSettings;

use crate::config::RadioConfig;

mod peer;
#[cfg(test)]
mod tests;

pub use peer::{Peer, Rs232};

/// Times of a second line, in milliseconds.
#[derive(Clone, Copy, Debug)]
struct Times {
    /// Silence that ends a frame that is not complete.
    frame_gap_ms: u16,
    /// Time after which the end of a reply has been sent, since the last byte was passed to the UART: of RS-232; or since
    /// the radio began to send the last packet.
    end_ms: u16,
}

impl Times {
    /// The times of RS-232. The UART has the last two characters of a reply when the queue is empty.
    const RS232: Self = Self {
        frame_gap_ms: GAPS.t35.div_ceil(1_000_000) as u16,
        end_ms: (2 * BITS * 1_000).div_ceil(LINE.baud) as u16,
    };
}

/// Rate and format of RS-232, bits of a character there, and its silences.
const LINE: LineSettings = LineSettings::SECOND;
const BITS: u32 = LINE.format.bits();
const GAPS: Gaps = Gaps::standard(LINE.baud, BITS as u8);

/// Silence on RS-232 that ends a frame whose length and CRC fit, in milliseconds. When the next frame begins after t3.5,
/// at least so many calls find no byte in between. The reply begins with the next call, which is after t3.5.
const COMPLETE_GAP_MS: u16 = 3;

/// Silence on RS-232 that counts as longer than t1.5, in milliseconds. That is 1.6 ms, but the next byte takes another
/// 1.04 ms, and is found up to a millisecond late.
const T15_MS: u16 = 3;

/// The second line.
pub struct SecondLine<P, N> {
    peer: P,
    port: Port<'static, N>,
    times: Times,
    /// Time since the last byte, in milliseconds, until it has reached the frame gap.
    silence: Option<u16>,
    /// A complete frame of another unit has just ended. A byte 0 that follows immediately is the last one of its CRC.
    may_end_in_0: bool,
    /// A byte of the reply that the UART could not take yet.
    unsent: Option<u8>,
    /// What is left of [`Times::end_ms`], in milliseconds.
    ending_ms: u16,
    works: Option<bool>,
}

/// Largest number of bytes that are received in one call: more than the UART can receive while flash is erased.
const BYTES_PER_CALL: u8 = 64;

/// Longest time between two bytes of a packet as this code measures it, in milliseconds: the module outputs a byte in
/// 1.04 ms.
const BYTE_MS: u16 = 3;

/// Silence that ends a frame that can never become valid, in milliseconds. Other units answer sooner than after the
/// frame gap. Without this limit a unit that has missed a part of their traffic would find no silence that is long
/// enough, and receive nothing more.
const LOST_GAP_MS: u16 = 20;

impl<S, M, A, N: Units> SecondLine<Lora<S, M, A>, N>
where
    S: Read<u8> + Write<u8>,
    M: OutputPin,
    A: InputPin + OutputPin,
{
    /// Creates the radio line of a unit, 1 to 247. M0 and M1 are high, AUX is pulled up. After a `power_on` the module has
    /// just been started too; after another reset it may be sending a reply.
    // Not inlined into init, whose frame is too large for short instructions.
    #[inline(never)]
    pub fn radio(
        serial: S,
        mode: [M; 2],
        aux: A,
        RadioConfig {
            module,
            frame_gap_ms,
        }: RadioConfig,
        units: N,
        power_on: bool,
        adus: &'static mut [Adu],
    ) -> Self {
        let end_ms = module.packet_ms();
        let times = Times {
            frame_gap_ms,
            end_ms,
        };
        let sending = if power_on { 0 } else { end_ms };
        let peer = Lora::new(serial, mode, aux, module, sending);
        Self::new(peer, times, units, adus)
    }
}

impl<S: Read<u8> + Write<u8>, N: Units> SecondLine<Rs232<S>, N> {
    /// Creates the RS-232 line of a unit.
    // Not inlined into init, as above.
    #[inline(never)]
    pub fn rs232(serial: S, units: N, adus: &'static mut [Adu]) -> Self {
        Self::new(Rs232(serial), Times::RS232, units, adus)
    }
}

impl<P: Peer, N: Units> SecondLine<P, N> {
    #[inline(always)]
    fn new(peer: P, times: Times, units: N, adus: &'static mut [Adu]) -> Self {
        Self {
            peer,
            port: Port::new(Receiver::rtu(units, false), adus),
            times,
            silence: Some(0),
            may_end_in_0: false,
            unsent: None,
            ending_ms: 0,
            works: None,
        }
    }

    /// Sets the unit addresses, which have changed.
    pub fn set_units(&mut self, units: N) {
        self.port.set_units(units);
    }

    /// Continues everything that is under way, at `now_ms` milliseconds after the start and `passed` milliseconds
    /// after the last call. Returns whether a request waits to be served, or a reply has just ended: the peer has it,
    /// or it has been sent.
    pub fn poll(&mut self, now_ms: u32, passed: u16) -> bool {
        self.peer.poll(passed);
        if !self.peer.is_ready() {
            if P::IS_RADIO && self.peer.has_failed() {
                self.works = Some(false);
            }
            return self.abort();
        }
        if P::IS_RADIO {
            self.works = Some(true);
        }
        let waits = if self.port.is_sending() {
            self.discard();
            false
        } else {
            self.receive(now_ms, passed)
        };
        let was_ending = self.ending_ms > 0;
        self.ending_ms = self.ending_ms.saturating_sub(passed);
        let has_sent = was_ending && self.ending_ms == 0;
        self.send() || waits || has_sent
    }

    /// Returns whether the radio works. `None` until the first attempt to set it up has ended, and of RS-232.
    #[must_use]
    pub const fn works(&self) -> Option<bool> {
        self.works
    }

    /// Ends a reply that can no longer be sent. Returns whether there was one.
    fn abort(&mut self) -> bool {
        self.unsent = None;
        self.ending_ms = 0;
        let replying = self.port.is_sending() || self.port.start().is_some();
        if replying {
            self.end_of_reply();
        }
        replying
    }

    fn end_of_reply(&mut self) {
        self.port.sent();
        self.silence = None;
    }

    /// Discards what is received during a reply: no master sends a request then, and the air is half duplex.
    fn discard(&mut self) {
        let _ = (0..BYTES_PER_CALL).any(|_| self.peer.read().is_err());
    }

    /// Receives bytes up to the end of a frame. Returns whether a request waits to be served.
    fn receive(&mut self, now_ms: u32, passed: u16) -> bool {
        let (mut received, mut complete) = (false, false);
        for _ in 0..BYTES_PER_CALL {
            let (byte, faults) = match self.peer.read() {
                Ok(0) if self.may_end_in_0 => continue,
                Ok(byte) => (byte, Faults::NONE),
                Err(nb::Error::Other(_)) => (0, Faults::FRAMING),
                Err(nb::Error::WouldBlock) => break,
            };
            self.port.received(byte, faults);
            self.may_end_in_0 = false;
            received = true;
            complete = P::IS_RADIO && self.port.is_complete();
            if complete {
                break;
            }
        }
        let silence = match self.silence {
            _ if received => 0,
            Some(silence) => silence.saturating_add(passed),
            None => return false,
        };
        if silence > BYTE_MS {
            self.may_end_in_0 = false;
        }
        self.silence = Some(silence);
        if !complete {
            let gap = self.times.frame_gap_ms;
            let gap = if self.port.is_lost() {
                LOST_GAP_MS.min(gap)
            } else if !P::IS_RADIO && self.port.is_complete() {
                COMPLETE_GAP_MS
            } else {
                gap
            };
            if silence < gap {
                if !P::IS_RADIO && silence >= T15_MS {
                    // It ends no request in RTU mode.
                    self.port.short_silence(now_ms);
                }
                return false;
            }
            self.silence = None;
        }
        let is_request = self.port.long_silence(now_ms.wrapping_sub(silence.into()));
        self.may_end_in_0 = complete && !is_request;
        is_request
    }

    /// Sends as much of the reply as the UART takes. The reply begins when the peer is free, and ends when the UART has
    /// all of it and a radio has begun to send its last packet: AUX is high from then on (manual of the E32-433T20D, 6.2).
    /// Returns whether it has just ended.
    fn send(&mut self) -> bool {
        if !self.port.is_sending() {
            if !self.port.is_replying() || !self.peer.is_free() {
                return false;
            }
            self.unsent = self.port.start();
        }
        while self.port.is_sending() {
            let byte = match self.unsent.take() {
                Some(byte) => byte,
                None => match self.port.next_byte() {
                    Some(byte) => byte,
                    None => {
                        let ended = self.peer.flush().is_ok() && self.peer.is_free();
                        if ended {
                            self.ending_ms = self.times.end_ms;
                            self.end_of_reply();
                        }
                        return ended;
                    }
                },
            };
            if self.peer.write(byte).is_err() {
                self.unsent = Some(byte);
                return false;
            }
        }
        false
    }

    /// Returns whether the end of the last reply may still be on its way, so that a restart would lose it. The next
    /// request shows that the master has received it.
    #[must_use]
    pub fn is_ending(&self) -> bool {
        self.ending_ms > 0 && self.port.waiting().is_none()
    }

    /// Returns whether a reply is being sent or waits to be sent.
    #[must_use]
    pub fn is_replying(&self) -> bool {
        self.port.is_replying()
    }

    /// Takes the waiting request, if any.
    pub fn take(&mut self) -> Option<Request<'static>> {
        self.port.take()
    }

    /// Sends a reply, if there is one, as soon as the peer is free.
    pub fn send_reply(&mut self, reply: Reply<'static>) {
        self.port.send(reply, 0);
    }

    /// Returns the counters of the line.
    pub fn counters(&self) -> LineCounters {
        *self.port.counters()
    }
}
