//! The board's design constants, each with its unit and its source.

/// Crystal frequency, in Hz.
pub const HSE_HZ: u32 = 8_000_000;

/// Core clock on the crystal, in Hz: the F103's fastest (DS5319 table 9), 8 MHz x 9.
pub const SYSCLK_ON_HSE_HZ: u32 = 72_000_000;

/// Core clock without a crystal, in Hz: 8 MHz / 2 x 15 (RM0008 7.3.2, PLLSRC). 64 MHz would be possible but misses
/// 921600 bit/s by 0.6 %; 60 MHz misses it by 0.2 %, as 72 MHz does.
pub const SYSCLK_ON_HSI_HZ: u32 = 60_000_000;

/// ADC clock, in Hz: SYSCLK / 6, below the limit of 14 MHz (DS5319 table 46); 10 MHz without a crystal.
pub const ADCCLK_ON_HSE_HZ: u32 = SYSCLK_ON_HSE_HZ / 6;

/// Sampling time of an analog line, in half cycles of ADCCLK: 55.5 cycles. With the 12.5 cycles of the conversion
/// itself that makes 5.7 us at 12 MHz. Sources of up to 50 kOhm are allowed (DS5319 table 47). The highest source
/// resistance on a module is that of the NTC with its 10 kOhm pull-up, less than 10 kOhm. The input then settles to
/// within 1/4 LSB even after a line at the other end of the range.
pub const ADC_SAMPLE_HALF_CYCLES: u32 = 111;

/// Time for the ADC to settle after power-up, in us: twice the maximum of 1 (DS5319 table 46).
pub const ADC_SETTLING_US: u32 = 2;

/// Time limit for the ADC's calibration, in us: 83 cycles take 8.3 at 10 MHz (DS5319 table 46).
pub const ADC_CALIBRATION_US: u32 = 100;

/// Number of polls after which a conversion is given up: at least twice what it needs. A poll takes four cycles or
/// more.
pub const ADC_POLLS: u32 = 2 * 68 * (SYSCLK_ON_HSE_HZ / ADCCLK_ON_HSE_HZ) / 4;

/// SCL frequency of the DACs' bus, in Hz. It is fast mode, so that the 13 bytes for four outputs take 0.4 ms and
/// the communication watchdog sets the outputs to SAFE in time. It is below the 400 kHz of fast mode, because the
/// module's pull-ups are not specified: SCL is low for 2.2 us, which is enough for 10 kOhm and 200 pF. In standard
/// mode a repeated start violates its set-up time above 88 kHz; fast mode does not (errata sheet of the
/// medium-density parts, I2C, set-up time of a repeated start).
pub const I2C_HZ: u32 = 300_000;

/// Time limit for one step on the DACs' bus, a byte or a condition, in us: twice the nine bits of a byte at 80 kHz,
/// which leaves room for slow edges and a stretched clock. A device that stretches the clock for longer counts as
/// stuck.
pub const I2C_STEP_US: u32 = 225;

/// Half a period of SCL while software toggles the clock, in us.
pub const I2C_HALF_PERIOD_US: u32 = 6;

/// Time limit for programming a half-word, in us: it takes at most 70 (DS5319 table 28).
pub const FLASH_PROGRAM_US: u32 = 500;

/// Time limit for erasing a page, in us: it takes at most 40 ms (DS5319 table 28), and up to 300 ms on clones of the part.
pub const FLASH_ERASE_US: u32 = 420_000;

/// Threshold of the voltage detector, PLS (RM0008 5.4.1). Level 7 is 2.9 V nominal: the detector reports a falling
/// supply as low at 2.66 to 2.9 V and a rising one as sufficient at 2.76 to 3.0 V (DS5319 table 11).
///
/// This is the highest level. A supply of 3.3 V less 5 % is 3.13 V and never below it. A collapsing supply still
/// has to fall by 0.66 V, from 2.66 V, before it reaches 2.0 V, the lowest voltage for programming. At 40 mA and 10
/// uF that takes 165 us, more than twice the 70 us of a half-word. A collapse can still interrupt an erase, which
/// takes 40 ms; the page then has no mark and the next start erases it again.
pub const PVD_LEVEL: u8 = 0b111;

/// Number of crystal faults since power-on after which the crystal is not started again before the next power-on.
/// Each fault causes a reset, which turns the outputs off; a crystal that starts and then fails would cause one
/// reset after another.
pub const CRYSTAL_FAULTS: u8 = 2;

/// Number of polls of the crystal's ready flag before the crystal is given up. One poll takes about ten cycles of
/// the 8 MHz that the chip starts with, so the limit is about 100 ms; a working crystal needs 2 ms (DS5319 table
/// 22).
pub const HSE_READY_POLLS: u32 = 80_000;

/// Number of polls of the PLL's ready flag, or of the system clock switch: about 10 ms. The PLL locks within 200 us
/// (DS5319 table 27).
pub const PLL_READY_POLLS: u32 = 8_000;

