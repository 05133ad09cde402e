//! Pins from the board's descriptor as inputs and outputs of embedded-hal. The HAL's type for any pin of a port is not
//! used: it looks the pin up in an array and panics when it does not exist.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

use crate::pin::{Mode, Pin};

/// A pin as an input with pull-up, or with pull-down.
pub struct PinInput(Pin);

/// A pin as a push-pull output.
pub struct PinOutput(Pin);

impl PinInput {
    /// Makes a pin an input with pull-up. Call this in `init`, before the first interrupt.
    pub(crate) fn pulled_up(pin: Pin) -> Self {
        pin.pull_up();
        Self(pin)
    }

    /// Pulls the pin up or down.
    pub fn pull(&mut self, up: bool) {
        self.0.set(up);
    }
}

impl PinOutput {
    /// Makes a pin an output that is low from the start, with the slowest edges. Call this in `init`, before the
    /// first interrupt.
    pub(crate) fn low(pin: Pin) -> Self {
        Self::starting(pin, false)
    }

    /// The same, but high from the start.
    pub(crate) fn high(pin: Pin) -> Self {
        Self::starting(pin, true)
    }

    fn starting(pin: Pin, high: bool) -> Self {
        pin.set(high);
        pin.configure(Mode::Output);
        Self(pin)
    }
}

impl ErrorType for PinInput {
    type Error = Infallible;
}

impl InputPin for PinInput {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.is_high())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.is_high())
    }
}

impl ErrorType for PinOutput {
    type Error = Infallible;
}

impl OutputPin for PinOutput {
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }
}
