//! The analog inputs of a module: selects the lines to sample and computes each channel from its samples.

use crate::low_pass::{LOW_PASS_DEFAULT, LowPass};
use crate::{
    AnalogSource, CHANNELS, ChannelSettings, ChannelStatus, Channels, Code, Kind, ModuleError,
    Scale, input_status, scale::Measured,
};

/// Largest number of calls of [`AnalogSource::read`] that a module makes in one scan, for all its lines together. A
/// converter that converts on demand may take about 20 calls for each line.
pub const POLLS_PER_SCAN: u8 = 64;

/// Number of scans in a row without an answer from the converter after which all its lines count as failed.
pub const STALLED_SCANS: u8 = 10;

/// Analog inputs on the slot's first lines.
#[derive(Debug)]
pub(crate) struct AnalogInputs<S> {
    source: S,
    inputs: [Input; CHANNELS],
    /// Number of inputs.
    count: usize,
    /// Line to sample next, or being sampled.
    line: usize,
    stalled: u8,
}

impl<S: AnalogSource> AnalogInputs<S> {
    /// Creates one input for each of the first `count` lines, at most four.
    pub(crate) const fn new(source: S, count: usize) -> Self {
        Self {
            source,
            inputs: [Input::NEW; CHANNELS],
            count,
            line: 0,
            stalled: 0,
        }
    }

    pub(crate) fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        for (input, settings) in self.inputs.iter_mut().zip(settings) {
            input.configure(settings);
        }
    }

    #[cfg(test)]
    pub(crate) const fn source_mut(&mut self) -> &mut S {
        &mut self.source
    }

    /// Samples every line once, or as many as the converter has time for, and updates all channels.
    pub(crate) fn scan(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        self.sample();
        let mut result = Ok(());
        for (channel, input) in self.inputs.iter_mut().take(self.count).enumerate() {
            input.show(channels, channel);
            if input.failed {
                result = ModuleError::in_either(result, Err(ModuleError::line(channel)));
            }
        }
        result
    }

    fn sample(&mut self) {
        let mut answers = 0;
        for _ in 0..POLLS_PER_SCAN {
            // The line is at most 3, so the cast keeps the value.
            let answer = self.source.read(self.line as u8);
            let Some(input) = self.inputs.get_mut(self.line) else {
                return;
            };
            match answer {
                Ok(code) => input.sample(code),
                Err(nb::Error::Other(_)) => input.fail(),
                Err(nb::Error::WouldBlock) => continue,
            }
            self.line = if self.line + 1 < self.count {
                self.line + 1
            } else {
                0
            };
            answers += 1;
            if answers == self.count {
                break;
            }
        }
        if answers > 0 {
            self.stalled = 0;
        } else if self.stalled < STALLED_SCANS - 1 {
            self.stalled += 1;
        } else {
            // The converter serves all lines, so all of them fail.
            self.inputs.iter_mut().for_each(Input::fail);
        }
    }
}

/// One analog input.
#[derive(Clone, Copy, Debug)]
struct Input {
    settings: ChannelSettings,
    filter: LowPass,
    status: ChannelStatus,
    failed: bool,
}

impl Input {
    const NEW: Self = Self {
        settings: ChannelSettings::default_for(Kind::WordInput),
        filter: LowPass::new(LOW_PASS_DEFAULT),
        status: ChannelStatus::Good,
        failed: false,
    };

    fn configure(&mut self, settings: &ChannelSettings) {
        if settings.signal != self.settings.signal {
            // The status belongs to the previous range; do not use it for this one, not even for the hysteresis.
            self.status = ChannelStatus::Good;
        }
        self.filter.set_n(settings.filter);
        self.settings = *settings;
    }

    fn sample(&mut self, code: Code) {
        self.failed = false;
        self.filter.sample(code);
    }

    /// Marks the input as failed. The channel keeps its word, and the filter restarts when the line works again.
    fn fail(&mut self) {
        self.failed = true;
        self.filter.reset();
    }

    fn show(&mut self, channels: &mut Channels, channel: usize) {
        if let Some(code) = self.filter.code() {
            let measured = Measured::of(code, &self.settings);
            self.status = input_status::judge(code, measured, self.status);
            let word = match self.settings.scale {
                Scale::Raw => code.get(),
                Scale::Engineering => measured.word(),
            };
            channels.set_word(channel, word);
            channels.set_status(channel, self.status);
        }
    }
}
