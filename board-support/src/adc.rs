//! ADC1, which serves the analog lines of all slots: once a scan the [`Sampler`] converts every line in use and leaves
//! the codes where [`AnalogInputs`] takes them from.
//!
//! Each conversion is started by software and polled with a bound: the HAL's driver sits out each conversion, and its
//! calibration, without one. Voltages are taken against the board's 3.3 V, which is also the supply of what the module
//! conditions, so drifts of the supply cancel.

use core::sync::atomic::{AtomicU16, Ordering::Relaxed};

use stm32f1xx_hal::pac;

use crate::{
    design::{ADC_CALIBRATION_US, ADC_LOOKS, ADC_SAMPLE_HALF_CYCLES, ADC_SETTLING_US},
    pin::Pin,
    wait::{delay_us, within_us},
};

/// Inputs of ADC1 on pins.
const INPUTS: usize = 16;

/// The code of each input that nobody has taken yet, or one of the two below. The scan alone writes and reads them.
static SAMPLES: [AtomicU16; INPUTS] = [const { AtomicU16::new(NONE) }; INPUTS];
/// There is no new code.
const NONE: u16 = 0xFFFF;
/// There will be no code before the next start.
const FAILED: u16 = 0xFFFE;

/// The converter does not work: its calibration did not end. Nothing helps but a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotCalibrated;

/// The analog lines of a slot.
pub struct AnalogInputs {
    /// The ADC's input for each line.
    inputs: [u8; 4],
    /// How many of them are analog.
    count: u8,
}

impl AnalogInputs {
    pub(crate) fn new(lines: [Pin; 4], count: u8) -> Self {
        Self {
            // The board's descriptor has no slot with a line that is not an input; see its check.
            inputs: lines.map(|line| line.adc_input().unwrap_or_default()),
            count,
        }
    }

    /// The code of a line, counted from 0, if it has been sampled since the last call: 0 for ground to 4095 for 3.3 V.
    ///
    /// # Errors
    ///
    /// `WouldBlock` when there is no new code, [`NotCalibrated`] when there will be none.
    pub fn read(&mut self, line: u8) -> nb::Result<u16, NotCalibrated> {
        let input = self.inputs.get(usize::from(line));
        let Some(sample) = input.and_then(|input| SAMPLES.get(usize::from(*input))) else {
            return Err(nb::Error::WouldBlock);
        };
        match sample.load(Relaxed) {
            NONE => Err(nb::Error::WouldBlock),
            FAILED => Err(nb::Error::Other(NotCalibrated)),
            code => {
                sample.store(NONE, Relaxed);
                Ok(code)
            }
        }
    }
}

/// The converter.
pub struct Sampler {
    adc: pac::ADC1,
    /// The inputs in use, input 0 in bit 0.
    used: u16,
}

impl Sampler {
    /// Its clock is on. It is powered up with the first lines that [are used](Self::serve).
    pub(crate) const fn new(adc: pac::ADC1) -> Self {
        Self { adc, used: 0 }
    }

    /// Takes up the lines of a slot. The first time powers the converter up and calibrates it, which takes some
    /// 15 us; should that fail, every reading will say so.
    pub fn serve(&mut self, lines: &AnalogInputs) {
        if self.used == 0 && !self.power_up() {
            SAMPLES
                .iter()
                .for_each(|sample| sample.store(FAILED, Relaxed));
        }
        for input in lines.inputs.iter().take(lines.count.into()) {
            self.used |= 1 << (input % 16);
        }
    }

    /// Samples every line in use once: 5.7 us each (6.8 us without a crystal). A conversion that does not end is given
    /// up after [`ADC_LOOKS`], and so are those of the lines after it, until the next call.
    pub fn run(&mut self) {
        for (input, sample) in (0_u8..).zip(&SAMPLES) {
            if self.used >> input & 1 == 0 || sample.load(Relaxed) == FAILED {
                continue;
            }
            let Some(code) = self.convert(input) else {
                return;
            };
            sample.store(code, Relaxed);
        }
    }

    fn convert(&mut self, input: u8) -> Option<u16> {
        // A new sequence resets a conversion that has not ended (RM0008 11.3.3). The result of one that ended too late
        // is dropped.
        // SAFETY: an input is below 16, and a channel number of five bits is expected.
        self.adc.sqr3().write(|w| unsafe { w.sq1().bits(input) });
        let _ = self.adc.dr().read();
        self.adc.cr2().modify(|_, w| w.swstart().set_bit());
        for _ in 0..ADC_LOOKS {
            if self.adc.sr().read().eoc().bit_is_set() {
                // Reading it takes EOC back (RM0008 11.12.1).
                return Some(self.adc.dr().read().data().bits());
            }
        }
        None
    }

    /// Whether the converter works now.
    fn power_up(&mut self) -> bool {
        const {
            assert!(
                ADC_SAMPLE_HALF_CYCLES == 2 * 55 + 1,
                "what SMPR1 and SMPR2 are set to"
            )
        };
        /// 55.5 cycles, in each of a register's ten fields of three bits (RM0008 11.12.4 and 11.12.5).
        const CYCLES_55_5: u32 = 0o5_555_555_555;
        // SAFETY: each field of three bits takes any value.
        self.adc.smpr2().write(|w| unsafe { w.bits(CYCLES_55_5) });
        // SAFETY: as above; this register has eight of them.
        self.adc
            .smpr1()
            .write(|w| unsafe { w.bits(CYCLES_55_5 & 0x00FF_FFFF) });
        // One conversion at a time, started by software (RM0008 11.12.3).
        self.adc
            .cr2()
            .write(|w| w.adon().enabled().exttrig().enabled().extsel().swstart());
        delay_us(ADC_SETTLING_US);
        self.calibrate()
    }

    /// RM0008 11.4: the calibration's registers are reset, then filled.
    fn calibrate(&mut self) -> bool {
        let adc = &self.adc;
        adc.cr2().modify(|_, w| w.rstcal().set_bit());
        let reset = within_us(ADC_CALIBRATION_US, || {
            adc.cr2().read().rstcal().bit_is_clear()
        });
        adc.cr2().modify(|_, w| w.cal().set_bit());
        reset && within_us(ADC_CALIBRATION_US, || adc.cr2().read().cal().bit_is_clear())
    }
}
