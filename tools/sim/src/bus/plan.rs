//! How far the boards of a bus can run before they exchange their characters and packets.

use crate::board::Board;
use crate::radio::timing;
use f103::time::Time;

/// Most time by which other boards run ahead of a unit whose transmitter is off. Such a transmitter sends an idle frame
/// before its first character, and the idle frame takes longer at every rate of a line.
pub const FARTHEST: Time = Time::from_us(10);

/// Most time by which a board may get the edges of another unit's character late.
pub const LATEST: Time = Time::from_us(20);

/// The next actions of a board, as far as they are known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// The core executes nothing before this instant.
    pub(super) awake: Time,
    /// The unit begins no character before this instant.
    pub(super) start: Time,
    /// The other boards may run up to this instant: half a bit after `start`, at most [`LATEST`] after it. If the board
    /// has a LoRa module, also at most [`timing::LOOK_AHEAD`] after `awake`.
    pub(super) bound: Time,
}

/// The instants up to which boards can run before they exchange their characters and packets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Horizon {
    /// The board with the least bound. It runs up to `next`, all other boards run up to `least`.
    first: usize,
    least: Time,
    next: Time,
}

impl Horizon {
    /// Returns the horizon of boards with these plans. `None` if all boards sleep until `t`, the end of the run.
    pub(super) fn of(plans: impl Iterator<Item = Plan> + Clone, t: Time) -> Option<Self> {
        let awake = plans.clone().map(|plan| plan.awake).min()?;
        if awake >= t {
            return None;
        }
        let mut horizon = Self {
            first: 0,
            least: t,
            next: t,
        };
        for (n, plan) in plans.enumerate() {
            if plan.bound < horizon.least {
                horizon.next = horizon.least;
                (horizon.first, horizon.least) = (n, plan.bound);
            } else {
                horizon.next = horizon.next.min(plan.bound);
            }
        }
        // Let the first board that is awake execute at least one instruction.
        horizon.least = horizon.least.max(awake + Time::from_ps(1));
        horizon.next = horizon.next.max(horizon.least);
        Some(horizon)
    }

    /// Returns the instant up to which board `n` runs.
    pub(super) fn of_board(self, n: usize) -> Time {
        if n == self.first {
            self.next
        } else {
            self.least
        }
    }
}

impl Board {
    /// Returns the next actions of the board.
    pub(super) fn plan(&self) -> Plan {
        let awake = self.next_instruction();
        let usart = self.usart(self.layout().line.tx);
        let start = match usart.earliest_start(awake) {
            _ if awake == Time::MAX => awake,
            Some(start) => start,
            None => awake + FARTHEST,
        };
        let late = usart
            .bit()
            .map_or(Time::ZERO, |bit| Time::from_ps(bit.as_ps() / 2).min(LATEST));
        let mut bound = start + late;
        if self.radio().is_some() {
            bound = bound.min(awake + timing::LOOK_AHEAD);
        }
        Plan {
            awake,
            start,
            bound,
        }
    }
}
