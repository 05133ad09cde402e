//! The points of one port: the values of its module's channels and the pulse counters of its digital inputs.

use modio_drivers::{CHANNELS, ChannelSettings, ChannelStatus, Channels, Code, Kind, scale};
use register_map::board::{Board, Each};
use register_map::codes::ModuleState;
use register_map::limits;

use crate::config::Point;
use crate::links::Act;
use crate::stage::Stage;

/// The points of one port.
#[derive(Clone, Copy, Debug)]
pub struct IoPort<B: Board> {
    kinds: [Kind; CHANNELS],
    settings: [ChannelSettings; CHANNELS],
    /// Inputs as last scanned, outputs as commanded, words in the unit set by SCALE.
    pub(super) channels: Channels,
    /// SAFE in force of each channel; `None` holds the output.
    safe: [Option<u16>; CHANNELS],
    pulses: [u32; CHANNELS],
    /// Uptime of the last edge of each digital input in ms; 0 without one.
    edges: [u32; CHANNELS],
    /// Uptime in ms at which the pulse of a digital output ends.
    pulse_ends: [u32; CHANNELS],
    /// Outputs with a pulse, channel 1 in bit 0.
    pub(super) pulsing: u8,
    /// Changes of words that are events; 0 for 1/256 of the range.
    deadbands: Each<B::Events, [u16; CHANNELS]>,
    pub(super) stage: Each<B::Stage, Stage>,
    /// What was commanded last, raw, of each output that was set to SAFE since then.
    before_safe: Each<B::Kept, [u16; CHANNELS]>,
    /// The inputs have been scanned once. From then on a rising edge counts.
    scanned: bool,
    /// Channels that cannot be read or driven, channel 1 in bit 0.
    failing: u8,
}

impl<B: Board> IoPort<B> {
    /// Creates the points of a port with channels of these kinds, with every value 0.
    #[must_use]
    pub fn new(kinds: [Kind; CHANNELS]) -> Self {
        Self {
            kinds,
            settings: [ChannelSettings::default_for(Kind::None); CHANNELS],
            channels: Channels::new(),
            safe: [None; CHANNELS],
            pulses: [0; CHANNELS],
            edges: [0; CHANNELS],
            pulse_ends: [0; CHANNELS],
            pulsing: 0,
            deadbands: Each::all([0; CHANNELS]),
            stage: Each::all(Stage::new(of_kind(&kinds, Kind::BitOutput))),
            before_safe: Each::all([0; CHANNELS]),
            scanned: false,
            failing: 0,
        }
    }

    /// Applies the settings and SAFE of a channel. The output does not change: a commanded word is converted to the new
    /// scale.
    pub fn configure(&mut self, channel: usize, to: Point) {
        let kind = self.kind(channel);
        let places = (self.settings.get_mut(channel), self.safe.get_mut(channel));
        let (Some(settings), Some(safe)) = places else {
            return;
        };
        if kind == Kind::WordOutput {
            let word = self.channels.word(channel);
            let word = scale::output_rescaled(word, settings, &to.settings);
            self.channels.set_word(channel, word);
        }
        *settings = to.settings;
        *safe = to.safe;
        if let Some(deadband) = self.deadbands.as_flattened_mut().get_mut(channel) {
            *deadband = to.deadband;
        }
    }

    /// Returns the settings that were applied last.
    #[must_use]
    pub const fn settings(&self) -> &[ChannelSettings; CHANNELS] {
        &self.settings
    }

    /// Returns the values of the port's channels, for the scan to drive the outputs.
    #[must_use]
    pub const fn channels(&self) -> &Channels {
        &self.channels
    }

