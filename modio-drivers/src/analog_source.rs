//! The source of an analog input's codes.

use crate::Code;

/// A 12-bit analog-to-digital converter with one input for each line of the slot.
///
/// embedded-hal 0.2 had a trait for this (`OneShot`) and embedded-hal 1 has none. This trait is polled like those
/// of embedded-hal-nb.
pub trait AnalogSource {
    /// Error of the converter.
    type Error;

    /// Returns the code of a slot line, 0 to 3: 0 for ground, 4095 for the reference.
    ///
    /// A converter that runs continuously and fills a buffer by DMA answers immediately; then every line is sampled
    /// once per millisecond. A converter that converts on demand starts a conversion at the first call, and is
    /// called again for the same line, in this scan or the next, until it has an answer. A driver makes at most
    /// [`POLLS_PER_SCAN`](crate::POLLS_PER_SCAN) calls in a scan, so a call must return within a fraction of a
    /// microsecond and must not wait.
    ///
    /// # Errors
    ///
    /// `WouldBlock` while the conversion is running; `Other` when it failed. After that the next call may be for
    /// another line.
    fn read(&mut self, line: u8) -> nb::Result<Code, Self::Error>;
}

impl<S: AnalogSource + ?Sized> AnalogSource for &mut S {
    type Error = S::Error;

    fn read(&mut self, line: u8) -> nb::Result<Code, Self::Error> {
        S::read(self, line)
    }
}
