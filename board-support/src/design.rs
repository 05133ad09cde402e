//! The board's design constants, each with its unit and where it comes from.

/// The crystal, in Hz.
pub const HSE_HZ: u32 = 8_000_000;

/// Core clock on the crystal, in Hz: the F103's fastest (DS5319 table 9), 8 MHz x 9.
pub const SYSCLK_ON_HSE_HZ: u32 = 72_000_000;

/// Core clock without a crystal, in Hz: 8 MHz / 2 x 15 (RM0008 7.3.2, PLLSRC). Not the 64 MHz there
/// could be: they miss 921600 bit/s by 0.6 %, these miss it by 0.2 % as the crystal's 72 MHz do.
pub const SYSCLK_ON_HSI_HZ: u32 = 60_000_000;

/// ADC clock, in Hz: SYSCLK / 6, under the 14 MHz of DS5319 table 46; 10 MHz without a crystal.
pub const ADCCLK_ON_HSE_HZ: u32 = SYSCLK_ON_HSE_HZ / 6;

/// Sampling time of an analog line, in half cycles of ADCCLK: 55.5, which with the 12.5 of the
/// conversion itself makes 5.7 us at 12 MHz. Good for a source of 50 kOhm (DS5319 table 47); the
/// module's weakest, the NTC under its 10 kOhm, has less than 10, so it settles within a quarter of a
/// step even straight after another line at the other end of the range.
pub const ADC_SAMPLE_HALF_CYCLES: u32 = 111;

/// Wait for the ADC to settle after power-up, in us: 1 at most (DS5319 table 46), doubled.
pub const ADC_SETTLING_US: u32 = 2;

/// The longest wait for the ADC's calibration, in us: 83 cycles take 8 at 10 MHz (DS5319 table 46).
pub const ADC_CALIBRATION_US: u32 = 100;

/// How often a conversion is looked at before it is given up: at least twice what it needs. A look takes four cycles
/// or more.
pub const ADC_LOOKS: u32 = 2 * 68 * (SYSCLK_ON_HSE_HZ / ADCCLK_ON_HSE_HZ) / 4;

/// SCL of the DACs' bus, in Hz: fast mode, so that the 13 bytes for four outputs take 0.4 ms and the
/// communication watchdog brings them to SAFE in time. Less than its 400 kHz, because nobody knows the
/// module's pull-ups: the 2.2 us that SCL is low are enough for 10 kOhm and 200 pF. Fast mode also
/// has no trouble with the repeated start, as standard mode has above 88 kHz (errata sheet of the
/// medium-density parts, I2C, set-up time of a repeated start).
pub const I2C_HZ: u32 = 300_000;

/// The longest wait for one step on the DAC's bus, a byte or a condition, in us: twice the nine bits
/// of a byte at 80 kHz, which leaves room for slow edges and a stretched clock. Whoever stretches it
/// for longer is taken to be stuck.
pub const I2C_STEP_US: u32 = 225;

/// Half a period of SCL when the bus is clocked by hand, in us.
pub const I2C_HALF_PERIOD_US: u32 = 6;

/// The longest wait for a half-word to be programmed, in us: 70 at most (DS5319 table 28).
pub const FLASH_PROGRAM_US: u32 = 500;

/// The longest wait for a page to be erased, in us: 40 ms at most (DS5319 table 28).
pub const FLASH_ERASE_US: u32 = 100_000;

/// The threshold of the voltage detector, PLS (RM0008 5.4.1): 7 is 2.9 V, at which a falling supply is found
/// low at 2.66 to 2.9 V and a rising one good at 2.76 to 3.0 V (DS5319 table 11).
///
/// The highest there is: a supply of 3.3 V less 5 % is 3.13 V and never below it. One that collapses still has
/// to fall by 0.66 V, from 2.66 V, before programming is out of its specification at 2.0 V. At 40 mA
/// and 10 uF that takes 165 us, more than twice a half-word's 70 us. An erase, 40 ms, may still be cut short;
/// the page's missing mark shows that at the next start.
pub const PVD_LEVEL: u8 = 0b111;

/// Number of crystal faults since power-on after which the crystal is not started again before the next
/// power-on. Each fault costs a reset, which drops the outputs; a crystal that starts and then fails would cost
/// one after another.
pub const CRYSTAL_FAULTS: u8 = 2;

/// Largest error of the internal oscillator, in ppm: -2 to +2.5 % from -40 to 105 degrees Celsius (DS5319
/// table 24, ACC_HSI, factory-calibrated).
pub const HSI_ERROR_PPM: u32 = 25_000;

