//! The board's design constants, each with its unit and where it comes from.

/// The crystal, in Hz.
pub const HSE_HZ: u32 = 8_000_000;

/// Core clock on the crystal, in Hz: the F103's fastest (DS5319 table 9), 8 MHz x 9.
pub const SYSCLK_ON_HSE_HZ: u32 = 72_000_000;

/// Core clock without a crystal, in Hz: 8 MHz / 2 x 15 (RM0008 7.3.2, PLLSRC). Not the 64 MHz there
/// could be: they miss 921600 bit/s by 0.6 %, these miss it by 0.2 % as the crystal's 72 MHz do.
pub const SYSCLK_ON_HSI_HZ: u32 = 60_000_000;

/// ADC clock, in Hz: SYSCLK / 6, under the 14 MHz of DS5319 table 46.
pub const ADCCLK_ON_HSE_HZ: u32 = SYSCLK_ON_HSE_HZ / 6;

/// How often a crystal's ready flag is looked at before it is given up. One look takes some ten
/// cycles of the 8 MHz the chip starts on, so this is about 100 ms; a good crystal needs 2 ms
/// (DS5319 table 22).
pub const HSE_READY_LOOKS: u32 = 80_000;

/// Cycles from switching the pull-ups on to reading the DIP switch: 100 us for 40 kOhm against any
/// stray capacitance.
pub const DIP_SETTLE_CYCLES: u32 = SYSCLK_ON_HSE_HZ / 10_000;

/// The scan's rate, in Hz.
pub const SCAN_HZ: u32 = 1_000;

/// The independent watchdog's time, in milliseconds on a 40 kHz LSI. The LSI runs at 30 to 60 kHz
/// (DS5319 table 25), so it bites between 333 and 667 ms.
pub const WATCHDOG_MS: u32 = 500;

/// The largest error of a baud rate the divider may leave, in parts per million. A character of 11
/// bits is sampled right up to 4.5 % of difference; both ends and their crystals share it.
pub const BAUD_ERROR_PPM: u32 = 5_000;

const _: () = {
    assert!(SYSCLK_ON_HSE_HZ.is_multiple_of(HSE_HZ));
    assert!(ADCCLK_ON_HSE_HZ <= 14_000_000);
    assert!(SYSCLK_ON_HSE_HZ.is_multiple_of(SCAN_HZ) && SYSCLK_ON_HSI_HZ.is_multiple_of(SCAN_HZ));
};
