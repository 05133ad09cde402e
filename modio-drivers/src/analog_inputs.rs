//! The analog inputs of a module: which line to sample, and what each channel makes of its samples.

use crate::low_pass::{LOW_PASS_DEFAULT, LowPass};
use crate::{
    AnalogSource, CHANNELS, ChannelSettings, ChannelStatus, Channels, Code, Kind, ModuleError,
    Scale, input_status, scale::Measured,
};

/// The calls of [`AnalogSource::read`] a module makes in one scan at most, for all its lines together.
/// A converter that converts on demand may take about 20 calls for each.
pub const POLLS_PER_SCAN: u8 = 64;

/// Scans in a row without any answer from the converter after which all its lines count as failed.
pub const STALLED_SCANS: u8 = 10;

/// Inputs on the slot's first lines.
#[derive(Debug)]
pub(crate) struct AnalogInputs<S> {
    source: S,
    inputs: [Input; CHANNELS],
    /// How many of them there are.
    count: usize,
    /// The line to ask for next, or being asked for.
    line: usize,
    stalled: u8,
}

impl<S: AnalogSource> AnalogInputs<S> {
    /// One input for each of the first `count` lines, at most four.
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

    /// Samples every line once, or as many as the converter has time for, and shows all channels.
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
            // At most three, so the cast keeps it.
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
            // The converter serves them all.
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
            // The other range's status says nothing about this one, not even as hysteresis.
            self.status = ChannelStatus::Good;
        }
        self.filter.set_n(settings.filter);
        self.settings = *settings;
    }

    fn sample(&mut self, code: Code) {
        self.failed = false;
        self.filter.sample(code);
    }

    /// The channel keeps what it shows. What was filtered is out of date when the line comes back.
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
