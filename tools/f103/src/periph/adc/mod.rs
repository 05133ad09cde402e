//! ADC1: the regular sequence, started by software, without injected channels and watchdog (RM0008 11).
//!
//! The converter is clocked by ADCCLK. Inputs are levels in millivolts against 3300 mV of VDDA. Misuse that makes
//! a real converter inaccurate without an error flag is reported: a clock above 14 MHz, a start before the
//! converter has settled, a start during calibration.
//!
//! The model also reproduces the inaccuracy. Before a calibration is complete (11.4), and within tSTAB of
//! power-up, codes are off by [`UNCALIBRATED`] and [`UNSETTLED`]. The manual gives no figures; these are far beyond
//! the accuracy of the data sheet. The sampling capacitor charges through the source's impedance and the switch
//! for the sampling time, from the level of the previous conversion. That is the circuit of equation 1 of the data
//! sheet (DS5319, ADC characteristics): RAIN < TS / (fADC x CADC x ln 2^14) - RADC for an error below a quarter of
//! a step.

mod bits;
mod sequence;

#[cfg(test)]
mod tests;

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;
use bits::{cr1, cr2, offset, sr};
use sequence::{Run, Sequence};

/// The inputs: 16 pins, the temperature sensor and the internal reference.
const CHANNELS: usize = 18;
const TEMPERATURE: usize = 16;
const REFERENCE: usize = 17;
/// The sensor at 25 degC: V25 typ. (DS5319 table 50).
const TEMPERATURE_MV: u16 = 1430;
/// VREFINT typ. (DS5319 table 12).
const REFERENCE_MV: u16 = 1200;
/// VDDA = VREF+.
const SUPPLY_MV: u32 = 3300;
/// Maximum RADC, in ohms (DS5319, ADC characteristics).
const SWITCH_OHMS: u32 = 1_000;
/// Maximum CADC, in farads (DS5319, ADC characteristics).
const CAPACITANCE: f64 = 8e-12;
/// Steps by which an uncalibrated converter reads too high.
const UNCALIBRATED: u16 = 64;
/// Steps by which a converter that has not settled reads too low.
const UNSETTLED: u16 = 128;
/// Maximum fADC (DS5319 table 46).
const MAX_HZ: u32 = 14_000_000;
/// Maximum tSTAB (DS5319 table 46).
const SETTLING: Time = Time::from_us(1);
/// tCAL in ADCCLK cycles (DS5319 table 46).
const CALIBRATION_CYCLES: u64 = 83;
/// Duration of the reset of the calibration registers. The manual gives none; a few cycles are assumed.
const RESET_CALIBRATION_CYCLES: u64 = 4;

/// ADC1.
#[derive(Clone, Debug)]
pub struct Adc {
    hz: u32,
    sr: u32,
    cr1: u32,
    cr2: u32,
    htr: u32,
    ltr: u32,
    sequence: Sequence,
    data: u16,
    levels: [u16; CHANNELS],
    source_ohms: [u32; CHANNELS],
    /// The level on the sampling capacitor after the last conversion, in millivolts.
    held: f64,
    calibrated: bool,
    /// The calibration under way began too early.
    too_early: bool,
    powered_at: Time,
    /// The bit to be cleared then, CAL or RSTCAL.
    calibration: Option<(u32, Time)>,
    run: Option<Run>,
    /// A code waits for the DMA.
    dma_request: bool,
    /// Largest error of a conversion, in LSB either way, followed by the state of the generator that picks the
    /// error (xorshift32).
    noise: u16,
    random: u32,
}

impl Default for Adc {
    /// Returns a converter out of reset, without a clock, its pins at 0 V.
    fn default() -> Self {
        let mut levels = [0; CHANNELS];
        levels[TEMPERATURE] = TEMPERATURE_MV;
        levels[REFERENCE] = REFERENCE_MV;
        Self {
            hz: 0,
            sr: 0,
            cr1: 0,
            cr2: 0,
            htr: 0xFFF,
            ltr: 0,
            sequence: Sequence::default(),
            data: 0,
            levels,
            source_ohms: [0; CHANNELS],
            held: 0.0,
            calibrated: false,
            too_early: false,
            powered_at: Time::ZERO,
            calibration: None,
            run: None,
            dma_request: false,
            noise: 0,
            random: 0x6D6F_6469,
        }
    }
}

impl Adc {
    /// Adds an error of up to `lsb` either way to every conversion from now on. The errors are the same in every run.
    pub fn set_noise(&mut self, lsb: u16) {
        self.noise = lsb;
    }

