//! The clock tree: 72 MHz from the crystal, or 60 MHz from the internal oscillator when the crystal does not
//! start, or has failed too often since power-on.
//!
//! The HAL would wait without end for a dead crystal, or for a PLL that does not lock, and it panics over
//! frequencies that it does not accept. Here every wait has an end and the frequencies are constants. While it
//! runs on the crystal, the clock security system watches it (RM0008 7.2.7).

use stm32f1xx_hal::pac;

use crate::design::{HSE_HZ, HSE_READY_LOOKS, PLL_READY_LOOKS, SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ};

/// What the core runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// The crystal: 72 MHz.
    Crystal,
    /// The internal oscillator, -2 to +2.5 % (DS5319 table 24): 60 MHz. The crystal is missing or not reliable.
    Internal,
}

impl ClockSource {
    /// Whether the crystal runs.
    #[must_use]
    pub const fn is_crystal(self) -> bool {
        matches!(self, Self::Crystal)
    }

    /// The core's clock in Hz, which is that of APB2 and of all timers as well.
    #[must_use]
    pub const fn core_hz(self) -> u32 {
        match self {
            Self::Crystal => SYSCLK_ON_HSE_HZ,
            Self::Internal => SYSCLK_ON_HSI_HZ,
        }
    }

    /// The same in whole MHz.
    #[must_use]
    pub const fn core_mhz(self) -> u8 {
        (self.core_hz() / 1_000_000) as u8
    }

    /// The clock of APB1 in Hz: half the core's.
    #[must_use]
    pub const fn apb1_hz(self) -> u32 {
        self.core_hz() / 2
    }
}

/// PLLMUL for a multiple of the PLL's source: 0 for twice (RM0008 7.3.2).
const fn multiplier(source_hz: u32, hz: u32) -> u8 {
    assert!(hz.is_multiple_of(source_hz) && hz / source_hz >= 2 && hz / source_hz <= 16);
    (hz / source_hz - 2) as u8
}

const ON_CRYSTAL: u8 = multiplier(HSE_HZ, SYSCLK_ON_HSE_HZ);
/// The internal oscillator feeds the PLL at half its 8 MHz.
const ON_INTERNAL: u8 = multiplier(4_000_000, SYSCLK_ON_HSI_HZ);

/// Starts the clocks, whatever state they are in. `crystal`: whether to try the crystal.
pub(crate) fn start(rcc: &pac::RCC, flash: &pac::FLASH, crystal: bool) -> ClockSource {
    // Two wait states, for more than 48 MHz (RM0008 3.3.3), and the prefetch that makes up for them.
    // SAFETY: two is a defined number of wait states.
    flash
        .acr()
        .modify(|_, w| unsafe { w.latency().bits(2).prftbe().set_bit() });
    to_internal_without_pll(rcc);
    if crystal && crystal_starts(rcc) {
        if pll_runs(rcc, ClockSource::Crystal) {
            // From here on a crystal that fails raises the NMI.
            rcc.cr().modify(|_, w| w.csson().set_bit());
            return ClockSource::Crystal;
        }
        to_internal_without_pll(rcc);
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    if !pll_runs(rcc, ClockSource::Internal) {
        // Nothing outside the chip could cause this. Nothing else can be done about it either.
        crate::restart();
    }
    ClockSource::Internal
}

/// As after a reset. A debugger or a boot loader may have left it otherwise, and the PLL takes its
/// settings only while it is off.
fn to_internal_without_pll(rcc: &pac::RCC) {
    rcc.cr().modify(|_, w| w.hsion().set_bit());
    looked(PLL_READY_LOOKS, || rcc.cr().read().hsirdy().bit_is_set());
    rcc.cfgr().modify(|_, w| w.sw().hsi());
    looked(PLL_READY_LOOKS, || rcc.cfgr().read().sws().is_hsi());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    // The PLL still runs for a while, and its settings may not be written before it is off (RM0008 7.3.2).
    looked(PLL_READY_LOOKS, || rcc.cr().read().pllrdy().bit_is_clear());
}

fn crystal_starts(rcc: &pac::RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let ready = looked(HSE_READY_LOOKS, || rcc.cr().read().hserdy().bit_is_set());
    if !ready {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    ready
}

/// Sets the PLL and the dividers up for a source and goes over to it.
fn pll_runs(rcc: &pac::RCC, source: ClockSource) -> bool {
    rcc.cfgr().write(|w| {
        match source {
            // SAFETY: both multipliers are of four bits, by `multiplier`.
            ClockSource::Crystal => unsafe {
                w.pllsrc().hse_div_prediv().pllmul().bits(ON_CRYSTAL)
            },
            // SAFETY: as above.
            ClockSource::Internal => unsafe { w.pllsrc().hsi_div2().pllmul().bits(ON_INTERNAL) },
        };
        w.ppre1().div2().adcpre().div6()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    if !looked(PLL_READY_LOOKS, || rcc.cr().read().pllrdy().bit_is_set()) {
        return false;
    }
    rcc.cfgr().modify(|_, w| w.sw().pll());
    looked(PLL_READY_LOOKS, || rcc.cfgr().read().sws().is_pll())
}

/// Looks up to `looks` times whether something is so.
fn looked(looks: u32, mut is_so: impl FnMut() -> bool) -> bool {
    (0..looks).any(|_| is_so())
}
