//! Where an analog input's codes come from.

use crate::Code;

/// A 12-bit analog-to-digital converter with one input for each line of the slot.
///
/// embedded-hal 0.2 had a trait for this (`OneShot`), embedded-hal 1 has none, so here is ours, polled
/// in the manner of embedded-hal-nb.
pub trait AnalogSource {
    /// What can go wrong in the converter.
    type Error;

    /// The code of a slot line, 0 to 3: 0 for ground, 4095 for the reference.
    ///
    /// A converter that runs by itself, filling a buffer by DMA, answers at once and every line is
    /// sampled once a millisecond. One that converts on demand starts a conversion at the first call
    /// and is asked again for the same line, in this scan or the next, until it has an answer. A
    /// driver makes at most [`POLLS_PER_SCAN`](crate::POLLS_PER_SCAN) calls in a scan, so a call must
    /// return within a fraction of a microsecond and never wait.
    ///
    /// # Errors
    ///
    /// `WouldBlock` while the conversion goes on; `Other` when it failed, after which the next call
    /// may be for another line.
    fn read(&mut self, line: u8) -> nb::Result<Code, Self::Error>;
}

impl<S: AnalogSource + ?Sized> AnalogSource for &mut S {
    type Error = S::Error;

    fn read(&mut self, line: u8) -> nb::Result<Code, Self::Error> {
        S::read(self, line)
    }
}
