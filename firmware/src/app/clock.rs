//! The device's clock: milliseconds since the start, wrapping after 49 days.
//!
//! The clock continues while flash is erased or programmed and most tasks stand still.

use core::sync::atomic::{AtomicU32, Ordering};

static MILLIS: AtomicU32 = AtomicU32::new(0);

/// Adds a millisecond. Only one task may call this; with two callers counts would be lost.
#[inline(always)]
pub fn advance() {
    MILLIS.store(millis().wrapping_add(1), Ordering::Relaxed);
}

/// Returns the milliseconds since the start.
#[inline(always)]
pub fn millis() -> u32 {
    MILLIS.load(Ordering::Relaxed)
}
