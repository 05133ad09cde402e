//! How long an instruction takes: the one place that says so.
//!
//! The Cortex-M3 executes most Thumb-2 code in a little over one cycle per instruction from memory without
//! wait states (its TRM, DDI 0337E chapter 18; 1.25 DMIPS/MHz). Flash wait states (RM0008 3.3.3) add to that:
//! little while the prefetch buffer keeps ahead, much without it. Every instruction is charged the same
//! average, so that the time of a run depends on the number of instructions alone. What an average hides:
//! divisions, long multiplications, taken branches, and the twelve cycles of an interrupt's entry.

use crate::time::Time;

/// Cycles of HCLK for 64 instructions with `wait_states` (FLASH_ACR.LATENCY) and the prefetch buffer on or off.
#[must_use]
pub const fn cycles_per_64(wait_states: u32, prefetch: bool) -> u32 {
    match (wait_states, prefetch) {
        (0, _) => 77,      // 1.2 cycles each
        (1, true) => 86,   // 1.35
        (1, false) => 109, // 1.7
        (_, true) => 96,   // 1.5
        (_, false) => 144, // 2.25
    }
}

/// The highest SYSCLK in Hz that `wait_states` are enough for (RM0008 3.3.3).
#[must_use]
pub const fn highest_sysclk(wait_states: u32) -> u32 {
    match wait_states {
        0 => 24_000_000,
        1 => 48_000_000,
        _ => 72_000_000,
    }
}

/// What turns a count of instructions into the virtual time and into cycles of HCLK.
///
/// Both grow linearly from a base, the last instant at which time jumped or the rate changed, and are worked
/// out from it in whole numbers, so nothing drifts.
#[derive(Clone, Copy, Debug)]
pub struct InstructionClock {
    hclk: u32,
    per_64: u32,
    /// Picoseconds of an instruction, and of a cycle.
    instruction: Ratio,
    hclk_cycle: Ratio,
    /// The base: this many instructions, at this instant, in this cycle.
    count: u64,
    at: Time,
    cycle: u64,
    /// Since when HCLK runs at this rate: an instant and its cycle.
    since: (Time, u64),
}

impl InstructionClock {
    /// A clock that starts at `at` with no instruction done.
    #[must_use]
    pub fn new(at: Time, hclk: u32, per_64: u32) -> Self {
        let mut clock = Self {
            hclk,
            per_64,
            instruction: Ratio::new(1, 1),
            hclk_cycle: Ratio::new(1, 1),
            count: 0,
            at,
            cycle: 0,
            since: (at, 0),
        };
        clock.set_rate(0, hclk, per_64);
        clock
    }

    /// When the `count`th instruction ends.
    #[must_use]
    pub fn time(&self, count: u64) -> Time {
        self.at + Time::from_ps(self.instruction.times(count - self.count))
    }

    /// The cycle of HCLK in which the `count`th instruction ends.
    #[must_use]
    pub fn cycle(&self, count: u64) -> u64 {
        self.cycle + (count - self.count) * u64::from(self.per_64) / 64
    }

    /// When cycle `cycle` of HCLK begins, at the present rate.
    #[must_use]
    pub fn time_of_cycle(&self, cycle: u64) -> Time {
        let (at, base) = self.since;
        if self.hclk == 0 {
            return if cycle > base { Time::MAX } else { at };
        }
        at + Time::from_ps(self.hclk_cycle.times(cycle.saturating_sub(base)))
    }

    /// How many instructions after the `count`th the first one ends at `until` or later: 0 when the `count`th
    /// does.
    #[must_use]
    pub fn instructions_until(&self, count: u64, until: Time) -> u64 {
        let Some(span) = until.checked_sub(self.at) else {
            return 0;
        };
        let needed = self.instruction.least(span.as_ps());
        needed.saturating_sub(count - self.count)
    }

    /// Nothing was executed up to `until`, after the `count`th instruction: the core waited or stalled.
    pub fn jump(&mut self, count: u64, until: Time) {
        let until = until.max(self.time(count));
        let (at, base) = self.since;
        if self.hclk == 0 {
            (self.at, self.count) = (until, count);
            return;
        }
        let cycle = base + self.hclk_cycle.whole((until - at).as_ps());
        self.cycle = cycle.max(self.cycle(count));
        self.at = until;
        self.count = count;
    }

    /// The core's own timer has reached `cycle`: no instruction sees an earlier one.
    pub fn reach_cycle(&mut self, count: u64, cycle: u64) {
        let now = self.time(count);
        self.cycle = cycle.max(self.cycle(count));
        self.at = now;
        self.count = count;
    }

