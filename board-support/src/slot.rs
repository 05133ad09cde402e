//! Port 5, the slot: four lines that become what the module in it needs.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use stm32f1xx_hal::{
    gpio::{Cr, Floating, Input, PA0, PA1, PA2, PA3, PinState},
    pac,
};

/// The four lines, floating as after a reset until one of the methods is called.
pub struct Slot {
    pub(crate) line1: PA0<Input<Floating>>,
    pub(crate) line2: PA1<Input<Floating>>,
    pub(crate) line3: PA2<Input<Floating>>,
    pub(crate) line4: PA3<Input<Floating>>,
    pub(crate) cr: Cr<'A', false>,
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
}

impl ErrorType for SlotInput {
    type Error = Infallible;
}

impl InputPin for SlotInput {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        // SAFETY: reading a port's input register has no side effect.
        let levels = unsafe { (*pac::GPIOA::ptr()).idr().read().bits() };
        Ok(u32::from(levels) & self.0.0 != 0)
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