/// Cycles between switching the pull-ups on and reading the DIP switch: 100 us, ample for 40 kOhm and the stray
/// capacitance.
pub const DIP_SETTLE_CYCLES: u32 = SYSCLK_ON_HSE_HZ / 10_000;

/// Time between two readings of the DIP switch, in us.
pub const DIP_POLL_US: u32 = 1_000;

/// Number of equal readings in a row, after the first one, that count as a stable switch: 10 ms.
pub const DIP_STABLE_POLLS: u32 = 10;

/// Largest number of readings: 50 ms. After that the last reading counts.
pub const DIP_POLLS: u32 = 50;

/// Rate of the scan, in Hz.
pub const SCAN_HZ: u32 = 1_000;

/// Longest time that an interrupt of the line waits, in us, with a reserve: `cargo xtask bench` measures at most 5.
pub const LONGEST_WAIT_US: u32 = 10;

/// Time-out of the independent watchdog, in milliseconds with an LSI of 40 kHz. The LSI runs at 30 to 60 kHz
/// (DS5319 table 25), so the watchdog resets the device after 600 to 1,200 ms. One erase of 400 ms, and 100 ms until each task
/// has proved that it runs, are less.
pub const WATCHDOG_MS: u32 = 900;

/// Time-out of the independent watchdog during start-up, in milliseconds with an LSI of 40 kHz: really 1,333 to 2,667.
/// Start-up takes at most 1,040: 150 for a crystal that does not start, 50 for the DIP switch, 40 for a record of the store and
/// 400 for each of two erases.
pub const WATCHDOG_START_MS: u32 = 2_000;

/// Divider of the watchdog's clock during start-up: steps of 0.8 ms.
pub const WATCHDOG_START_DIVIDER: u32 = 32;

/// The watchdog's reload value during start-up.
pub const WATCHDOG_START_RELOAD: u16 = (WATCHDOG_START_MS * 40 / WATCHDOG_START_DIVIDER - 1) as u16;

/// Core clock of the loader, in MHz: the internal oscillator, as after a reset.
pub const LOADER_MHZ: u8 = 8;

/// Time-out of the independent watchdog in the loader, in milliseconds with an LSI of 40 kHz: really 5.3 to 10.7 s. The
/// check of a signature takes up to 4 s.
pub const WATCHDOG_LOADER_MS: u32 = 8_000;

/// Divider of the watchdog's clock in the loader: steps of 3.2 ms.
pub const WATCHDOG_LOADER_DIVIDER: u32 = 128;

/// The watchdog's reload value in the loader.
pub const WATCHDOG_LOADER_RELOAD: u16 =
    (WATCHDOG_LOADER_MS * 40 / WATCHDOG_LOADER_DIVIDER - 1) as u16;

/// Divider of the watchdog's clock, the LSI (RM0008 19.4.2): steps of 0.4 ms.
pub const WATCHDOG_DIVIDER: u32 = 16;

/// The watchdog's reload value (RM0008 19.4.3).
pub const WATCHDOG_RELOAD: u16 = (WATCHDOG_MS * 40 / WATCHDOG_DIVIDER - 1) as u16;

/// Time limit for the watchdog to accept its settings, in us: five cycles of the slowest LSI take 170 (RM0008
/// 19.4.4), and the LSI starts within 85 (DS5319 table 25).
pub const WATCHDOG_SETTINGS_US: u32 = 1_000;

/// Largest error of the programmed baud rate, in ppm. A receiver samples a character of 11 bits correctly up to a
/// difference of 4.5 %, which both stations and their clocks share.
pub const BAUD_ERROR_PPM: u32 = 5_000;

const _: () = {
    assert!(SYSCLK_ON_HSE_HZ.is_multiple_of(HSE_HZ));
    assert!(ADCCLK_ON_HSE_HZ <= 14_000_000);
    assert!(ADCCLK_ON_HSE_HZ > SYSCLK_ON_HSI_HZ / 6);
    // The scan timer's prescaler divides by two, and its counter has 16 bits.
    assert!(
        SYSCLK_ON_HSE_HZ.is_multiple_of(2 * SCAN_HZ) && SYSCLK_ON_HSE_HZ / 2 / SCAN_HZ <= 65_536
    );
    assert!(SYSCLK_ON_HSI_HZ.is_multiple_of(2 * SCAN_HZ));
    assert!(
        WATCHDOG_MS * 40 / WATCHDOG_DIVIDER <= 4096,
        "the watchdog counts with 12 bits"
    );
    assert!(WATCHDOG_START_MS * 40 / WATCHDOG_START_DIVIDER <= 4096);
    assert!(WATCHDOG_LOADER_MS * 40 / WATCHDOG_LOADER_DIVIDER <= 4096);
    assert!(I2C_HZ > 100_000 && I2C_HZ <= 400_000);
    assert!(I2C_STEP_US > 2 * 9 * 1_000_000 / I2C_HZ);
};