/// Largest error of the other end's rate, in ppm: 1 % (MODBUS over Serial Line V1.02, 3.2).
pub const MASTER_ERROR_PPM: u32 = 10_000;

/// Time by which transceivers and cable may lengthen or shorten a bit, in ns: the skews of two common
/// transceivers.
pub const LINE_ASYMMETRY_NS: u32 = 50;

/// How often a crystal's ready flag is looked at before it is given up. One look takes some ten
/// cycles of the 8 MHz the chip starts on, so this is about 100 ms; a good crystal needs 2 ms
/// (DS5319 table 22).
pub const HSE_READY_LOOKS: u32 = 80_000;

/// How often the PLL's ready flag, or a change of the system clock, is looked at: some 10 ms; the PLL
/// locks within 200 us (DS5319 table 27).
pub const PLL_READY_LOOKS: u32 = 8_000;

/// Cycles from switching the pull-ups on to reading the DIP switch: 100 us for 40 kOhm against any
/// stray capacitance.
pub const DIP_SETTLE_CYCLES: u32 = SYSCLK_ON_HSE_HZ / 10_000;

/// Time between two readings of the DIP switch, in us.
pub const DIP_POLL_US: u32 = 1_000;

/// Number of equal readings in a row, after a first one, that count as a stable switch: 10 ms.
pub const DIP_STABLE_POLLS: u32 = 10;

/// Number of readings at most: 50 ms. Then the last one counts.
pub const DIP_POLLS: u32 = 50;

/// The scan's rate, in Hz.
pub const SCAN_HZ: u32 = 1_000;

/// The independent watchdog's time, in milliseconds on a 40 kHz LSI. The LSI runs at 30 to 60 kHz
/// (DS5319 table 25), so it bites between 333 and 667 ms.
pub const WATCHDOG_MS: u32 = 500;

/// The independent watchdog's time while the device starts, in milliseconds on a 40 kHz LSI: 800 to 1600. A start
/// takes 340 at most: 150 for a crystal that does not start, 50 for the DIP switch, 120 for the store.
pub const WATCHDOG_START_MS: u32 = 1_200;

/// What the watchdog's clock is divided by while the device starts: steps of 0.4 ms.
pub const WATCHDOG_START_DIVIDER: u32 = 16;

/// The watchdog's reload value while the device starts.
pub const WATCHDOG_START_RELOAD: u16 = (WATCHDOG_START_MS * 40 / WATCHDOG_START_DIVIDER - 1) as u16;

/// What the watchdog's clock, the LSI, is divided by before it counts (RM0008 19.4.2): steps of
/// 0.2 ms.
pub const WATCHDOG_DIVIDER: u32 = 8;

/// The watchdog's reload value (RM0008 19.4.3).
pub const WATCHDOG_RELOAD: u16 = (WATCHDOG_MS * 40 / WATCHDOG_DIVIDER - 1) as u16;

/// The longest wait for the watchdog to take its settings over, in us: five cycles of the slowest LSI
/// are 170 (RM0008 19.4.4), and it has to start first, 85 (DS5319 table 25).
pub const WATCHDOG_SETTINGS_US: u32 = 1_000;

/// The largest error of a baud rate the divider may leave, in parts per million. A character of 11
/// bits is sampled right up to 4.5 % of difference; both ends and their crystals share it.
pub const BAUD_ERROR_PPM: u32 = 5_000;

const _: () = {
    assert!(SYSCLK_ON_HSE_HZ.is_multiple_of(HSE_HZ));
    assert!(ADCCLK_ON_HSE_HZ <= 14_000_000);
    assert!(ADCCLK_ON_HSE_HZ > SYSCLK_ON_HSI_HZ / 6);
    // The scan timer divides by two and counts the rest with 16 bits.
    assert!(
        SYSCLK_ON_HSE_HZ.is_multiple_of(2 * SCAN_HZ) && SYSCLK_ON_HSE_HZ / 2 / SCAN_HZ <= 65_536
    );
    assert!(SYSCLK_ON_HSI_HZ.is_multiple_of(2 * SCAN_HZ));
    assert!(
        WATCHDOG_MS * 40 / WATCHDOG_DIVIDER <= 4096,
        "the watchdog counts with 12 bits"
    );
    assert!(WATCHDOG_START_MS * 40 / WATCHDOG_START_DIVIDER <= 4096);
    assert!(I2C_HZ > 100_000 && I2C_HZ <= 400_000);
    assert!(I2C_STEP_US > 2 * 9 * 1_000_000 / I2C_HZ);
};
