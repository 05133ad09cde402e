//! ADC1, which samples the analog lines of all slots, once per scan.
//!
//! Software starts each conversion and polls for its end a limited number of times. Voltages are relative to the
//! board's 3.3 V. The same 3.3 V supplies the signal conditioning of the module, so supply drift cancels out.

use stm32f1xx_hal::pac;

use crate::{
    boards::SLOTS,
    design::{ADC_CALIBRATION_US, ADC_POLLS, ADC_SAMPLE_HALF_CYCLES, ADC_SETTLING_US},
    fitted::{self, Fitted},
    wait::{delay_us, within_us},
};

/// The converter and the lines to sample.
pub struct Sampler {
    adc: pac::ADC1,
    /// The ADC's input for each line of a slot, 0 to 15; `None` for a line that is not sampled.
    pub inputs: [[Option<u8>; 4]; SLOTS],
    /// The calibration has succeeded.
    calibrated: bool,
    /// Number of calls in which a conversion did not end, wrapping.
    missed: u8,
}

impl Sampler {
    /// Powers the converter up and calibrates it, which takes about 15 us. The ADC's clock must be on. If the
    /// calibration fails, there are no codes until the next start.
    pub(crate) fn new(adc: pac::ADC1) -> Self {
        let mut sampler = Self {
            adc,
            inputs: [[None; 4]; SLOTS],
            calibrated: false,
            missed: 0,
        };
        sampler.power_up();
        sampler
    }

    /// Samples every line once: 5.7 us each, 6.8 us without a crystal. Returns the codes by slot: 0 for ground to 4095
    /// for 3.3 V. If a conversion has not ended after [`ADC_POLLS`] polls, this call stops there and skips the
    /// remaining lines.
    pub fn run(&mut self) -> [[Option<u16>; 4]; SLOTS] {
        let mut codes = [[None; 4]; SLOTS];
        if fitted::Slots::proof().is_none() {
            return codes;
        }
        let inputs = self.inputs.as_flattened().iter();
        for (input, code) in inputs.zip(codes.as_flattened_mut()) {
            if let Some(input) = *input {
                *code = self.convert(input);
                if code.is_none() {
                    // A disturbance may have turned the converter off.
                    self.missed = self.missed.wrapping_add(1);
                    if self.missed == 0 {
                        self.power_up();
                    }
                    break;
                }
            }
        }
        codes
    }

    fn convert(&self, input: u8) -> Option<u16> {
        if !self.calibrated {
            return None;
        }
        // A new sequence aborts a conversion that has not ended (RM0008 11.3.3). Reading DR discards the result of
        // a conversion that ended too late.
        // SAFETY: an input is below 16, and the field takes channel numbers of five bits.
        self.adc.sqr3().write(|w| unsafe { w.sq1().bits(input) });
        let _ = self.adc.dr().read();
        self.adc.cr2().modify(|_, w| w.swstart().set_bit());
        for _ in 0..ADC_POLLS {
            if self.adc.sr().read().eoc().bit_is_set() {
                // Reading DR also clears EOC (RM0008 11.12.1).
                return Some(self.adc.dr().read().data().bits());
            }
        }
        None
    }

    fn power_up(&mut self) {
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
        self.calibrated = self.calibrate();
    }

    /// Calibrates the converter: resets the calibration registers, then runs the calibration (RM0008 11.4). Returns
    /// whether both ended in time.
    fn calibrate(&self) -> bool {
        let adc = &self.adc;
        adc.cr2().modify(|_, w| w.rstcal().set_bit());
        let reset = within_us(ADC_CALIBRATION_US, || {
            adc.cr2().read().rstcal().bit_is_clear()
        });
        adc.cr2().modify(|_, w| w.cal().set_bit());
        reset && within_us(ADC_CALIBRATION_US, || adc.cr2().read().cal().bit_is_clear())
    }
}
