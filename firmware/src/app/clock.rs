//! The device's clock: milliseconds since the start, wrapping after 49 days.
//!
//! It goes on while flash is erased or programmed, when the tasks that use it stand still.

use core::sync::atomic::{AtomicU32, Ordering};

static MILLIS: AtomicU32 = AtomicU32::new(0);

/// A millisecond has passed. For one task alone: two would lose counts.
#[inline(always)]
pub fn advance() {
    MILLIS.store(millis().wrapping_add(1), Ordering::Relaxed);
}

/// Milliseconds since the start.
#[inline(always)]
pub fn millis() -> u32 {
    MILLIS.load(Ordering::Relaxed)
}
