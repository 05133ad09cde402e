//! The process image: the points of the slot, and the pulse counters of its digital inputs.

use modbus_server::{Bits, BitsOut, Exception, Span, Words, WordsOut};
use modio_drivers::{CHANNELS, ChannelSettings, ChannelStatus, Channels, Kind, scale};
use register_map::{codes::ModuleState, counters, points};

const SLOT: u16 = points::SLOT_FIRST;

/// The points of the slot. No other port of this board has one.
#[derive(Debug)]
pub struct Points {
    kinds: [Kind; CHANNELS],
    settings: [ChannelSettings; CHANNELS],
    /// Inputs as last scanned, outputs as commanded, words as their SCALE says.
    channels: Channels,
    pulses: [u32; CHANNELS],
    /// Inputs have been scanned once: from then on a rising edge counts.
    scanned: bool,
    /// Channels that cannot be read or driven, channel 1 in bit 0.
    failing: u8,
}

impl Points {
    /// The points of a slot whose channels are of these kinds, everything off.
    #[must_use]
    pub fn new(kinds: [Kind; CHANNELS]) -> Self {
        Self {
            kinds,
            settings: kinds.map(ChannelSettings::default_for),
            channels: Channels::new(),
            pulses: [0; CHANNELS],
            scanned: false,
            failing: 0,
        }
    }

    /// Takes new settings. Outputs stay where they are: a commanded word is brought to the new scale.
    pub fn configure(&mut self, settings: [ChannelSettings; CHANNELS]) {
        for (channel, (from, to)) in self.settings.iter().zip(&settings).enumerate() {
            if self.kinds.get(channel) == Some(&Kind::WordOutput) {
                let word = scale::output_rescaled(self.channels.word(channel), from, to);
                self.channels.set_word(channel, word);
            }
        }
        self.settings = settings;
    }

    /// The settings last taken.
    #[must_use]
    pub const fn settings(&self) -> &[ChannelSettings; CHANNELS] {
        &self.settings
    }

    /// What stands in the slot's channels, for the scan to take its outputs from.
    #[must_use]
    pub const fn channels(&self) -> &Channels {
        &self.channels
    }

    /// Takes the inputs a scan has brought, made under `settings`. Outputs stay as commanded, which
    /// may have happened during the scan; so may a change of settings, and then words wait for the
    /// next one.
    pub fn scanned(&mut self, scanned: &Channels, settings: &[ChannelSettings; CHANNELS]) {
        for (channel, (kind, pulses)) in self.kinds.iter().zip(&mut self.pulses).enumerate() {
            match kind {
                Kind::BitInput => {
                    let now = scanned.bit(channel);
                    if self.scanned && now && !self.channels.bit(channel) {
                        *pulses = pulses.wrapping_add(1);
                    }
                    self.channels.set_bit(channel, now);
                }
                Kind::WordInput if self.settings.get(channel) == settings.get(channel) => {
                    self.channels.set_word(channel, scanned.word(channel));
                    self.channels.set_status(channel, scanned.status(channel));
                }
                Kind::WordInput | Kind::None | Kind::BitOutput | Kind::WordOutput => {}
            }
        }
        self.scanned = true;
    }

    /// Takes note of the channels that cannot be read or driven, channel 1 in bit 0.
    pub const fn set_failing(&mut self, channels: u8) {
        self.failing = channels;
    }

    /// The channels that cannot be read or driven, channel 1 in bit 0.
    #[must_use]
    pub const fn failing(&self) -> u8 {
        self.failing
    }

    /// Commands outputs by raw values, as SAFE and START have them: 0 or 1 for a bit, 0 to 4095 for a
    /// word, none to leave it as it is.
    pub fn command_raw(&mut self, values: [Option<u16>; CHANNELS]) {
        let settings = self.settings.iter().zip(&self.kinds);
        for (channel, (value, (settings, kind))) in values.into_iter().zip(settings).enumerate() {
            match (kind, value) {
                (Kind::BitOutput, Some(value)) => self.channels.set_bit(channel, value != 0),
                (Kind::WordOutput, Some(value)) => self.channels.set_word(
                    channel,
                    scale::output_from_raw(value, settings.range, settings.scale),
                ),
                _ => {}
            }
        }
    }

    /// How the module fares.
    #[must_use]
    pub fn module_state(&self) -> ModuleState {
        if self.kinds == [Kind::None; CHANNELS] {
            ModuleState::None
        } else if self.failing != 0 {
            ModuleState::NotAnswering
        } else if (0..CHANNELS).any(|c| self.channels.status(c) != ChannelStatus::Good) {
            ModuleState::OutOfRange
        } else {
            ModuleState::Good
        }
    }

    /// Whether the module has a fault: it does not answer, or a channel is out of range.
    #[must_use]
    pub fn has_fault(&self) -> bool {
        match self.module_state() {
            ModuleState::NotAnswering | ModuleState::OutOfRange => true,
            ModuleState::Good | ModuleState::None => false,
        }
    }

    /// The status of a point, 0 to 31: good for one that does not exist.
    #[must_use]
    pub fn status_of(&self, point: u16) -> ChannelStatus {
        self.channels.status(channel_of(point))
    }

