//! The core's clock: converts a number of instructions into cycles of HCLK and into virtual time.
//!
//! The costs of an instruction are in [`costs`](crate::costs). [`segment`](super::segment) adds the costs of several
//! instructions.

use super::segment::Segment;
use crate::time::Time;

/// Converts a number of instructions into virtual time and into cycles of HCLK.
///
/// An anchor is the last instant at which time jumped or the rate changed. Cycles are counted from the anchor, and time
/// is computed from the cycles in whole numbers, so rounding errors do not add up.
#[derive(Clone, Copy, Debug)]
pub struct InstructionClock {
    hclk: u32,
    /// Picoseconds in a cycle.
    hclk_cycle: Ratio,
    /// The anchor: an instant and its cycle.
    at: (Time, u64),
    /// Number of instructions that had ended in `cycle`.
    count: u64,
    cycle: u64,
    /// The instructions after these.
    segment: Segment,
    /// Instant and cycle since which HCLK has the present rate.
    since: (Time, u64),
}

impl InstructionClock {
    /// Returns a clock that starts at `at`, before the first instruction.
    #[must_use]
    pub fn new(at: Time, hclk: u32) -> Self {
        let mut clock = Self {
            hclk,
            hclk_cycle: Ratio::new(1, 1),
            at: (at, 0),
            count: 0,
            cycle: 0,
            segment: Segment::EMPTY,
            since: (at, 0),
        };
        clock.set_rate(0, hclk);
        clock
    }

    /// Returns the instant at which the `count`th instruction ends.
    #[inline]
    #[must_use]
    pub fn time(&self, count: u64) -> Time {
        let (at, base) = self.at;
        at + Time::from_ps(self.hclk_cycle.times(self.cycle(count) - base))
    }

    /// Returns the cycle of HCLK in which the `count`th instruction ends.
    #[inline]
    #[must_use]
    pub fn cycle(&self, count: u64) -> u64 {
        self.cycle + self.segment.cycles(count - self.count)
    }

    /// Returns the instant at which cycle `cycle` of HCLK begins, at the present rate.
    #[inline]
    #[must_use]
    pub fn time_of_cycle(&self, cycle: u64) -> Time {
        let (at, base) = self.since;
        if self.hclk == 0 {
            return if cycle > base { Time::MAX } else { at };
        }
        at + Time::from_ps(self.hclk_cycle.times(cycle.saturating_sub(base)))
    }

    /// Sets the instructions that the core executes after the `count`th.
    #[inline]
    pub fn follow(&mut self, count: u64, segment: &Segment) {
        self.cycle = self.cycle(count);
        self.count = count;
        self.segment = *segment;
    }

    /// Returns whether the instruction after the `count`th is in the present segment, at the address `pc`.
    #[inline]
    #[must_use]
    pub fn goes_on(&self, count: u64, pc: u32) -> bool {
        self.segment.goes_on(count - self.count, pc)
    }

    /// Returns the present segment if its last instruction is the `count`th or an earlier one.
    #[inline]
    #[must_use]
    pub fn ended(&self, count: u64) -> Option<&Segment> {
        let length = self.segment.length();
        (length > 0 && count - self.count >= length).then_some(&self.segment)
    }

    /// Returns the first cycle that ends at `until` or later, if time does not jump and the rate stays the same until
    /// then.
    #[must_use]
    pub fn cycle_at(&self, until: Time) -> u64 {
        let (at, base) = self.at;
        until.checked_sub(at).map_or(0, |span| {
            base.saturating_add(self.hclk_cycle.least(span.as_ps()))
        })
    }

    /// Returns the number of instructions after the `count`th until one ends in cycle `last` or later: 0 if the
    /// `count`th does. The number does not reach beyond the end of the present segment.
    #[must_use]
    pub fn instructions_to(&self, count: u64, last: u64) -> u64 {
        let done = count - self.count;
        let reached = self.segment.reaches(last.saturating_sub(self.cycle));
        reached.saturating_sub(done)
    }

    /// Returns the number of instructions after the `count`th until one ends at `until` or later, as
    /// [`instructions_to`](Self::instructions_to).
    #[must_use]
    pub fn instructions_until(&self, count: u64, until: Time) -> u64 {
        self.instructions_to(count, self.cycle_at(until))
    }

    /// Adds `cycles` of HCLK: the core is stopped for them, or its present instruction takes them in addition.
    #[inline]
    pub fn charge(&mut self, cycles: u32) {
        self.cycle += u64::from(cycles);
    }

    /// Lets time jump to `until` after the `count`th instruction, because the core slept or stalled.
    pub fn jump(&mut self, count: u64, until: Time) {
        let until = until.max(self.time(count));
        let (at, base) = self.since;
        let mut cycle = self.cycle(count);
        if self.hclk != 0 {
            cycle = cycle.max(base + self.hclk_cycle.whole((until - at).as_ps()));
        }
        self.anchor(count, until, cycle);
    }

