//! The part's own DAC, on PA4 and PA5, which only parts of high density have.

use stm32f1xx_hal::pac;

use crate::{
    boards::{BOARD, PortKind},
    fitted::{self, Fitted},
    pin::{Mode, Pin},
};

/// EN and BOFF of both channels (RM0008 12.5.1). With its buffer an output does not reach 0 V.
const ON: u32 = 0b11 | 0b11 << 16;

/// The DAC.
pub struct OwnDac {
    dac: pac::DAC,
    _fitted: <fitted::OwnDac as Fitted>::Proof,
}

impl OwnDac {
    /// Returns the DAC, off, if the board uses it.
    pub(crate) fn new(dac: pac::DAC, rcc: &mut pac::RCC) -> Option<Self> {
        let proof = fitted::OwnDac::proof()?;
        // The HAL has it for parts of high density only.
        rcc.apb1enr().modify(|_, w| w.dacen().set_bit());
        rcc.apb1rstr().modify(|_, w| w.dacrst().set_bit());
        rcc.apb1rstr().modify(|_, w| w.dacrst().clear_bit());
        // The pins must not load the outputs with their digital inputs (RM0008 12.3.1).
        Pin::a(4).configure(Mode::Analog);
        Pin::a(5).configure(Mode::Analog);
        Some(Self {
            dac,
            _fitted: proof,
        })
    }

    /// Drives the outputs of a port with these codes of its channels. The first call turns the DAC on.
    pub fn write(&mut self, slot: usize, codes: [u16; 4]) {
        let Some(slot) = BOARD.slots.get(slot) else {
            return;
        };
        let lines = match slot.kind {
            PortKind::AnalogOutputs(_) => slot.lines,
            PortKind::Analog(analog) => {
                let ([first, second, ..], [third, fourth]) = (slot.lines, analog.outputs);
                [first, second, third, fourth]
            }
            _ => return,
        };
        for (line, (pin, code)) in lines.into_iter().zip(codes).enumerate() {
            let code = slot.kind.to_converter(line, code);
            match pin.dac_output() {
                Some(0) => {
                    let register = self.dac.dhr12r1();
                    // SAFETY: a code has 12 bits.
                    register.write(|w| unsafe { w.bits(code.into()) });
                }
                Some(_) => {
                    let register = self.dac.dhr12r2();
                    // SAFETY: a code has 12 bits.
                    register.write(|w| unsafe { w.bits(code.into()) });
                }
                None => continue,
            }
        }
        // SAFETY: sets defined bits. Without a trigger a code reaches the output after one cycle of APB1.
        self.dac.cr().write(|w| unsafe { w.bits(ON) });
    }
}
