//! The points of all ports with a slot: the values that requests and the scan share.

use core::ops::Range;

use modbus_server::{Bits, BitsOut, Exception, Span, Words, WordsOut};
use modio_drivers::{CHANNELS, ChannelStatus, Kind};
use register_map::board::{Board, Each};
use register_map::{counters, edges, limits, points};

use super::port::IoPort;
use crate::config::Config;
use crate::links::Act;

/// The points of the board's slots. Their port numbers are consecutive.
#[derive(Debug)]
pub struct Points<B: Board> {
    pub(super) ports: Each<B::Ports, IoPort<B>>,
    /// Outputs that are at SAFE and were not commanded since, the first port's channel 1 in bit 0.
    pub(super) at_safe: Each<B::Kept, u32>,
    /// Ports whose stage has something to do, the first one in bit 0.
    pub(super) staged: u8,
}

impl<B: Board> Points<B> {
    /// Creates the points of the modules in force, with every value 0.
    #[must_use]
    pub fn new(config: &Config<B>) -> Self {
        Self {
            ports: Each::of(|slot| IoPort::new(config.kinds(slot))),
            at_safe: Each::all(0),
            staged: 0,
        }
    }

    /// Returns the ports with a slot.
    #[must_use]
    pub fn ports(&self) -> &[IoPort<B>] {
        &self.ports
    }

    /// Returns the ports with a slot, to be changed.
    pub fn ports_mut(&mut self) -> &mut [IoPort<B>] {
        &mut self.ports
    }

    /// Returns the address of the first point of a port, given the port's index.
    #[must_use]
    pub fn first_of(index: usize) -> u16 {
        B::ROW
            .points()
            .start
            .wrapping_add((index * CHANNELS) as u16)
    }

    /// Returns whether a channel of any port cannot be read or driven.
    #[must_use]
    pub fn any_fails(&self) -> bool {
        self.ports.iter().any(|port| port.failing() != 0)
    }

    /// Returns whether any module has a fault: it does not answer, or a channel is out of range.
    #[must_use]
    pub fn has_fault(&self) -> bool {
        self.ports.iter().any(IoPort::has_fault)
    }

    /// Returns how many points of ports with slots precede a point. Returns a large number for a port in front of
    /// all ports with a slot.
    #[inline]
    fn index(point: u16) -> usize {
        usize::from(point.wrapping_sub(B::ROW.points().start))
    }

    /// Returns the indices of a span's points.
    #[inline]
    fn indices(span: Span) -> Range<usize> {
        let start = Self::index(span.start());
        start..start + usize::from(span.count())
    }

    /// Returns the port of a point, given the point's index, and its channel number; `None` when the port has no
    /// slot.
    // Without this attribute the compiler emits a call for every point of a request.
    #[inline(always)]
    fn place(&self, index: usize) -> Option<(&IoPort<B>, usize)> {
        Some((self.ports.get(index / CHANNELS)?, index % CHANNELS))
    }

    #[inline(always)]
    fn place_mut(&mut self, index: usize) -> Option<(&mut IoPort<B>, usize)> {
        Some((self.ports.get_mut(index / CHANNELS)?, index % CHANNELS))
    }

    /// Returns the slot and the channel of a point.
    pub(super) fn index_of(point: u16) -> Option<(usize, usize)> {
        let index = Self::index(point);
        (index < B::PORTS * CHANNELS).then_some((index / CHANNELS, index % CHANNELS))
    }

    /// Returns the status of a point, 0 to 31: good for a point that does not exist.
    #[must_use]
    pub fn status_of(&self, point: u16) -> ChannelStatus {
        self.place(Self::index(point))
            .map_or(ChannelStatus::Good, |(port, channel)| port.status(channel))
    }

    /// Checks that all points of a span exist and have one of these kinds; otherwise exception 02. Exception 04 when one
    /// of them that has one of the kinds `needed` cannot be read or driven.
    fn check_kinds(&self, span: Span, kinds: Kinds, needed: Kinds) -> Result<(), Exception> {
        let mut fails = 0;
        // A long span fails at the first address after the last port.
        for index in Self::indices(span) {
            match self.place(index) {
                Some((port, channel)) if kinds.contain(port.kind(channel)) => {
                    fails |= needed.0 >> port.kind(channel) as u8 & port.failing() >> channel;
                }
                _ => return Err(Exception::IllegalDataAddress),
            }
        }
        if fails & 1 == 0 {
            Ok(())
        } else {
            Err(Exception::ServerDeviceFailure)
        }
    }

