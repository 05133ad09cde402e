//! Waits with a time limit.

use cortex_m::{asm, peripheral::SYST};

use crate::design::SYSCLK_ON_HSE_HZ;

/// Cycles per microsecond on the faster clock. On the slower clock the waits are a fifth longer.
const CYCLES_PER_US: u32 = SYSCLK_ON_HSE_HZ / 1_000_000;

/// Polls until `done` returns true, for at most about `us` microseconds, not counting time spent in interrupts.
/// Returns whether `done` returned true.
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

/// Waits for `us` microseconds, measured by SysTick, with a core clock of `mhz` MHz; less than 2^24 cycles. More
/// exact than [`delay_us`], which takes three to four times as long as requested. Only for the start-up: nothing
/// else may use SysTick.
pub(crate) fn wait_us(us: u32, mhz: u8) {
    /// Clock SysTick from the core clock and enable it, without an interrupt (PM0056 4.5.1).
    const RUN: u32 = 0b101;
    const MASK: u32 = 0x00FF_FFFF;
    let cycles = us.saturating_mul(mhz.into()).min(MASK);
    // SAFETY: the timer always exists, and no access to it can violate memory safety.
    let timer = unsafe { &*SYST::PTR };
    // SAFETY: defined values of registers that nothing else uses. Writing any value clears CVR.
    unsafe {
        timer.rvr.write(MASK);
        timer.cvr.write(0);
        timer.csr.write(RUN);
    }
    // A poll takes more than four cycles, so this bound is enough. It ends the wait when the timer does not count,
    // as in some emulators.
    for _ in 0..cycles / 4 {
        if 0u32.wrapping_sub(timer.cvr.read()) & MASK >= cycles {
            break;
        }
    }
    // SAFETY: as above.
    unsafe { timer.csr.write(0) };
}