    /// Stores the inputs of a scan. Outputs keep their commanded values, which may have changed during the scan.
    /// The settings may have changed, too: then the words of the scan have the wrong unit and are ignored (`words`
    /// is false). `now` is the uptime in ms, not 0. Returns the digital inputs that have changed, channel 1 in bit 0.
    pub fn scanned(&mut self, scanned: &Channels, words: bool, now: u32) -> u8 {
        let mut changed = 0;
        let inputs = self.pulses.iter_mut().zip(&mut self.edges);
        for (channel, (kind, (pulses, edge))) in self.kinds.iter().zip(inputs).enumerate() {
            match kind {
                Kind::BitInput => {
                    let level = scanned.bit(channel);
                    if self.scanned && level != self.channels.bit(channel) {
                        changed |= 1 << channel;
                        *edge = now;
                        *pulses = pulses.wrapping_add(level.into());
                    }
                    self.channels.set_bit(channel, level);
                }
                Kind::WordInput if words => {
                    self.channels.set_word(channel, scanned.word(channel));
                    self.channels.set_status(channel, scanned.status(channel));
                }
                Kind::WordInput | Kind::None | Kind::BitOutput | Kind::WordOutput => {}
            }
        }
        self.scanned = true;
        changed
    }

    /// Returns the uptime of the last edge of each digital input in ms; 0 without one.
    #[must_use]
    pub const fn edges(&self) -> &[u32; CHANNELS] {
        &self.edges
    }

    /// Sets a digital output. This ends a pulse of the output.
    // Inlined into the loop over the bits of a write.
    #[inline(always)]
    pub(super) const fn set_output(&mut self, channel: usize, value: bool) {
        self.channels.set_bit(channel, value);
        self.pulsing &= !(1 << (channel & 7));
    }

    /// Clears the outputs whose pulse ends at the uptime `now` in ms.
    pub(super) fn end_pulses(&mut self, now: u32) {
        if self.pulsing == 0 {
            return;
        }
        for (channel, end) in self.pulse_ends.into_iter().enumerate() {
            let is_over = now.wrapping_sub(end).cast_signed() >= 0;
            if is_over && self.pulsing >> channel & 1 != 0 {
                self.set_output(channel, false);
            }
        }
    }

    /// Returns the outputs with a pulse, channel 1 in bit 0.
    #[must_use]
    pub const fn pulsing(&self) -> u8 {
        self.pulsing
    }

    /// Returns SAFE of a digital output; `None` holds it.
    pub(super) fn safe_bit(&self, channel: usize) -> Option<bool> {
        let safe = self.safe.get(channel).copied().flatten();
        safe.map(|safe| safe != 0)
    }

    /// Returns the channels of this kind, channel 1 in bit 0.
    #[must_use]
    pub fn channels_of(&self, kind: Kind) -> u8 {
        of_kind(&self.kinds, kind)
    }

    /// Does what a link does to an output at the uptime `now` in ms. Nothing happens when a write of the output would be
    /// rejected: then returns false.
    pub(super) fn act(&mut self, channel: usize, act: Act, now: u32) -> bool {
        if self.kind(channel) != Kind::BitOutput || self.failing >> (channel & 7) & 1 != 0 {
            return false;
        }
        self.set_output(channel, act.value);
        if act.pulse_ms > 0
            && let Some(end) = self.pulse_ends.get_mut(channel)
        {
            *end = now.wrapping_add(act.pulse_ms);
            self.pulsing |= 1 << (channel & 7);
        }
        true
    }

    /// Stores which channels cannot be read or driven, channel 1 in bit 0.
    pub const fn set_failing(&mut self, channels: u8) {
        self.failing = channels;
    }

    /// Returns the channels that cannot be read or driven, channel 1 in bit 0.
    #[must_use]
    pub const fn failing(&self) -> u8 {
        self.failing
    }

    /// Commands an output with a raw value, as SAFE and START have it: 0 or 1 for a bit, 0 to 4095 for a word.
    pub fn command_raw(&mut self, channel: usize, value: u16) {
        match (self.kind(channel), self.setting(channel)) {
            (Kind::BitOutput, _) => self.set_output(channel, value != 0),
            (Kind::WordOutput, Some(settings)) => {
                let code = Code::new(value);
                let word = scale::output_from_raw(code, settings.signal, settings.scale);
                self.channels.set_word(channel, word);
            }
            _ => {}
        }
    }