    /// Checks whether these bit points can be read. Outputs always can: a read returns the commanded value, which
    /// does not depend on the module. Some masters give up a unit at the first exception, so a failed output must
    /// not hide the points that are read with it.
    ///
    /// # Errors
    ///
    /// Exception 02 for points that do not exist, 04 when one of them is an input that cannot be read.
    pub fn check_read_bits(&self, span: Span) -> Result<(), Exception> {
        self.check_kinds(span, Kinds::BITS, Kinds::INPUTS)
    }

    /// Checks whether these word points can be read.
    ///
    /// # Errors
    ///
    /// As for [`check_read_bits`](Self::check_read_bits).
    pub fn check_read_words(&self, span: Span) -> Result<(), Exception> {
        self.check_kinds(span, Kinds::WORDS, Kinds::INPUTS)
    }

    /// Checks whether these bit points can be written.
    ///
    /// # Errors
    ///
    /// Exception 02 for points that do not exist and for inputs, 04 when one of them cannot be driven.
    pub fn check_write_bits(&self, span: Span) -> Result<(), Exception> {
        self.check_kinds(span, Kinds::BIT_OUTPUTS, Kinds::BIT_OUTPUTS)
    }

    /// Checks whether these word points can be written with these values.
    ///
    /// # Errors
    ///
    /// As for [`check_write_bits`](Self::check_write_bits), and 03 for a value out of range, which is checked after
    /// 02 and before 04.
    pub fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        let checked = self.check_kinds(span, Kinds::WORD_OUTPUTS, Kinds::WORD_OUTPUTS);
        if checked == Err(Exception::IllegalDataAddress) {
            return checked;
        }
        let allowed = Self::indices(span).zip(words.iter()).all(|(index, word)| {
            let place = self.place(index);
            place
                .and_then(|(port, channel)| port.setting(channel))
                .is_some_and(|settings| {
                    let (min, max) = limits::of_output(settings.signal, settings.scale);
                    (min..=max).contains(&word)
                })
        });
        if !allowed {
            return Err(Exception::IllegalDataValue);
        }
        checked
    }

    /// Reads bit points that the check has accepted.
    pub fn read_bits(&self, span: Span, out: &mut BitsOut<'_>) {
        for index in Self::indices(span) {
            let place = self.place(index);
            out.push(place.is_some_and(|(port, channel)| port.channels.bit(channel)));
        }
    }

    /// Reads word points that the check has accepted.
    pub fn read_words(&self, span: Span, out: &mut WordsOut<'_>) {
        for index in Self::indices(span) {
            let place = self.place(index);
            out.push(place.map_or(0, |(port, channel)| port.channels.word(channel)));
        }
    }

    /// Writes bit points that the check has accepted.
    #[inline]
    pub fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        self.leave_safe(span);
        // While no output has a time, the stage costs no more than this.
        let before = self.coils_before();
        for (index, bit) in Self::indices(span).zip(bits.iter()) {
            if let Some((port, channel)) = self.place_mut(index) {
                port.set_output(channel, bit);
            }
        }
        if let Some(before) = before {
            self.settle(before, Self::mask_of(Self::indices(span)), true);
        }
    }

    /// Returns a bit for each of these indices.
    const fn mask_of(indices: Range<usize>) -> u32 {
        u32::MAX >> ((32 - (indices.end - indices.start)) & 31) << (indices.start & 31)
    }

    /// Writes word points that the check has accepted.
    pub fn write_words(&mut self, span: Span, words: Words<'_>) {
        self.leave_safe(span);
        for (index, word) in Self::indices(span).zip(words.iter()) {
            if let Some((port, channel)) = self.place_mut(index) {
                port.channels.set_word(channel, word);
            }
        }
    }

    /// Does what a link does to an output of a port, at the uptime `now` in ms. Returns false when a write of the output
    /// would be rejected.
    pub(super) fn act(&mut self, slot: usize, channel: usize, act: Act, now: u32) -> bool {
        let port = self.ports.get_mut(slot);
        let done = port.is_some_and(|port| port.act(channel, act, now));
        if done {
            self.leave_safe_now(slot * CHANNELS + channel, 1);
        }
        done
    }

    /// Sets the outputs to SAFE, but those of each slot that `but` returns, channel 1 in bit 0.
    pub(super) fn go_safe(&mut self, but: impl Fn(usize) -> u8) {
        let before_safe = self.coils_before();
        let mut named = 0;
        for index in 0..B::PORTS * CHANNELS {
            if but(index / CHANNELS) >> (index % CHANNELS) & 1 != 0 {
                continue;
            }
            let before = self.commanded(index);
            if let Some((port, channel)) = self.place_mut(index)
                && port.go_safe(channel, before)
            {
                named |= 1 << (index & 31);
            }
        }
        for at_safe in self.at_safe.iter_mut() {
            *at_safe |= named;
        }
        if let Some(before) = before_safe {
            self.settle(before, named, false);
        }
    }

    /// Sets an output to the raw value that it had before a reset. `at_safe`: that was SAFE, so what was commanded before
    /// still counts as commanded.
    pub(super) fn return_to(&mut self, slot: usize, channel: usize, value: u16, at_safe: bool) {
        let index = slot * CHANNELS + channel;
        let before = self.commanded(index);
        if let Some((port, channel)) = self.place_mut(index) {
            port.command_raw(channel, value);
            if at_safe {
                port.keep_before_safe(channel, before);
            }
        }
        for marks in self.at_safe.iter_mut() {
            *marks |= u32::from(at_safe) << (index & 31);
        }
    }

    /// Returns what a master or a link commanded last of the output with this index, not SAFE: 0 or 1 for a bit, 0 to 4095
    /// raw for a word. A pulse counts as ended.
    pub(super) fn commanded(&self, index: usize) -> u16 {
        let is_safe = self.at_safe() >> (index & 31) & 1 != 0;
        self.place(index).map_or(0, |(port, channel)| {
            if is_safe {
                port.before_safe(channel)
            } else {
                port.commanded(channel)
            }
        })
    }

    /// Returns the outputs that are at SAFE and were not commanded since.
    #[inline(always)]
    pub(super) fn at_safe(&self) -> u32 {
        self.at_safe.first().copied().unwrap_or_default()
    }

    /// Marks points as commanded, so that they are no longer at SAFE.
    #[inline(always)]
    fn leave_safe(&mut self, span: Span) {
        // Most requests end here, after a few instructions.
        if self.at_safe() != 0 {
            self.leave_safe_now(Self::index(span.start()), span.count());
        }
    }

    #[cold]
    #[inline(never)]
    fn leave_safe_now(&mut self, index: usize, count: u16) {
        for at_safe in self.at_safe.iter_mut() {
            // `count` is at least 1, and the points are within the 32.
            let points = u32::MAX >> ((32 - u32::from(count)) & 31) << (index & 31);
            *at_safe &= !points;
        }
    }

    /// Returns a register of the pulse counters or of the last edges: 0 for a point that does not exist or is not a
    /// digital input.
    // Not inlined, as `Device::state_word`.
    #[inline(never)]
    #[must_use]
    pub fn input_word(&self, address: u16) -> u16 {
        // Both blocks begin at a multiple of their length.
        let place = self.place(Self::index(
            address % (points::COUNT * counters::WORDS) / counters::WORDS,
        ));
        let value = place.and_then(|(port, channel)| {
            let values = if address < edges::LAST_EDGE {
                port.pulses()
            } else {
                port.edges()
            };
            values.get(channel)
        });
        let [high, low] = words_of(value.copied().unwrap_or_default());
        if address.is_multiple_of(counters::WORDS) {
            high
        } else {
            low
        }
    }

    /// Clears the counters of a span that `check_clear` has accepted.
    pub fn clear_pulses(&mut self, span: Span) {
        for address in span.addresses() {
            let point = address.wrapping_sub(counters::PULSES) / counters::WORDS;
            if let Some((port, channel)) = self.place_mut(Self::index(point)) {
                port.clear_pulses(channel);
            }
        }
    }
}

