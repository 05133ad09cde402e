//! Waiting with a bound.

use cortex_m::{asm, peripheral::SYST};

use crate::design::SYSCLK_ON_HSE_HZ;

/// Cycles of a microsecond on the faster clock; on the slower one it is a fifth longer.
const CYCLES_PER_US: u32 = SYSCLK_ON_HSE_HZ / 1_000_000;

/// Waits until `done`, for about `us` microseconds of the caller's own time at most; what interrupts it
/// comes on top. Whether it was done.
pub(crate) fn within_us(us: u32, mut done: impl FnMut() -> bool) -> bool {
    for _ in 0..us {
        if done() {
            return true;
        }
        delay_us(1);
    }
    done()
}

/// Waits for at least `us` microseconds, at most 50,000.
pub(crate) fn delay_us(us: u32) {
    asm::delay(us.saturating_mul(CYCLES_PER_US));
}

/// Waits for `us` microseconds of a core clock of `mhz` MHz, by SysTick; less than 2^24 cycles. [`delay_us`] takes
/// three to four times as long as it is asked to. For the start: nothing else may use SysTick.
pub(crate) fn wait_us(us: u32, mhz: u8) {
    /// The core's own clock, and on; no interrupt (PM0056 4.5.1).
    const RUN: u32 = 0b101;
    const MASK: u32 = 0x00FF_FFFF;
    let cycles = us.saturating_mul(mhz.into()).min(MASK);
    // SAFETY: the timer is there for ever, and no access to it can break memory.
    let timer = unsafe { &*SYST::PTR };
    // SAFETY: defined values of registers that nothing else uses. A write of any value clears CVR.
    unsafe {
        timer.rvr.write(MASK);
        timer.cvr.write(0);
        timer.csr.write(RUN);
    }
    // A look takes more than four cycles, so a timer that does not count, as in some emulators, is given up.
    for _ in 0..cycles / 4 {
        if 0u32.wrapping_sub(timer.cvr.read()) & MASK >= cycles {
            break;
        }
    }
    // SAFETY: as above.
    unsafe { timer.csr.write(0) };
}