    /// Returns what an output is commanded: 0 or 1 for a bit, 0 to 4095 raw for a word. A pulse counts as ended.
    #[must_use]
    pub fn commanded(&self, channel: usize) -> u16 {
        match (self.kind(channel), self.setting(channel)) {
            (Kind::BitOutput, _) if self.pulsing >> (channel & 7) & 1 == 0 => {
                self.channels.bit(channel).into()
            }
            (Kind::WordOutput, Some(settings)) => {
                let word = self.channels.word(channel);
                scale::output_to_raw(word, settings.signal, settings.scale).get()
            }
            _ => 0,
        }
    }

    /// Returns what was commanded, raw, before the output was set to SAFE.
    pub(super) fn before_safe(&self, channel: usize) -> u16 {
        self.before_safe
            .as_flattened()
            .get(channel)
            .copied()
            .unwrap_or_default()
    }

    /// Returns the value of a channel: 0 or 1 for a bit.
    pub(super) fn value(&self, channel: usize) -> u16 {
        match self.kind(channel) {
            Kind::WordInput | Kind::WordOutput => self.channels.word(channel),
            Kind::None | Kind::BitInput | Kind::BitOutput => self.channels.bit(channel).into(),
        }
    }

    /// Returns the smallest change of a word that is an event.
    pub(super) fn deadband(&self, channel: usize) -> u16 {
        if let Some(set) = self.deadbands.as_flattened().get(channel)
            && *set != 0
        {
            return *set;
        }
        let range = self.setting(channel).map(|setting| {
            let (min, max) = limits::of_input(setting.signal, setting.scale);
            max.abs_diff(min)
        });
        range.unwrap_or_default() / 256
    }

    /// Sets an output to SAFE, and keeps what was commanded `before`. Returns false when SAFE holds the output.
    pub(super) fn go_safe(&mut self, channel: usize, before: u16) -> bool {
        let Some(value) = self.safe.get(channel).copied().flatten() else {
            return false;
        };
        self.keep_before_safe(channel, before);
        self.command_raw(channel, value);
        true
    }

    /// Keeps what was commanded, raw, before an output was set to SAFE.
    pub(super) fn keep_before_safe(&mut self, channel: usize, before: u16) {
        if let Some(place) = self.before_safe.as_flattened_mut().get_mut(channel) {
            *place = before;
        }
    }

    /// Returns the state of the module.
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

    /// Returns whether the module has a fault: it does not answer, or a channel is out of range.
    #[must_use]
    pub fn has_fault(&self) -> bool {
        match self.module_state() {
            ModuleState::NotAnswering | ModuleState::OutOfRange => true,
            ModuleState::Good | ModuleState::None => false,
        }
    }

    /// Returns the kind of a channel.
    pub(super) fn kind(&self, channel: usize) -> Kind {
        self.kinds.get(channel).copied().unwrap_or(Kind::None)
    }

    /// Returns the settings of a channel.
    pub(super) fn setting(&self, channel: usize) -> Option<&ChannelSettings> {
        self.settings.get(channel)
    }

    /// Returns the pulse counters.
    #[must_use]
    pub const fn pulses(&self) -> &[u32; CHANNELS] {
        &self.pulses
    }

    /// Sets the pulse counters. Those of channels that are not digital inputs stay 0.
    pub fn set_pulses(&mut self, pulses: [u32; CHANNELS]) {
        for (own, (kind, pulses)) in self.pulses.iter_mut().zip(self.kinds.iter().zip(pulses)) {
            if *kind == Kind::BitInput {
                *own = pulses;
            }
        }
    }

    /// Sets a channel's pulse counter to 0.
    pub(super) fn clear_pulses(&mut self, channel: usize) {
        if let Some(pulses) = self.pulses.get_mut(channel) {
            *pulses = 0;
        }
    }
}

/// Returns the channels of this kind, channel 1 in bit 0.
fn of_kind(kinds: &[Kind; CHANNELS], kind: Kind) -> u8 {
    let of_kind = |mask, (channel, own): (usize, &Kind)| mask | u8::from(*own == kind) << channel;
    kinds.iter().enumerate().fold(0, of_kind)
}