/// A set of point kinds, one bit for each.
#[derive(Clone, Copy)]
struct Kinds(u8);

impl Kinds {
    const BITS: Self = Self::of(&[Kind::BitInput, Kind::BitOutput]);
    const WORDS: Self = Self::of(&[Kind::WordInput, Kind::WordOutput]);
    const INPUTS: Self = Self::of(&[Kind::BitInput, Kind::WordInput]);
    const BIT_OUTPUTS: Self = Self::of(&[Kind::BitOutput]);
    const WORD_OUTPUTS: Self = Self::of(&[Kind::WordOutput]);

    const fn of(mut kinds: &[Kind]) -> Self {
        let mut bits = 0;
        while let Some((kind, rest)) = kinds.split_first() {
            bits |= 1 << *kind as u8;
            kinds = rest;
        }
        Self(bits)
    }

    const fn contain(self, kind: Kind) -> bool {
        self.0 >> kind as u8 & 1 != 0
    }
}

/// Checks that a write to the pulse counters writes zeros to whole counters.
///
/// # Errors
///
/// Exception 03 when it does not.
pub fn check_clear(span: Span, words: Words<'_>) -> Result<(), Exception> {
    let whole = span.start().is_multiple_of(2) && span.count().is_multiple_of(2);
    if whole && words.iter().all(|word| word == 0) {
        Ok(())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// Returns a 32-bit value as registers, high word first.
pub(super) const fn words_of(value: u32) -> [u16; 2] {
    [(value >> 16) as u16, value as u16]
}
