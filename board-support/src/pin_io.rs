//! Pins from the board's descriptor as pins of embedded-hal.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};

use crate::{
    boards::BOARD,
    pin::{Mode, Pin},
};

/// A pin as an input or as a push-pull output. An input is pulled to the level that is set. [`Pin::NONE`] is always high.
pub struct IoPin(Pin);

/// Some channels of ports have no pin.
pub(crate) const LACKS: bool = BOARD.lacks_channels();

/// Call these in `init`, before the first interrupt.
impl IoPin {
    /// Makes a pin an input with pull-up.
    pub(crate) fn pulled_up(pin: Pin) -> Self {
        let io = Self(pin);
        if io.exists() {
            pin.pull_up();
        }
        io
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
        let io = Self(pin);
        if io.exists() {
            pin.set(high);
            pin.configure(Mode::Output);
        }
        io
    }

    #[inline(always)]
    const fn exists(&self) -> bool {
        !LACKS || !self.0.is_none()
    }
}

impl ErrorType for IoPin {
    type Error = Infallible;
}

impl InputPin for IoPin {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(!self.exists() || self.0.is_high())
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        self.is_high().map(|high| !high)
    }
}

impl OutputPin for IoPin {
    fn set_high(&mut self) -> Result<(), Infallible> {
        if self.exists() {
            self.0.set(true);
        }
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        if self.exists() {
            self.0.set(false);
        }
        Ok(())
    }
}
