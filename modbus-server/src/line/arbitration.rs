//! Arbitration: units that want to reply to the same request decide among themselves which of them does.
//!
//! This is the arbitration of Wiren Board's extension of Modbus ("Fast Modbus", `docs/protocol.en.md` in the repository
//! wirenboard/wb-modbus-ext-scanner). The bits of a value are sent one by one, the highest first, each in a window of
//! its own. A 0 is sent as the character FF, whose start bit pulls the line low, a 1 as silence. A unit whose bit is 1
//! and that sees a start bit has lost. A unit whose bit is 0 does not send if it sees a start bit before its own, but
//! goes on, because a 0 never loses. So the lowest value wins.
//!
//! ```text
//!  request |<--- start --->|<-- window -->|<-- window -->|<-- window -->|
//!                          | FF           |              | FF           | reply
//!                          0              1              0
//!                       -->|  |<-- guard: for edges, a window begins and ends this much earlier
//! ```
//!
//! Nothing realigns the windows: each unit measures them from the end of the request with its own clock. The guard is
//! there because clocks differ and the line has a length: a start bit of the same window can come before the own one.

/// The times of an arbitration, in fractions of the caller's ticks: 65,536 to a tick.
///
/// Start and two windows must take less than half of the time after which the caller's count of ticks, which has 16 bits,
/// starts again: only times of neighbouring windows are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Windows {
    /// From the end of the request to the first window.
    pub start: u32,
    /// The same in whole milliseconds.
    pub start_ms: u16,
    /// Length of a window.
    pub length: u32,
    /// How much earlier a window begins and ends for edges.
    pub guard: u32,
}

impl Windows {
    /// Returns the times for a bit and a microsecond of these lengths: start max(38.5 bits, 12 bits + 800 us), length
    /// max(13 bits, 12 bits + 50 us rounded up to whole bits), guard max(24 us, a quarter of a bit). A character counts as
    /// 11 bits, whatever its format.
    ///
    /// Neither may be 0.
    #[must_use]
    pub fn new(bit: u32, us: u32) -> Self {
        let length = 12 + (50 * us).div_ceil(bit.max(1));
        let start = (38 * bit + bit / 2).max(12 * bit + 800 * us);
        Self {
            start,
            // Below 100.
            start_ms: (start / (1_000 * us).max(1)) as u16,
            length: length.max(13) * bit,
            guard: (24 * us).max(bit / 4),
        }
    }
}

/// What a unit does at the [deadline](Arbitration::deadline) of its arbitration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing: wait for the next deadline.
    Wait,
    /// Send the character [`Arbitration::ZERO`], and wait for the next deadline.
    Send,
    /// Another unit has the lower value: do not reply.
    Lost,
    /// No other unit has a lower value: reply now.
    Won,
}

/// How an arbitration has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ending {
    /// Not at all, or by another frame.
    #[default]
    None,
    /// Another unit had the lower value. Behind the window that decided it, this number was left.
    Lost(u8),
    /// The unit had the lowest value.
    Won,
}

/// The arbitration of one unit, without clock, timer or UART.
///
/// Times are those of a 16-bit count that wraps, in the high half of a `u32`, with fractions of a tick in the low half.
#[derive(Clone, Copy, Debug)]
pub struct Arbitration {
    /// The bits that are left, the next one in bit 31.
    bits: u32,
    /// Number of windows left.
    left: u8,
    /// Start of the next window.
    due: u32,
    /// The last start bit seen.
    edge: Option<u32>,
    windows: Windows,
}

impl Arbitration {
    /// The character that is sent for a 0: only its start bit is low, and its parity bit if that is even.
    pub const ZERO: u8 = 0xFF;

    /// Starts an arbitration with the lowest `count` bits of `value`, after a request that ended at `ended`. Without
    /// windows the unit replies when the first window would begin.
    #[must_use]
    pub const fn new(value: u32, count: u8, ended: u32, windows: Windows) -> Self {
        Self {
            bits: value.wrapping_shl(32 - count as u32),
            left: count,
            due: ended.wrapping_add(windows.start),
            edge: None,
            windows,
        }
    }

    /// Returns the number of windows that are left.
    pub(super) const fn left(&self) -> u8 {
        self.left
    }

    /// Returns the time at which [`step`](Self::step) must be called.
    #[must_use]
    pub const fn deadline(&self) -> u32 {
        if self.left == 0 || self.bits >> 31 == 0 {
            self.due
        } else {
            self.due
                .wrapping_add(self.windows.length)
                .wrapping_sub(self.windows.guard)
        }
    }

    /// Notes that the line fell at this time. Call it with the last such time before each [`step`](Self::step); it need
    /// not be called for others.
    pub const fn fell(&mut self, at: u32) {
        self.edge = Some(at);
    }

    /// Decides about the next window.
    pub fn step(&mut self) -> Step {
        if self.left == 0 {
            return Step::Won;
        }
        let from = self.due.wrapping_sub(self.windows.guard);
        // Also just behind the end of the window, if this is late. No start bit of the next window comes that early, but
        // the parity bit of a character in this window may be the last edge.
        let fell = self
            .edge
            .take()
            .is_some_and(|edge| edge.wrapping_sub(from) < u32::MAX / 2);
        let is_zero = self.bits >> 31 == 0;
        self.bits <<= 1;
        self.left -= 1;
        self.due = self.due.wrapping_add(self.windows.length);
        match (is_zero, fell) {
            (true, false) => Step::Send,
            (false, true) => Step::Lost,
            _ => Step::Wait,
        }
    }
}
