//! Port 5, the slot: four lines that become what the module in it needs.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use stm32f1xx_hal::{
    gpio::{Cr, PA0, PA1, PA2, PA3},
    pac,
};

use crate::{AnalogInputs, port};

/// The four lines, floating as after a reset until one of the methods is called. A module that needs
/// none of them, or one that is not there, leaves them so.
pub struct Slot {
    _lines: (PA0, PA1, PA2, PA3),
    /// The register is shared with other pins; who has this may change it.
    _cr: Cr<'A', false>,
    adc: pac::ADC1,
}

/// How many of the slot's lines are analog inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalogLines {
    /// Lines 1 and 2.
    Two,
    /// All four.
    Four,
}

/// A slot line as an input with pull-up. The HAL's type for any pin of a port looks it up in an array,
/// with a panic for one that is not there.
pub struct SlotInput(Line);

/// A slot line as a push-pull output.
pub struct SlotOutput(Line);

/// A line's bit in the registers of port A. Only [`Slot`] makes them, one of each.
struct Line(u8);

const LINES: [Line; 4] = [Line(1 << 0), Line(1 << 1), Line(1 << 2), Line(1 << 3)];

/// All four lines' bits.
const ALL: u32 = 0b1111;

/// What the lines can be: four bits of CRL for each, line 1 lowest (RM0008 9.2.1). An input is pulled
/// up or down by its output bit. Outputs are the slowest, 2 MHz: relays and open collectors need no steep edges.
mod modes {
    pub const ALL_PULLED: u32 = 0x8888;
    pub const ALL_OUTPUTS: u32 = 0x2222;
    pub const TWO_PULLED_TWO_OUTPUTS: u32 = 0x2288;
    pub const ALL_ANALOG: u32 = 0x0000;
    pub const TWO_ANALOG: u32 = 0x4400;
    pub const MASK: u32 = 0xFFFF;
}

impl Slot {
    pub(crate) fn new(lines: (PA0, PA1, PA2, PA3), cr: Cr<'A', false>, adc: pac::ADC1) -> Self {
        Self {
            _lines: lines,
            _cr: cr,
            adc,
        }
    }

    /// Four inputs with pull-ups.
    #[must_use]
    pub fn into_inputs(mut self) -> [SlotInput; 4] {
        self.configure(modes::ALL_PULLED, ALL);
        LINES.map(SlotInput)
    }

    /// Four outputs that drive low from their first instant.
    #[must_use]
    pub fn into_outputs_low(mut self) -> [SlotOutput; 4] {
        self.configure(modes::ALL_OUTPUTS, 0);
        LINES.map(SlotOutput)
    }

    /// Lines 1 and 2 as inputs with pull-ups, lines 3 and 4 as outputs that drive low from their first
    /// instant.
    #[must_use]
    pub fn into_relay(mut self) -> ([SlotInput; 2], [SlotOutput; 2]) {
        self.configure(modes::TWO_PULLED_TWO_OUTPUTS, 0b0011);
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
        let modes = match lines {
            AnalogLines::Two => modes::TWO_ANALOG,
            AnalogLines::Four => modes::ALL_ANALOG,
        };
        self.configure(modes, 0);
        AnalogInputs::new(self.adc, lines)
    }

    /// Makes the lines what `modes` says, those in `high` pulled high, the others pulled or driven low. Only at the
    /// start, before any interrupt: see [`port`] for the owner of the register.
    fn configure(&mut self, modes: u32, high: u32) {
        drive(high, ALL & !high);
        // SAFETY: the lines' own bits, which are one of the above; the others stay.
        port::a()
            .crl()
            .modify(|r, w| unsafe { w.bits(r.bits() & !modes::MASK | modes) });
    }
}

/// Takes the output bits of some lines high and of others low, and of no other pin, in one store.
fn drive(high: u32, low: u32) {
    // SAFETY: the set/reset register takes any value (RM0008 9.2.5). Callers own their lines.
    port::a()
        .bsrr()
        .write(|w| unsafe { w.bits(high | low << 16) });
}

impl ErrorType for SlotInput {
    type Error = Infallible;
}

impl InputPin for SlotInput {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        let levels = port::a().idr().read().bits();
        Ok(levels & u32::from(self.0.0) != 0)
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
        drive(self.0.0.into(), 0);
        Ok(())
    }

    fn set_low(&mut self) -> Result<(), Infallible> {
        drive(0, self.0.0.into());
        Ok(())
    }
}