    /// Returns `code` with the noise added.
    fn with_noise(&mut self, code: u16) -> u16 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        let most = u32::from(self.noise);
        let off = (self.random % (2 * most + 1)) as u16;
        (code + off).saturating_sub(self.noise).min(4095)
    }

    /// Sets the voltage at the pin of `channel`, 0 to 15, to `millivolts` from `now` on. Any other channel is
    /// ignored.
    pub fn set_millivolts(&mut self, channel: usize, millivolts: u16, now: Time) {
        self.advance(now);
        if channel < TEMPERATURE {
            self.levels[channel] = millivolts;
        }
    }

    /// Sets the impedance of the source that drives `channel`, 0 to 15, to `ohms` from `now` on. Any other channel
    /// is ignored.
    pub fn set_source_ohms(&mut self, channel: usize, ohms: u32, now: Time) {
        self.advance(now);
        if channel < TEMPERATURE {
            self.source_ohms[channel] = ohms;
        }
    }

    /// Returns the code of the conversion `run`, sampled up to its end: the nearest of 4096 steps (11.1; the last
    /// step saturates).
    fn convert(&mut self, run: &Run) -> u16 {
        let channel = run.channel;
        let internal = channel >= TEMPERATURE;
        if internal && self.cr2 & cr2::TSVREFE == 0 {
            return 0;
        }
        let level = f64::from(self.levels.get(channel).copied().unwrap_or(0));
        let ohms = self.source_ohms.get(channel).copied().unwrap_or(0) + SWITCH_OHMS;
        let constants = run.sample_seconds() / (f64::from(ohms) * CAPACITANCE);
        self.held = level + (self.held - level) * (-constants).exp();
        let code = (self.held * 4096.0 / f64::from(SUPPLY_MV)).round() as u16;
        let code = if self.calibrated {
            code
        } else {
            code + UNCALIBRATED
        };
        let settled = run.sample_end() >= self.powered_at + SETTLING;
        let code = if settled {
            code
        } else {
            code.saturating_sub(UNSETTLED)
        };
        code.min(4095)
    }

    fn start(&mut self, now: Time) -> Result<(), Unmodelled> {
        let scanned = if self.cr1 & cr1::SCAN != 0 {
            self.sequence.length()
        } else {
            1
        };
        self.run = Some(Run::start(&self.sequence, self.hz, now));
        self.sr |= sr::STRT;
        let internal = (0..scanned).any(|rank| self.sequence.channel(rank) >= TEMPERATURE);
        if self.hz > MAX_HZ {
            Err(Unmodelled("ADC conversion with ADCCLK above 14 MHz"))
        } else if now < self.powered_at + SETTLING {
            Err(Unmodelled("ADC conversion within 1 us of power-up (tSTAB)"))
        } else if self.calibration.is_some() {
            Err(Unmodelled("ADC conversion during calibration"))
        } else if internal && self.cr2 & cr2::TSVREFE == 0 {
            Err(Unmodelled(
                "ADC conversion of an internal channel without TSVREFE",
            ))
        } else {
            Ok(())
        }
    }

    fn calibrate(&mut self, bit: u32, cycles: u64, now: Time) -> Result<(), Unmodelled> {
        self.calibration = Some((bit, now + Time::cycles(cycles, self.hz)));
        self.calibrated = false;
        let settled = self.powered_at + Time::cycles(2, self.hz);
        self.too_early = self.cr2 & cr2::ADON == 0 || now < settled;
        if self.too_early {
            // 11.4, note 2.
            return Err(Unmodelled("ADC calibration within two cycles of power-up"));
        }
        Ok(())
    }

    fn write_cr2(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        let value = value & cr2::MASK;
        let old = std::mem::replace(&mut self.cr2, value & !cr2::SWSTART);
        // Software cannot clear a calibration bit; hardware clears it at the end of the calibration (11.12.3).
        let running = self.calibration.map_or(0, |(bit, _)| bit);
        self.cr2 |= running;
        if value & cr2::ADON == 0 {
            self.run = None;
            self.calibration = None;
            self.cr2 &= !(cr2::CAL | cr2::RSTCAL);
        } else if old & cr2::ADON == 0 {
            // 11.4: the converter has to be calibrated after each power-up.
            self.calibrated = false;
            self.powered_at = now;
        }
        if value & !cr2::MODELLED != 0 {
            return Err(Unmodelled(
                "ADC injected channels or external trigger (CR2)",
            ));
        }
        let fresh = value & !running;
        if fresh & cr2::RSTCAL != 0 {
            return self.calibrate(cr2::RSTCAL, RESET_CALIBRATION_CYCLES, now);
        }
        if fresh & cr2::CAL != 0 {
            return self.calibrate(cr2::CAL, CALIBRATION_CYCLES, now);
        }
        if value & cr2::SWSTART != 0 {
            let by_software = cr2::EXTTRIG | cr2::EXTSEL;
            if value & by_software != by_software || value & cr2::ADON == 0 {
                return Err(Unmodelled(
                    "ADC SWSTART without ADON, EXTTRIG and EXTSEL = SWSTART: no conversion starts",
                ));
            }
            return self.start(now);
        }
        // 11.12.3: writing ADON as 1 again, with no other bit changed, starts a conversion.
        if old & cr2::ADON != 0 && value == old {
            return self.start(now);
        }
        Ok(())
    }

    /// Ends the conversion under way.
    fn finish(&mut self, mut run: Run) {
        let code = run.sampled.take().unwrap_or(0);
        self.data = if self.cr2 & cr2::ALIGN == 0 {
            code
        } else {
            code << 4
        };
        // 11.8: each conversion of a sequence requests a transfer.
        self.dma_request = self.cr2 & cr2::DMA != 0;
        let scan = self.cr1 & cr1::SCAN != 0;
        let last = !scan || run.rank + 1 >= self.sequence.length();
        if last {
            // 11.12.1: EOC is set at the end of the group.
            self.sr |= sr::EOC;
        }
        self.run = if !last {
            run.next(&self.sequence, run.rank + 1);
            Some(run)
        } else if self.cr2 & cr2::CONT != 0 {
            run.next(&self.sequence, 0);
            Some(run)
        } else {
            None
        };
    }
}

