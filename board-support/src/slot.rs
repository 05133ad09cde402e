//! The four lines of a slot, configured for the module in it. They float, as after a reset, until one of the methods is
//! called; an empty slot leaves them floating.

use core::array;

use crate::{IoPin, boards::SlotPins, pin::Mode, pin_io::LACKS};

/// Call one of these once, in `init`, before the first interrupt.
impl SlotPins {
    /// Makes the first `inputs` lines inputs with pull-ups, and the others outputs that are low from the start, with the
    /// slowest edges: relays and open collectors need no fast ones.
    #[must_use]
    #[inline(never)]
    pub fn digital(&self, inputs: usize) -> [IoPin; 4] {
        array::from_fn(|line| {
            let make = if line < inputs {
                IoPin::pulled_up
            } else {
                IoPin::low
            };
            make(self.lines[line])
        })
    }

    /// Makes the first `count` lines analog inputs and leaves the others floating. Returns their inputs of the ADC.
    #[must_use]
    pub fn analog(&self, count: usize) -> [Option<u8>; 4] {
        let mut inputs = [None; 4];
        for (line, input) in self.lines.iter().zip(&mut inputs).take(count) {
            if !LACKS || !line.is_none() {
                line.configure(Mode::Analog);
            }
            *input = line.adc_input();
        }
        inputs
    }
}
