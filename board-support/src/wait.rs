//! Waiting with a bound.

use cortex_m::asm;

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
