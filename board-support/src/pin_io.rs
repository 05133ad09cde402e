//! Pins from the board's descriptor as pins of embedded-hal.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

use crate::pin::{Mode, Pin};

/// A pin as an input or as a push-pull output. An input is pulled to the level that is set.
pub struct IoPin(Pin);

/// Call these in `init`, before the first interrupt.
impl IoPin {
    /// Makes a pin an input with pull-up.
    pub(crate) fn pulled_up(pin: Pin) -> Self {
        pin.pull_up();
        Self(pin)
    }

    /// Makes a pin an output that is low from the start, with the slowest edges.
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

impl ErrorType for IoPin {
    type Error = Infallible;
}

impl InputPin for IoPin {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.is_high())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(!self.0.is_high())
    }
}

impl OutputPin for IoPin {
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }
}
