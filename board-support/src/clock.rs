//! The clock tree: 72 MHz from the crystal, or 60 MHz from the internal oscillator when the crystal does not start
//! or has failed too often since power-on.
//!
//! Every wait is bounded and the frequencies are constants. While the core runs on the crystal, the clock security
//! system monitors it (RM0008 7.2.7).

use stm32f1xx_hal::pac;

use crate::design::{HSE_HZ, HSE_READY_POLLS, PLL_READY_POLLS, SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ};

/// Clock source of the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// The crystal: 72 MHz.
    Crystal,
    /// The internal oscillator, -2 to +2.5 % (DS5319 table 24): 60 MHz. The crystal is missing or not reliable.
    Internal,
}

impl ClockSource {
    /// Returns whether the core runs on the crystal.
    #[must_use]
    pub const fn is_crystal(self) -> bool {
        matches!(self, Self::Crystal)
    }

    /// Returns the core clock in Hz. APB2 and all timers run at the same frequency.
    #[must_use]
    pub const fn core_hz(self) -> u32 {
        match self {
            Self::Crystal => SYSCLK_ON_HSE_HZ,
            Self::Internal => SYSCLK_ON_HSI_HZ,
        }
    }

    /// Returns the core clock in MHz.
    #[must_use]
    pub const fn core_mhz(self) -> u8 {
        (self.core_hz() / 1_000_000) as u8
    }

    /// Returns the clock of APB1 in Hz, which is half the core clock.
    #[must_use]
    pub const fn apb1_hz(self) -> u32 {
        self.core_hz() / 2
    }
}

/// Returns PLLMUL for a multiple of the PLL's input frequency: 0 stands for a factor of 2 (RM0008 7.3.2).
const fn multiplier(source_hz: u32, hz: u32) -> u8 {
    assert!(hz.is_multiple_of(source_hz) && hz / source_hz >= 2 && hz / source_hz <= 16);
    (hz / source_hz - 2) as u8
}

const ON_CRYSTAL: u8 = multiplier(HSE_HZ, SYSCLK_ON_HSE_HZ);
/// PLLMUL for the internal oscillator, which the PLL receives at half its 8 MHz.
const ON_INTERNAL: u8 = multiplier(4_000_000, SYSCLK_ON_HSI_HZ);

/// Starts the clocks from any previous state. `crystal` says whether to try the crystal.
pub(crate) fn start(rcc: &pac::RCC, flash: &pac::FLASH, crystal: bool) -> ClockSource {
    // Two wait states, for more than 48 MHz (RM0008 3.3.3), and the prefetch buffer to compensate for them.
    // SAFETY: two is a defined number of wait states.
    flash
        .acr()
        .modify(|_, w| unsafe { w.latency().bits(2).prftbe().set_bit() });
    to_internal_without_pll(rcc);
    if crystal && crystal_starts(rcc) {
        if pll_runs(rcc, ClockSource::Crystal) {
            // From here on a crystal failure raises the NMI.
            rcc.cr().modify(|_, w| w.csson().set_bit());
            return ClockSource::Crystal;
        }
        to_internal_without_pll(rcc);
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    if !pll_runs(rcc, ClockSource::Internal) {
        // The internal oscillator and the PLL need nothing outside the chip, so only a reset can help.
        crate::restart();
    }
    ClockSource::Internal
}

/// Sets the clocks and the wait states of the flash as after a reset: the internal oscillator without PLL.
#[cfg(feature = "loader")]
pub(crate) fn as_after_reset(rcc: &pac::RCC, flash: &pac::FLASH) {
    to_internal_without_pll(rcc);
    rcc.cr()
        .modify(|_, w| w.csson().clear_bit().hseon().clear_bit());
    rcc.cfgr().reset();
    flash.acr().reset();
}

/// Switches to the internal oscillator and turns the PLL off, as after a reset. A debugger or a boot loader may
/// have left the PLL on, and its settings can only be changed while it is off.
fn to_internal_without_pll(rcc: &pac::RCC) {
    rcc.cr().modify(|_, w| w.hsion().set_bit());
    polled(PLL_READY_POLLS, || rcc.cr().read().hsirdy().bit_is_set());
    rcc.cfgr().modify(|_, w| w.sw().hsi());
    polled(PLL_READY_POLLS, || rcc.cfgr().read().sws().is_hsi());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    // The PLL keeps running for a while, and its settings must not be written before it is off (RM0008 7.3.2).
    polled(PLL_READY_POLLS, || rcc.cr().read().pllrdy().bit_is_clear());
}

fn crystal_starts(rcc: &pac::RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let ready = polled(HSE_READY_POLLS, || rcc.cr().read().hserdy().bit_is_set());
    if !ready {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    ready
}

/// Sets up the PLL and the dividers for a source and switches the core to the PLL. Returns whether that succeeded.
fn pll_runs(rcc: &pac::RCC, source: ClockSource) -> bool {
    rcc.cfgr().write(|w| {
        match source {
            // SAFETY: `multiplier` returns values of four bits.
            ClockSource::Crystal => unsafe {
                w.pllsrc().hse_div_prediv().pllmul().bits(ON_CRYSTAL)
            },
            // SAFETY: as above.
            ClockSource::Internal => unsafe { w.pllsrc().hsi_div2().pllmul().bits(ON_INTERNAL) },
        };
        w.ppre1().div2().adcpre().div6()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    if !polled(PLL_READY_POLLS, || rcc.cr().read().pllrdy().bit_is_set()) {
        return false;
    }
    rcc.cfgr().modify(|_, w| w.sw().pll());
    polled(PLL_READY_POLLS, || rcc.cfgr().read().sws().is_pll())
}

/// Evaluates a condition up to `polls` times. Returns whether it became true.
fn polled(polls: u32, mut is_so: impl FnMut() -> bool) -> bool {
    (0..polls).any(|_| is_so())
}