    /// Checks that a span's points exist and are all of a kind that will do, which is 02, then that
    /// all of them can be read or driven, which is 04.
    fn check(&self, span: Span, will_do: fn(Kind) -> bool) -> Result<(), Exception> {
        self.check_exist(span, will_do)?;
        self.check_answers(span)
    }

    fn check_exist(&self, span: Span, will_do: fn(Kind) -> bool) -> Result<(), Exception> {
        let exists = |address| {
            let kind = self.kinds.get(channel_of(address));
            kind.copied().is_some_and(will_do)
        };
        // A long span fails at its fifth address at the latest.
        if span.addresses().all(exists) {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    fn check_answers(&self, span: Span) -> Result<(), Exception> {
        // The span exists: its channels are 0 to 3.
        let fails = |address| self.failing >> (channel_of(address) & 3) & 1 != 0;
        if self.failing != 0 && span.addresses().any(fails) {
            Err(Exception::ServerDeviceFailure)
        } else {
            Ok(())
        }
    }

    /// Whether these bit points may be read.
    ///
    /// # Errors
    ///
    /// 02 for points that do not exist, 04 when one of them cannot be read or driven.
    pub fn check_read_bits(&self, span: Span) -> Result<(), Exception> {
        self.check(span, |kind| {
            matches!(kind, Kind::BitInput | Kind::BitOutput)
        })
    }

    /// Whether these word points may be read.
    ///
    /// # Errors
    ///
    /// As for [`check_read_bits`](Self::check_read_bits).
    pub fn check_read_words(&self, span: Span) -> Result<(), Exception> {
        self.check(span, |kind| {
            matches!(kind, Kind::WordInput | Kind::WordOutput)
        })
    }

    /// Whether these bit points may be written.
    ///
    /// # Errors
    ///
    /// As for [`check_read_bits`](Self::check_read_bits); 02 for inputs too.
    pub fn check_write_bits(&self, span: Span) -> Result<(), Exception> {
        self.check(span, |kind| kind == Kind::BitOutput)
    }

    /// Whether these word points may be written with these values.
    ///
    /// # Errors
    ///
    /// As for [`check_write_bits`](Self::check_write_bits), with 03 for a value out of range between
    /// the two.
    pub fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        self.check_exist(span, |kind| kind == Kind::WordOutput)?;
        let allowed = span.addresses().zip(words.iter()).all(|(address, word)| {
            self.settings
                .get(channel_of(address))
                .is_some_and(|settings| {
                    let (min, max) = scale::output_limits(settings.range, settings.scale);
                    (min..=max).contains(&word)
                })
        });
        if !allowed {
            return Err(Exception::IllegalDataValue);
        }
        self.check_answers(span)
    }

    /// Reads bit points that were found good.
    pub fn read_bits(&self, span: Span, out: &mut BitsOut<'_>) {
        span.addresses()
            .for_each(|address| out.push(self.channels.bit(channel_of(address))));
    }

    /// Reads word points that were found good.
    pub fn read_words(&self, span: Span, out: &mut WordsOut<'_>) {
        span.addresses()
            .for_each(|address| out.push(self.channels.word(channel_of(address))));
    }

    /// Writes bit points that were found good.
    pub fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        span.addresses()
            .zip(bits.iter())
            .for_each(|(address, bit)| self.channels.set_bit(channel_of(address), bit));
    }

    /// Writes word points that were found good.
    pub fn write_words(&mut self, span: Span, words: Words<'_>) {
        span.addresses()
            .zip(words.iter())
            .for_each(|(address, word)| self.channels.set_word(channel_of(address), word));
    }

    /// A register of the pulse counters: 0 for a point that does not exist or is no digital input.
    #[must_use]
    pub fn pulse_word(&self, address: u16) -> u16 {
        let offset = address.wrapping_sub(counters::PULSES);
        let pulses = self.pulses.get(channel_of(offset / counters::WORDS));
        let [high, low] = words_of(pulses.copied().unwrap_or_default());
        if offset.is_multiple_of(2) { high } else { low }
    }

    /// Clears the counters of a span that `check_clear` found good.
    pub fn clear_pulses(&mut self, span: Span) {
        for address in span.addresses() {
            let point = address.wrapping_sub(counters::PULSES) / counters::WORDS;
            if let Some(pulses) = self.pulses.get_mut(channel_of(point)) {
                *pulses = 0;
            }
        }
    }
}

/// Whether a write to the pulse counters is zeros for whole counters.
///
/// # Errors
///
/// 03 when it is not.
pub fn check_clear(span: Span, words: Words<'_>) -> Result<(), Exception> {
    let whole = span.start().is_multiple_of(2) && span.count().is_multiple_of(2);
    if whole && words.iter().all(|word| word == 0) {
        Ok(())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// A 32-bit value as registers, high word first.
pub(super) const fn words_of(value: u32) -> [u16; 2] {
    [(value >> 16) as u16, value as u16]
}

/// The slot's channel of a point; beyond its channels for a point that is not the slot's.
fn channel_of(point: u16) -> usize {
    usize::from(point.wrapping_sub(SLOT))
}
