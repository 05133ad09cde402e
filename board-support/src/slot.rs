//! Port 5, the slot: four lines that become what the module in it needs.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use stm32f1xx_hal::{
    gpio::{Cr, Floating, Input, PA0, PA1, PA2, PA3, PinState},
    pac,
};

use crate::AnalogInputs;

/// The four lines, floating as after a reset until one of the methods is called. A module that needs
/// none of them, or one that is not there, leaves them so.
pub struct Slot {
    pub(crate) line1: PA0<Input<Floating>>,
    pub(crate) line2: PA1<Input<Floating>>,
    pub(crate) line3: PA2<Input<Floating>>,
    pub(crate) line4: PA3<Input<Floating>>,
    pub(crate) cr: Cr<'A', false>,
    pub(crate) adc: pac::ADC1,
}

/// How many of the slot's lines are analog inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalogLines {
    /// Lines 1 and 2.
    Two,
    /// All four.
    Four,
}

/// A slot line as an input with pull-up. The HAL's own type of one type for all four looks its pin up
/// in an array, with a panic for a pin that is not there.
pub struct SlotInput(Line);

/// A slot line as a push-pull output.
pub struct SlotOutput(Line);

/// A line's bit in the registers of port A. Only [`Slot`] makes them, one of each.
struct Line(u32);

const LINES: [Line; 4] = [Line(1 << 0), Line(1 << 1), Line(1 << 2), Line(1 << 3)];

impl Slot {
    /// Four inputs with pull-ups.
    #[must_use]
    pub fn into_inputs(mut self) -> [SlotInput; 4] {
        let cr = &mut self.cr;
        self.line1.into_pull_up_input(cr);
        self.line2.into_pull_up_input(cr);
        self.line3.into_pull_up_input(cr);
        self.line4.into_pull_up_input(cr);
        LINES.map(SlotInput)
    }

    /// Four outputs that drive low from their first instant.
    #[must_use]
    pub fn into_outputs_low(mut self) -> [SlotOutput; 4] {
        let (cr, low) = (&mut self.cr, PinState::Low);
        self.line1.into_push_pull_output_with_state(cr, low);
        self.line2.into_push_pull_output_with_state(cr, low);
        self.line3.into_push_pull_output_with_state(cr, low);
        self.line4.into_push_pull_output_with_state(cr, low);
        LINES.map(SlotOutput)
    }

    /// Lines 1 and 2 as inputs with pull-ups, lines 3 and 4 as outputs that drive low from their first
    /// instant.
    #[must_use]
    pub fn into_relay(mut self) -> ([SlotInput; 2], [SlotOutput; 2]) {
        let (cr, low) = (&mut self.cr, PinState::Low);
        self.line1.into_pull_up_input(cr);
        self.line2.into_pull_up_input(cr);
        self.line3.into_push_pull_output_with_state(cr, low);
        self.line4.into_push_pull_output_with_state(cr, low);
        let [line1, line2, line3, line4] = LINES;
        (
            [SlotInput(line1), SlotInput(line2)],
            [SlotOutput(line3), SlotOutput(line4)],
        )
    }

    /// The first lines as analog inputs, the others left floating. Sets the ADC up, which takes some
    /// 15 us; should that fail, every reading will say so.
    #[must_use]
    pub fn into_analog(mut self, lines: AnalogLines) -> AnalogInputs {
        let cr = &mut self.cr;
        self.line1.into_analog(cr);
        self.line2.into_analog(cr);
        if lines == AnalogLines::Four {
            self.line3.into_analog(cr);
            self.line4.into_analog(cr);
        }
        AnalogInputs::new(self.adc, lines)
    }
}

impl ErrorType for SlotInput {
    type Error = Infallible;
}

impl InputPin for SlotInput {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        // SAFETY: reading a port's input register has no side effect.
        let levels = unsafe { (*pac::GPIOA::ptr()).idr().read().bits() };
        Ok(levels & self.0.0 != 0)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

impl ErrorType for SlotOutput {
    type Error = Infallible;
}

impl OutputPin for SlotOutput {
    fn set_high(&mut self) -> Result<(), Infallible> {
        // SAFETY: a write to the set/reset register changes the pins whose bits are set and no other,
        // in one store; the bit is that of this line, which this value alone owns.
        unsafe { (*pac::GPIOA::ptr()).bsrr().write(|w| w.bits(self.0.0)) };
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        // SAFETY: as above; the upper half takes pins low.
        unsafe {
            (*pac::GPIOA::ptr())
                .bsrr()
                .write(|w| w.bits(self.0.0 << 16))
        };
        Ok(())
    }
}