    /// Lets the clock jump to `cycle`, if this is later, because the core's own timer has already reached it.
    pub fn reach_cycle(&mut self, count: u64, cycle: u64) {
        let now = self.time(count);
        self.anchor(count, now, cycle.max(self.cycle(count)));
    }

    /// Restarts the count of instructions at 0 after the `count`th, because the core was reset.
    pub fn restart_count(&mut self, count: u64) {
        self.jump(count, self.time(count));
        self.count = 0;
    }

    /// Sets the rate of HCLK to `hclk` Hz after the `count`th instruction. The present segment keeps its costs. At 0 Hz
    /// no cycle begins, and no instruction may be counted.
    pub fn set_rate(&mut self, count: u64, hclk: u32) {
        let (now, cycle) = (self.time(count), self.cycle(count));
        self.at = (now, cycle);
        self.since = (now, cycle);
        self.hclk = hclk;
        self.hclk_cycle = Ratio::new(PS_PER_S, u64::from(hclk.max(1)));
    }

    fn anchor(&mut self, count: u64, at: Time, cycle: u64) {
        self.at = (at, cycle);
        (self.count, self.cycle) = (count, cycle);
        self.segment = Segment::EMPTY;
    }
}

const PS_PER_S: u64 = 1_000_000_000_000;

/// Duration of a period in picoseconds, as a reduced fraction. The products below fit into 64 bits for times of several
/// days; for longer times they are computed with 128 bits.
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

    /// Returns the duration of `n` periods: floor(n * num / den).
    const fn times(self, n: u64) -> u64 {
        match n.checked_mul(self.num) {
            Some(product) => product / self.den,
            None => (n as u128 * self.num as u128 / self.den as u128) as u64,
        }
    }

    /// Returns the smallest n with `times(n) >= ps`: ceil(ps * den / num).
    fn least(self, ps: u64) -> u64 {
        match ps.checked_mul(self.den) {
            Some(product) => product.div_ceil(self.num),
            None => {
                let wide = (u128::from(ps) * u128::from(self.den)).div_ceil(u128::from(self.num));
                u64::try_from(wide).unwrap_or(u64::MAX)
            }
        }
    }

    /// Returns the largest n with `times(n) <= ps`: one less than the smallest n above it.
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

    fn every_cycle() -> Segment {
        Segment::of_costs(&[1, 3, 2, 12])
    }

    #[test]
    fn time_of_a_cycle_is_exact_after_hours() {
        let mut clock = InstructionClock::new(Time::ZERO, 72_000_000);
        let segment = every_cycle();
        let mut count = 0;
        for _ in 0..100_000 {
            clock.follow(count, &segment);
            count += 4;
        }
        assert_eq!(clock.cycle(count), 1_800_000);
        assert_eq!(clock.time(count), Time::from_ms(25));
        let cycles = 72_000_000 * 3_600 * 5;
        assert_eq!(clock.time_of_cycle(cycles), Time::from_secs(3_600 * 5));
    }

    #[test]
    fn instructions_until_returns_the_smallest_number() {
        for hclk in [72_000_000, 8_000_000, 64_000_000] {
            let mut clock = InstructionClock::new(Time::from_us(7), hclk);
            clock.follow(0, &every_cycle());
            for ps in [1, 999, 13_888, 13_889, 62_500, 125_000, 200_000] {
                let until = Time::from_us(7) + Time::from_ps(ps);
                let n = clock.instructions_until(0, until);
                assert!(clock.time(n) >= until || n == 4, "{hclk} {ps}: {n}");
                assert!(clock.time(n - 1) < until, "{hclk} {ps}: {n}");
            }
            assert_eq!(clock.instructions_until(3, Time::MAX), 1);
        }
    }

    #[test]
    fn charge_delays_the_following_instructions() {
        let mut clock = InstructionClock::new(Time::ZERO, 1_000_000);
        clock.follow(0, &every_cycle());
        clock.charge(5);
        assert_eq!(clock.cycle(2), 5 + 4);
        assert_eq!(clock.time(2), Time::from_us(9));
    }

    #[test]
    fn jump_moves_time_and_cycles_together() {
        let mut clock = InstructionClock::new(Time::ZERO, 72_000_000);
        clock.jump(10, Time::from_ms(30));
        assert_eq!(clock.time(10), Time::from_ms(30));
        assert_eq!(clock.cycle(10), 72_000 * 30);
        assert_eq!(clock.time_of_cycle(72_000 * 31), Time::from_ms(31));
        clock.set_rate(10, 8_000_000);
        clock.jump(10, Time::from_ms(40));
        assert_eq!(clock.cycle(10), 72_000 * 30 + 8_000 * 10);
        clock.restart_count(10);
        assert_eq!(clock.time(0), Time::from_ms(40));
        assert_eq!(clock.cycle(0), 72_000 * 30 + 8_000 * 10);
    }
}
