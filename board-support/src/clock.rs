//! The clock tree: 72 MHz from the crystal, or 60 MHz from the internal oscillator when the crystal
//! does not start. The HAL would wait for a dead crystal for ever, so it is tried here first.

use stm32f1xx_hal::{
    flash::FlashExt,
    pac,
    rcc::{Config, Rcc, RccExt},
    time::Hertz,
};

use crate::design::{
    ADCCLK_ON_HSE_HZ, HSE_HZ, HSE_READY_LOOKS, SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ,
};

/// What the core runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// The crystal: 72 MHz.
    Crystal,
    /// The internal oscillator, 1 % (DS5319 table 24): 60 MHz. The crystal is missing or dead.
    Internal,
}

impl ClockSource {
    /// Whether the crystal runs.
    #[must_use]
    pub const fn is_crystal(self) -> bool {
        matches!(self, Self::Crystal)
    }
}

/// Brings the clocks up.
pub(crate) fn start(rcc: pac::RCC, flash: pac::FLASH) -> (Rcc, ClockSource) {
    let mut acr = flash.constrain().acr;
    if crystal_starts(&rcc) {
        let config = Config::hse(Hertz::from_raw(HSE_HZ))
            .sysclk(Hertz::from_raw(SYSCLK_ON_HSE_HZ))
            .pclk1(Hertz::from_raw(SYSCLK_ON_HSE_HZ / 2))
            .adcclk(Hertz::from_raw(ADCCLK_ON_HSE_HZ));
        (rcc.freeze(config, &mut acr), ClockSource::Crystal)
    } else {
        let config = Config::hsi()
            .sysclk(Hertz::from_raw(SYSCLK_ON_HSI_HZ))
            .pclk1(Hertz::from_raw(SYSCLK_ON_HSI_HZ / 2))
            .adcclk(Hertz::from_raw(SYSCLK_ON_HSI_HZ / 6));
        (rcc.freeze(config, &mut acr), ClockSource::Internal)
    }
}

fn crystal_starts(rcc: &pac::RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    let ready = (0..HSE_READY_LOOKS).any(|_| rcc.cr().read().hserdy().bit_is_set());
    if !ready {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    ready
}
