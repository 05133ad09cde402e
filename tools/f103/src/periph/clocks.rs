//! The clock tree as a calculation: from RCC_CFGR to the frequency of every bus (RM0008 figure 8, 7.3.2).

use crate::time::Time;

/// Typical frequency of the internal oscillator (HSI), in Hz.
pub const HSI_HZ: u32 = 8_000_000;
/// Frequency of the usual crystal (HSE), in Hz.
pub const HSE_HZ: u32 = 8_000_000;

/// Maximum SYSCLK in Hz (RM0008 7.2), plus the 100 ppm by which a crystal may be fast.
pub const MAX_SYSCLK: u32 = 72_000_000 + 72_000_000 / 10_000;

/// Returns the highest SYSCLK in Hz that is allowed with this number of wait states (RM0008 3.3.3), with the tolerance
/// of the crystal.
#[must_use]
pub const fn highest_sysclk(wait_states: u32) -> u32 {
    match wait_states {
        0 => 24_000_000,
        1 => 48_000_000,
        _ => MAX_SYSCLK,
    }
}

/// The part's oscillators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Oscillators {
    /// The HSI in Hz.
    pub hsi: u32,
    /// The HSE in Hz.
    pub hse: u32,
    /// The LSI in Hz.
    pub lsi: u32,
    /// Time from HSEON to HSERDY.
    pub hse_start: Time,
}

impl Oscillators {
    /// Typical oscillators: the start-up of the crystal by DS5319 table 22, the LSI by table 25.
    pub const TYPICAL: Self = Self {
        hsi: HSI_HZ,
        hse: HSE_HZ,
        lsi: 40_000,
        hse_start: Time::from_us(2_000),
    };

    /// Returns the same oscillators with a crystal of nominally `hz`. Its error in parts per million is the error
    /// of this crystal against [`HSE_HZ`].
    #[must_use]
    pub const fn with_crystal(self, hz: u32) -> Self {
        let hse = self.hse as u64 * hz as u64 / HSE_HZ as u64;
        Self {
            hse: hse as u32,
            ..self
        }
    }
}

/// The frequencies, in Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// SYSCLK, at most 72 MHz.
    pub sysclk: u32,
    /// HCLK: the core, the memories, SysTick.
    pub hclk: u32,
    /// PCLK1: USART3, I2C1, ..., at most 36 MHz.
    pub pclk1: u32,
    /// PCLK2: USART1, GPIO, ..., at most 72 MHz.
    pub pclk2: u32,
    /// TIM2 to TIM4: PCLK1, twice that when APB1 is divided.
    pub apb1_timers: u32,
    /// TIM1: PCLK2, twice that when APB2 is divided.
    pub apb2_timers: u32,
    /// ADCCLK, at most 14 MHz.
    pub adc: u32,
}

impl Clocks {
    /// The frequencies after SYSCLK's source has failed without a replacement.
    pub const STOPPED: Self = Self {
        sysclk: 0,
        hclk: 0,
        pclk1: 0,
        pclk2: 0,
        apb1_timers: 0,
        apb2_timers: 0,
        adc: 0,
    };

    /// Returns the clocks with `cfgr` in RCC_CFGR and `sws` as the clock in use (0 HSI, 1 HSE, 2 PLL).
    #[must_use]
    pub const fn of(cfgr: u32, sws: u32, oscillators: &Oscillators) -> Self {
        let sysclk = match sws {
            0 => oscillators.hsi,
            1 => oscillators.hse,
            _ => pll(cfgr, oscillators),
        };
        let hclk = sysclk >> ahb_shift(cfgr >> 4 & 0xF);
        let apb1 = apb_shift(cfgr >> 8 & 7);
        let apb2 = apb_shift(cfgr >> 11 & 7);
        let (pclk1, pclk2) = (hclk >> apb1, hclk >> apb2);
        Self {
            sysclk,
            hclk,
            pclk1,
            pclk2,
            apb1_timers: pclk1 << (apb1 != 0) as u32,
            apb2_timers: pclk2 << (apb2 != 0) as u32,
            adc: pclk2 / (2 * ((cfgr >> 14 & 3) + 1)),
        }
    }

    /// Names the clock that is above the part's limits (RM0008 7.2); `None` when all are within them.
    #[must_use]
    pub const fn over_limit(&self) -> Option<&'static str> {
        if self.sysclk > MAX_SYSCLK {
            Some("SYSCLK above 72 MHz")
        } else if self.pclk1 > MAX_SYSCLK / 2 {
            Some("PCLK1 above 36 MHz")
        } else {
            None
        }
    }
}

const fn pll(cfgr: u32, oscillators: &Oscillators) -> u32 {
    let source = if cfgr & 1 << 16 == 0 {
        oscillators.hsi / 2
    } else if cfgr & 1 << 17 == 0 {
        oscillators.hse
    } else {
        oscillators.hse / 2
    };
    let times = (cfgr >> 18 & 0xF) + 2;
    source * if times > 16 { 16 } else { times }
}

/// HPRE: 0xxx undivided, then 2, 4, 8, 16, 64, 128, 256, 512.
const fn ahb_shift(hpre: u32) -> u32 {
    match hpre {
        0..=7 => 0,
        8..=11 => hpre - 7,
        _ => hpre - 6,
    }
}

/// PPRE: 0xx undivided, then 2, 4, 8, 16.
const fn apb_shift(ppre: u32) -> u32 {
    if ppre < 4 { 0 } else { ppre - 3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(cfgr: u32, sws: u32) -> Clocks {
        Clocks::of(cfgr, sws, &Oscillators::TYPICAL)
    }

    #[test]
    fn prescalers_divide_as_rm0008_says() {
        let divided = of(0b1100 << 4 | 0b100 << 8 | 0b111 << 11 | 0b11 << 14, 0);
        assert_eq!(divided.hclk, 8_000_000 / 64);
        assert_eq!(divided.pclk1, divided.hclk / 2);
        assert_eq!(divided.apb1_timers, divided.hclk);
        assert_eq!(divided.pclk2, divided.hclk / 16);
        assert_eq!(divided.adc, divided.pclk2 / 8);
        assert_eq!(of(0b1111 << 4, 0).hclk, 8_000_000 / 512);
    }

    #[test]
    fn the_pll_multiplies_its_source() {
        assert_eq!(of(0b1110 << 18, 2).sysclk, 64_000_000, "HSI/2 x16");
        assert_eq!(of(1 << 16 | 7 << 18, 2).sysclk, 72_000_000);
        assert_eq!(
            of(1 << 16 | 14 << 18, 2).over_limit(),
            Some("SYSCLK above 72 MHz")
        );
    }
}
