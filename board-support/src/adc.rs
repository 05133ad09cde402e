//! ADC1, which samples the analog lines of all slots. Once per scan the [`Sampler`] converts every line in use and
//! stores the codes; [`AnalogInputs`] reads them.
//!
//! Software starts each conversion and polls for its end a limited number of times. The HAL's driver is not used,
//! because it polls a conversion and the calibration without a limit. Voltages are relative to the board's 3.3 V.
//! The same 3.3 V supplies the signal conditioning of the module, so supply drift cancels out.

use core::sync::atomic::{AtomicU16, Ordering::Relaxed};

use stm32f1xx_hal::pac;

use crate::{
    design::{ADC_CALIBRATION_US, ADC_LOOKS, ADC_SAMPLE_HALF_CYCLES, ADC_SETTLING_US},
    pin::Pin,
    wait::{delay_us, within_us},
};

/// Inputs of ADC1 on pins.
const INPUTS: usize = 16;

/// The newest code of each input, or [`NONE`] or [`FAILED`]. Only the scan task writes and reads these values.
static SAMPLES: [AtomicU16; INPUTS] = [const { AtomicU16::new(NONE) }; INPUTS];
/// No new code since the last read.
const NONE: u16 = 0xFFFF;
/// The converter does not work; there is no code until the next start.
const FAILED: u16 = 0xFFFE;

/// Error when the calibration of the converter did not end. The converter does not work until the next restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotCalibrated;

/// The analog lines of a slot.
pub struct AnalogInputs {
    /// ADC input number of each line, 0 to 15.
    inputs: [u8; 4],
    /// Number of analog lines, counted from line 1.
    count: u8,
}

impl AnalogInputs {
    pub(crate) fn new(lines: [Pin; 4], count: u8) -> Self {
        Self {
            // `Descriptor::check` has verified that every line of a slot has an ADC input.
            inputs: lines.map(|line| line.adc_input().unwrap_or_default()),
            count,
        }
    }

    /// Returns the code of a line, counted from 0, if it was sampled since the last call: 0 for ground to 4095 for
    /// 3.3 V.
    ///
    /// # Errors
    ///
    /// `WouldBlock` when there is no new code, [`NotCalibrated`] when the converter does not work.
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

/// The converter and the list of inputs to sample.
pub struct Sampler {
    adc: pac::ADC1,
    /// Inputs in use, input 0 in bit 0.
    used: u16,
}

impl Sampler {
    /// The ADC's clock must be on. The converter is powered up by the first call of [`serve`](Self::serve).
    pub(crate) const fn new(adc: pac::ADC1) -> Self {
        Self { adc, used: 0 }
    }

    /// Adds the analog lines of a slot. The first call powers the converter up and calibrates it, which takes about
    /// 15 us. If the calibration fails, every reading returns [`NotCalibrated`].
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

    /// Samples every line in use once: 5.7 us each, 6.8 us without a crystal. If a conversion has not ended after
    /// [`ADC_LOOKS`] polls, this call stops there and skips the remaining lines.
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
        // A new sequence aborts a conversion that has not ended (RM0008 11.3.3). Reading DR discards the result of
        // a conversion that ended too late.
        // SAFETY: an input is below 16, and the field takes channel numbers of five bits.
        self.adc.sqr3().write(|w| unsafe { w.sq1().bits(input) });
        let _ = self.adc.dr().read();
        self.adc.cr2().modify(|_, w| w.swstart().set_bit());
        for _ in 0..ADC_LOOKS {
            if self.adc.sr().read().eoc().bit_is_set() {
                // Reading DR also clears EOC (RM0008 11.12.1).
                return Some(self.adc.dr().read().data().bits());
            }
        }
        None
    }

    /// Powers the converter up and calibrates it. Returns whether the calibration succeeded.
    fn power_up(&mut self) -> bool {
        const {
            assert!(
                ADC_SAMPLE_HALF_CYCLES == 2 * 55 + 1,
                "CYCLES_55_5 below is for this sampling time"
            )
        };
        /// Sampling time code for 55.5 cycles in each of the ten 3-bit fields of a register (RM0008 11.12.4 and
        /// 11.12.5).
        const CYCLES_55_5: u32 = 0o5_555_555_555;
        // SAFETY: each field of three bits takes any value.
        self.adc.smpr2().write(|w| unsafe { w.bits(CYCLES_55_5) });
        // SAFETY: as above; this register has eight of these fields.
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

    /// Calibrates the converter: resets the calibration registers, then runs the calibration (RM0008 11.4). Returns
    /// whether both ended in time.
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
