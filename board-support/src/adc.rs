//! ADC1 on the slot's lines: PA0 to PA3 are its inputs 0 to 3.
//!
//! One line at a time, converted on demand and polled, so that nothing waits: the HAL's driver sits out
//! each conversion, and its calibration without a bound. Voltages are taken against the board's 3.3 V,
//! which is also the supply of what the module conditions, so drifts of the supply cancel.

use stm32f1xx_hal::pac;

use crate::{
    design::{ADC_CALIBRATION_US, ADC_SAMPLE_HALF_CYCLES, ADC_SETTLING_US},
    slot::AnalogLines,
    wait::{delay_us, within_us},
};

/// Why a line could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdcError {
    /// The line, counted from 0, is not one of the analog ones.
    NoSuchLine(u8),
    /// The converter's calibration did not end. Nothing helps but a restart.
    NotCalibrated,
    /// The conversion of this line did not end; the next call starts another.
    NotConverted(u8),
}

/// Calls for a line after which its conversion is given up. It takes 6 us, so some dozens are right.
const PATIENCE: u16 = 1_000;

/// A conversion under way.
#[derive(Clone, Copy)]
struct Conversion {
    line: u8,
    calls: u16,
}

/// The analog lines.
pub struct AnalogInputs {
    adc: pac::ADC1,
    lines: u8,
    calibrated: bool,
    under_way: Option<Conversion>,
}

impl AnalogInputs {
    /// Powers the converter up and calibrates it. Its clock is on; the lines are analog.
    pub(crate) fn new(adc: pac::ADC1, lines: AnalogLines) -> Self {
        const { assert!(ADC_SAMPLE_HALF_CYCLES == 2 * 55 + 1, "what SMPR2 is set to") };
        adc.smpr2().write(|w| {
            w.smp0().cycles55_5().smp1().cycles55_5();
            w.smp2().cycles55_5().smp3().cycles55_5()
        });
        // One conversion at a time, started by software (RM0008 11.12.3).
        adc.cr2()
            .write(|w| w.adon().enabled().exttrig().enabled().extsel().swstart());
        delay_us(ADC_SETTLING_US);
        let calibrated = calibrate(&adc);
        Self {
            adc,
            lines: match lines {
                AnalogLines::Two => 2,
                AnalogLines::Four => 4,
            },
            calibrated,
            under_way: None,
        }
    }

    /// The code of a line, counted from 0: 0 for ground to 4095 for 3.3 V. The first call starts a
    /// conversion of that line, which takes 5.7 us (6.8 us without a crystal); the call that finds it
    /// done takes its result, so that the next starts another. A call for another line meanwhile lets
    /// the conversion end, drops its result and then starts its own.
    ///
    /// # Errors
    ///
    /// `WouldBlock` while a conversion is under way, [`AdcError`] when there will be no result.
    pub fn read(&mut self, line: u8) -> nb::Result<u16, AdcError> {
        if line >= self.lines {
            return Err(nb::Error::Other(AdcError::NoSuchLine(line)));
        }
        if !self.calibrated {
            return Err(nb::Error::Other(AdcError::NotCalibrated));
        }
        let Some(conversion) = self.under_way else {
            self.start(line);
            return Err(nb::Error::WouldBlock);
        };
        if self.adc.sr().read().eoc().bit_is_set() {
            // Reading it takes EOC back (RM0008 11.12.1).
            let code = self.adc.dr().read().data().bits();
            self.under_way = None;
            if conversion.line == line {
                return Ok(code);
            }
            self.start(line);
        } else if conversion.calls >= PATIENCE {
            self.under_way = None;
            return Err(nb::Error::Other(AdcError::NotConverted(conversion.line)));
        } else {
            self.under_way = Some(Conversion {
                calls: conversion.calls + 1,
                ..conversion
            });
        }
        Err(nb::Error::WouldBlock)
    }

    fn start(&mut self, line: u8) {
        // SAFETY: the line is below 4, and a channel number of five bits is expected.
        self.adc.sqr3().write(|w| unsafe { w.sq1().bits(line) });
        self.adc.cr2().modify(|_, w| w.swstart().set_bit());
        self.under_way = Some(Conversion { line, calls: 0 });
    }
}

/// RM0008 11.4: the calibration's registers are reset, then filled.
fn calibrate(adc: &pac::ADC1) -> bool {
    adc.cr2().modify(|_, w| w.rstcal().set_bit());
    let reset = within_us(ADC_CALIBRATION_US, || {
        adc.cr2().read().rstcal().bit_is_clear()
    });
    adc.cr2().modify(|_, w| w.cal().set_bit());
    reset && within_us(ADC_CALIBRATION_US, || adc.cr2().read().cal().bit_is_clear())
}