impl Peripheral for Adc {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            offset::SR => self.sr,
            offset::CR1 => self.cr1,
            offset::CR2 => self.cr2,
            offset::SMPR1 => self.sequence.smpr[0],
            offset::SMPR2 => self.sequence.smpr[1],
            offset::HTR => self.htr,
            offset::LTR => self.ltr,
            offset::SQR1 => self.sequence.sqr[0],
            offset::SQR2 => self.sequence.sqr[1],
            offset::SQR3 => self.sequence.sqr[2],
            offset::DR => {
                self.sr &= !sr::EOC;
                self.dma_request = false;
                u32::from(self.data)
            }
            _ => return Err(Unmodelled("ADC register")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            offset::SR => self.sr &= value,
            offset::CR1 => {
                self.cr1 = value & cr1::MASK;
                if self.cr1 & !(cr1::EOCIE | cr1::SCAN | cr1::IDLE) != 0 {
                    return Err(Unmodelled(
                        "ADC watchdog, injected, discontinuous or dual mode (CR1)",
                    ));
                }
            }
            offset::CR2 => return self.write_cr2(value, now),
            offset::SMPR1 => self.sequence.smpr[0] = value & 0x00FF_FFFF,
            offset::SMPR2 => self.sequence.smpr[1] = value & 0x3FFF_FFFF,
            // Thresholds of the watchdog, which is off.
            offset::HTR => self.htr = value & 0xFFF,
            offset::LTR => self.ltr = value & 0xFFF,
            offset::SQR1 => self.sequence.sqr[0] = value & 0x00FF_FFFF,
            offset::SQR2 => self.sequence.sqr[1] = value & 0x3FFF_FFFF,
            offset::SQR3 => self.sequence.sqr[2] = value & 0x3FFF_FFFF,
            offset::DR => {}
            _ => return Err(Unmodelled("ADC register")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        // Only an interrupt and a transfer are events; everything else is calculated when a register is read.
        let interrupts = self.cr1 & cr1::EOCIE != 0 && self.sr & sr::EOC == 0;
        let waits = interrupts || self.cr2 & cr2::DMA != 0;
        self.run.filter(|_| waits).map(|run| run.end())
    }

    fn advance(&mut self, now: Time) {
        if let Some((bit, end)) = self.calibration
            && end <= now
        {
            self.calibration = None;
            self.calibrated = bit == cr2::CAL && !self.too_early;
            self.cr2 &= !bit;
        }
        while let Some(mut run) = self.run {
            if run.sampled.is_none() {
                if now < run.sample_end() {
                    return;
                }
                let code = self.convert(&run);
                run.sampled = Some(self.with_noise(code));
                self.run = Some(run);
            }
            if now < run.end() {
                return;
            }
            self.finish(run);
        }
    }

    fn dma_requests(&self) -> [bool; 2] {
        [self.dma_request, false]
    }

    fn irq(&self) -> bool {
        self.cr1 & cr1::EOCIE != 0 && self.sr & sr::EOC != 0
    }

    fn reset(&mut self, _now: Time) {
        *self = Self {
            hz: self.hz,
            levels: self.levels,
            noise: self.noise,
            random: self.random,
            source_ohms: self.source_ohms,
            held: self.held,
            ..Self::default()
        };
    }

    /// Sets ADCCLK. A conversion under way keeps its clock.
    fn set_clock(&mut self, hz: u32, _now: Time) {
        self.hz = hz;
    }
}
