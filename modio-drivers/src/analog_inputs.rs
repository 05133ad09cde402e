//! The analog inputs of a module: computes each channel from the codes of its line.

use register_map::limits::LOW_PASS_DEFAULT;

use crate::low_pass::LowPass;
use crate::{
    CHANNELS, ChannelSettings, ChannelStatus, Channels, Code, Kind, ModuleError, Scale,
    input_status, scale::Measured,
};

/// The codes of the slot's lines from an analog-to-digital converter of 12 bits: 0 for ground, 4095 for the
/// reference. `None` for a line that was not converted in this scan.
pub type Codes = [Option<u16>; CHANNELS];

/// Number of scans in a row without a code after which a line counts as failed.
pub const STALLED_SCANS: u8 = 10;

/// Analog inputs on the slot's first lines.
#[derive(Debug)]
pub(crate) struct AnalogInputs {
    inputs: [Input; CHANNELS],
    /// Number of inputs.
    count: usize,
}

impl AnalogInputs {
    /// Creates one input for each of the first `count` lines, at most four.
    pub(crate) const fn new(count: usize) -> Self {
        Self {
            inputs: [Input::NEW; CHANNELS],
            count,
        }
    }

    pub(crate) fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        for (input, settings) in self.inputs.iter_mut().zip(settings) {
            input.configure(settings);
        }
    }

    /// Adds the codes of a scan and updates all channels.
    pub(crate) fn scan(
        &mut self,
        codes: &Codes,
        channels: &mut Channels,
    ) -> Result<(), ModuleError> {
        let mut result = Ok(());
        let inputs = self.inputs.iter_mut().zip(codes).take(self.count);
        for (channel, (input, code)) in inputs.enumerate() {
            input.sample(*code);
            input.show(channels, channel);
            if input.stalled >= STALLED_SCANS {
                result = ModuleError::in_either(result, Err(ModuleError::line(channel)));
            }
        }
        result
    }
}

/// One analog input.
#[derive(Clone, Copy, Debug)]
struct Input {
    settings: ChannelSettings,
    filter: LowPass,
    status: ChannelStatus,
    /// Number of scans since the last code.
    stalled: u8,
}

impl Input {
    const NEW: Self = Self {
        settings: ChannelSettings::default_for(Kind::WordInput),
        filter: LowPass::new(LOW_PASS_DEFAULT),
        status: ChannelStatus::Good,
        stalled: 0,
    };

    fn configure(&mut self, settings: &ChannelSettings) {
        if settings.signal != self.settings.signal {
            // The status belongs to the previous range; do not use it for this one, not even for the hysteresis.
            self.status = ChannelStatus::Good;
        }
        self.filter.set_n(settings.filter);
        self.settings = *settings;
    }

    fn sample(&mut self, code: Option<u16>) {
        if let Some(code) = code {
            self.stalled = 0;
            self.filter.sample(Code::new(code));
            return;
        }
        self.stalled = self.stalled.saturating_add(1);
        if self.stalled >= STALLED_SCANS {
            // The channel keeps its word, and the filter restarts when the line works again.
            self.filter.reset();
        }
    }

    // Not inlined into the loop over the channels, which has few registers left.
    #[inline(never)]
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
