//! The four lines of a slot, configured for the module in it. They float, as after a reset, until one of the methods is
//! called; an empty slot leaves them floating.

use crate::{IoPin, boards::SlotPins, pin::Mode};

/// Call one of these once, in `init`, before the first interrupt.
impl SlotPins {
    /// Makes all lines inputs with pull-ups.
    #[must_use]
    pub fn inputs(&self) -> [IoPin; 4] {
        self.lines.map(IoPin::pulled_up)
    }

    /// Makes all lines outputs that are low from the start, with the slowest edges: relays and open collectors need
    /// no fast ones.
    #[must_use]
    pub fn outputs_low(&self) -> [IoPin; 4] {
        self.lines.map(IoPin::low)
    }

    /// Makes lines 1 and 2 inputs with pull-ups, and lines 3 and 4 outputs that are low from the start.
    #[must_use]
    pub fn relay(&self) -> ([IoPin; 2], [IoPin; 2]) {
        let [line1, line2, line3, line4] = self.lines;
        (
            [line1, line2].map(IoPin::pulled_up),
            [line3, line4].map(IoPin::low),
        )
    }

    /// Makes the first `count` lines analog inputs and leaves the others floating. Returns their inputs of the ADC.
    #[must_use]
    pub fn analog(&self, count: usize) -> [Option<u8>; 4] {
        let mut inputs = [None; 4];
        for (line, input) in self.lines.iter().zip(&mut inputs).take(count) {
            line.configure(Mode::Analog);
            *input = line.adc_input();
        }
        inputs
    }
}