    /// The core was reset: it counts its instructions from 0 again.
    pub fn restart_count(&mut self, count: u64) {
        self.jump(count, self.time(count));
        self.count = 0;
    }

    /// From the `count`th instruction on HCLK runs at `hclk` Hz and 64 instructions take `per_64` of its cycles.
    /// At 0 Hz no cycle comes; no instruction may be counted then.
    pub fn set_rate(&mut self, count: u64, hclk: u32, per_64: u32) {
        let (now, cycle) = (self.time(count), self.cycle(count));
        (self.at, self.cycle, self.count) = (now, cycle, count);
        self.since = (now, cycle);
        self.hclk = hclk;
        self.per_64 = per_64;
        let hz = u64::from(hclk.max(1));
        self.instruction = Ratio::new(u64::from(per_64) * PS_PER_S, hz * 64);
        self.hclk_cycle = Ratio::new(PS_PER_S, hz);
    }
}

const PS_PER_S: u64 = 1_000_000_000_000;

/// Picoseconds of something that happens again and again: a reduced fraction, so that the products below fit
/// 64 bits for days; beyond that they take 128.
#[derive(Clone, Copy, Debug)]
struct Ratio {
    num: u64,
    den: u64,
}

impl Ratio {
    const fn new(num: u64, den: u64) -> Self {
        let divisor = gcd(num, den);
        Self {
            num: num / divisor,
            den: den / divisor,
        }
    }

    /// When the `n`th has ended: floor(n * num / den).
    const fn times(self, n: u64) -> u64 {
        match n.checked_mul(self.num) {
            Some(product) => product / self.den,
            None => (n as u128 * self.num as u128 / self.den as u128) as u64,
        }
    }

    /// The least n with `times(n) >= ps`: ceil(ps * den / num).
    fn least(self, ps: u64) -> u64 {
        match ps.checked_mul(self.den) {
            Some(product) => product.div_ceil(self.num),
            None => {
                let wide = (u128::from(ps) * u128::from(self.den)).div_ceil(u128::from(self.num));
                u64::try_from(wide).unwrap_or(u64::MAX)
            }
        }
    }

    /// The greatest n with `times(n) <= ps`: one less than the least that is above.
    fn whole(self, ps: u64) -> u64 {
        self.least(ps.saturating_add(1)) - 1
    }
}

const fn gcd(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_take_their_share_exactly_for_hours() {
        let clock = InstructionClock::new(Time::ZERO, 72_000_000, 96);
        let n = 48_000_000 * 3_600 * 5;
        assert_eq!(clock.time(n), Time::from_secs(3_600 * 5));
        assert_eq!(clock.cycle(n), 72_000_000 * 3_600 * 5);
        assert_eq!(clock.instructions_until(0, Time::from_secs(18_000)), n);
        assert_eq!(clock.instructions_until(n, Time::from_secs(18_000)), 0);
    }

    #[test]
    fn the_number_of_instructions_until_an_instant_is_the_smallest() {
        for (hclk, per_64) in [(72_000_000, 96), (8_000_000, 77), (64_000_000, 144)] {
            let clock = InstructionClock::new(Time::from_us(7), hclk, per_64);
            for ps in [1, 999, 20_833, 20_834, 1_000_000, 12_345_678] {
                let until = Time::from_us(7) + Time::from_ps(ps);
                let n = clock.instructions_until(0, until);
                assert!(clock.time(n) >= until);
                assert!(n == 0 || clock.time(n - 1) < until);
            }
        }
    }

    #[test]
    fn a_jump_moves_time_and_cycles_together() {
        let mut clock = InstructionClock::new(Time::ZERO, 72_000_000, 96);
        clock.jump(10, Time::from_ms(30));
        assert_eq!(clock.time(10), Time::from_ms(30));
        assert_eq!(clock.cycle(10), 72_000 * 30);
        assert_eq!(clock.time_of_cycle(72_000 * 31), Time::from_ms(31));
        clock.set_rate(10, 8_000_000, 77);
        clock.jump(10, Time::from_ms(40));
        assert_eq!(clock.cycle(10), 72_000 * 30 + 8_000 * 10);
        clock.restart_count(10);
        assert_eq!(clock.time(0), Time::from_ms(40));
        assert_eq!(clock.cycle(0), 72_000 * 30 + 8_000 * 10);
    }
}
