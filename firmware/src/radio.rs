//! The radio line: the LoRa radio and the port that serves Modbus RTU over it.
//!
//! The radio is a serial port over the air with its own timing. It outputs a frame in packets of up to 58 bytes with
//! pauses between them. So a frame ends when its length and its CRC fit, instead of after t3.5, and pauses inside a
//! frame do not count. LORA_FRAME_GAP ends a frame that never becomes complete, and a shorter silence one that cannot:
//! traffic that a unit has joined in the middle becomes too long for a frame soon. The bytes of the radio take a
//! millisecond each, so a task that runs once a millisecond moves them.
//!
//! A silence is measured from the call that found the last byte. While flash is erased the task does not run for up to
//! 40 ms. A silence that begins in that time counts as up to 40 ms shorter, and one that ends in it is not seen.

use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal_nb::serial::{Read, Write};
use modbus_server::{
    Adu, LineCounters, Reply, Request,
    line::{Faults, Port, Receiver},
};
use modio_drivers::Lora;

use crate::config::RadioConfig;
use crate::line::Units;

/// The radio line.
pub struct RadioLine<S, M, A> {
    radio: Lora<S, M, A>,
    port: Port<'static, Units>,
    /// Silence that ends a frame that is not complete, in milliseconds.
    frame_gap_ms: u16,
    /// Time since the last byte, in milliseconds, until it has reached the frame gap.
    silence: Option<u16>,
    /// A complete frame of another unit has just ended. A byte 0 that follows immediately is the last one of its CRC.
    may_end_in_0: bool,
    /// A byte of the reply that the UART could not take yet.
    unsent: Option<u8>,
    /// Longest time of a packet on the air, and what is left of it since the radio began to send the last packet of a
    /// reply, in milliseconds.
    packet_ms: u16,
    on_air_ms: u16,
    works: Option<bool>,
}

/// Largest number of bytes that are received in one call: more than a UART can receive while flash is erased.
const BYTES_PER_CALL: u8 = 64;

/// Longest time between two bytes of a packet as this code measures it, in milliseconds: the module outputs a byte in
/// 1.04 ms.
const BYTE_MS: u16 = 3;

/// Silence that ends a frame that can never become valid, in milliseconds. Other units answer sooner than after the
/// frame gap. Without this limit a unit that has missed a part of their traffic would find no silence that is long
/// enough, and receive nothing more.
const LOST_GAP_MS: u16 = 20;

impl<S, M, A> RadioLine<S, M, A>
where
    S: Read<u8> + Write<u8>,
    M: OutputPin,
    A: InputPin + OutputPin,
{
    /// Creates the line of a unit, 1 to 247. M0 and M1 are high, AUX is pulled up. After a `power_on` the module has
    /// just been started too; after another reset it may be sending a reply.
    // Not inlined into init, whose frame is too large for short instructions.
    #[inline(never)]
    pub fn new(
        serial: S,
        mode: [M; 2],
        aux: A,
        RadioConfig {
            module,
            frame_gap_ms,
        }: RadioConfig,
        units: Units,
        power_on: bool,
        adus: &'static mut [Adu],
    ) -> Self {
        let packet_ms = module.packet_ms();
        let sending = if power_on { 0 } else { packet_ms };
        Self {
            radio: Lora::new(serial, mode, aux, module, sending),
            port: Port::new(Receiver::rtu(units, false), adus),
            frame_gap_ms,
            silence: Some(0),
            may_end_in_0: false,
            unsent: None,
            packet_ms,
            on_air_ms: 0,
            works: None,
        }
    }

    /// Continues everything that is under way, at `now_ms` milliseconds after the start and `passed` milliseconds
    /// after the last call. Returns whether a request waits to be served, or a reply has just ended: the module has it,
    /// or it has been sent.
    pub fn poll(&mut self, now_ms: u32, passed: u16) -> bool {
        self.radio.poll(passed);
        if !self.radio.is_ready() {
            if self.radio.has_failed() {
                self.works = Some(false);
            }
            return self.abort();
        }
        self.works = Some(true);
        let waits = if self.port.is_sending() {
            self.discard();
            false
        } else {
            self.receive(now_ms, passed)
        };
        let was_on_air = self.on_air_ms > 0;
        self.on_air_ms = self.on_air_ms.saturating_sub(passed);
        let has_sent = was_on_air && self.on_air_ms == 0;
        self.send() || waits || has_sent
    }

    /// Returns whether the radio works. `None` until the first attempt to set it up has ended.
    #[must_use]
    pub const fn works(&self) -> Option<bool> {
        self.works
    }

    /// Ends a reply that can no longer be sent. Returns whether there was one.
    fn abort(&mut self) -> bool {
        self.unsent = None;
        self.on_air_ms = 0;
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

    /// Discards what is received during a reply: the air is half duplex, so it is no request for this unit.
    fn discard(&mut self) {
        let _ = (0..BYTES_PER_CALL).any(|_| self.radio.read().is_err());
    }

    /// Receives bytes up to the end of a frame. Returns whether a request waits to be served.
    fn receive(&mut self, now_ms: u32, passed: u16) -> bool {
        let (mut received, mut complete) = (false, false);
        for _ in 0..BYTES_PER_CALL {
            let (byte, faults) = match self.radio.read() {
                Ok(0) if self.may_end_in_0 => continue,
                Ok(byte) => (byte, Faults::NONE),
                Err(nb::Error::Other(_)) => (0, Faults::FRAMING),
                Err(nb::Error::WouldBlock) => break,
            };
            self.port.received(byte, faults);
            self.may_end_in_0 = false;
            received = true;
            complete = self.port.is_complete();
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
            let gap = if self.port.is_lost() {
                LOST_GAP_MS.min(self.frame_gap_ms)
            } else {
                self.frame_gap_ms
            };
            if silence < gap {
                return false;
            }
            self.silence = None;
        }
        let is_request = self.port.long_silence(now_ms.wrapping_sub(silence.into()));
        self.may_end_in_0 = complete && !is_request;
        is_request
    }

    /// Sends as much of the reply as the UART takes. The reply begins when the radio is free, and ends when the radio
    /// has begun to send its last packet: AUX is high from then on (manual of the E32-433T20D, 6.2). Returns whether it
    /// has just ended.
    fn send(&mut self) -> bool {
        if !self.port.is_sending() {
            if !self.port.is_replying() || !self.radio.is_free() {
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
                        let ended = self.radio.flush().is_ok() && self.radio.is_free();
                        if ended {
                            self.on_air_ms = self.packet_ms;
                            self.end_of_reply();
                        }
                        return ended;
                    }
                },
            };
            if self.radio.write(byte).is_err() {
                self.unsent = Some(byte);
                return false;
            }
        }
        false
    }

    /// Returns whether the end of the last reply may still be on its way, so that a restart would lose it. The next
    /// request shows that the packet has been received.
    #[must_use]
    pub fn is_on_air(&self) -> bool {
        self.on_air_ms > 0 && self.port.waiting().is_none()
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

    /// Sends a reply, if there is one, as soon as the radio is free.
    pub fn send_reply(&mut self, reply: Reply<'static>) {
        self.port.send(reply, 0);
    }

    /// Returns the counters of the line.
    pub fn counters(&self) -> LineCounters {
        *self.port.counters()
    }
}

#[cfg(test)]
mod tests;
