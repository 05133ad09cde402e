//! A slot: four lines that become what the module in it needs.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

use crate::{
    AnalogInputs,
    boards::SlotPins,
    pin::{Mode, Pin},
};

/// The four lines, floating as after a reset until one of the methods is called. A module that needs
/// none of them, or one that is not there, leaves them so. To be set up in `init`, before the first interrupt.
pub struct Slot {
    lines: [Pin; 4],
    dac_address: u8,
}

/// How many of a slot's lines are analog inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalogLines {
    /// Lines 1 and 2.
    Two,
    /// All four.
    Four,
}

/// A slot line as an input with pull-up. The HAL's type for any pin of a port looks it up in an array,
/// with a panic for one that is not there.
pub struct SlotInput(Pin);

/// A slot line as a push-pull output.
pub struct SlotOutput(Pin);

fn input(line: Pin) -> SlotInput {
    line.pull_up();
    SlotInput(line)
}

/// Low from its first instant. The slowest edges are enough: relays and open collectors need no steep ones.
fn output(line: Pin) -> SlotOutput {
    line.configure(Mode::Output);
    SlotOutput(line)
}

impl Slot {
    /// Each of a board's slots is made once.
    pub(crate) const fn new(pins: &SlotPins) -> Self {
        Self {
            lines: pins.lines,
            dac_address: pins.dac_address,
        }
    }

    /// The address of its module's DAC, should that have one.
    #[must_use]
    pub const fn dac_address(&self) -> u8 {
        self.dac_address
    }

    /// Four inputs with pull-ups.
    #[must_use]
    pub fn into_inputs(self) -> [SlotInput; 4] {
        self.lines.map(input)
    }

    /// Four outputs that drive low from their first instant.
    #[must_use]
    pub fn into_outputs_low(self) -> [SlotOutput; 4] {
        self.lines.map(output)
    }

    /// Lines 1 and 2 as inputs with pull-ups, lines 3 and 4 as outputs that drive low from their first
    /// instant.
    #[must_use]
    pub fn into_relay(self) -> ([SlotInput; 2], [SlotOutput; 2]) {
        let [line1, line2, line3, line4] = self.lines;
        ([line1, line2].map(input), [line3, line4].map(output))
    }

    /// The first lines as analog inputs, the others left floating.
    #[must_use]
    pub fn into_analog(self, lines: AnalogLines) -> AnalogInputs {
        let count: u8 = match lines {
            AnalogLines::Two => 2,
            AnalogLines::Four => 4,
        };
        for line in self.lines.iter().take(count.into()) {
            line.configure(Mode::Analog);
        }
        AnalogInputs::new(self.lines, count)
    }
}

impl ErrorType for SlotInput {
    type Error = Infallible;
}

impl InputPin for SlotInput {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.is_high())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.is_high())
    }
}

impl ErrorType for SlotOutput {
    type Error = Infallible;
}

impl OutputPin for SlotOutput {
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }
}
