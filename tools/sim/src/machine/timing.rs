//! The core's clock: from a count of instructions to cycles of HCLK and to the virtual time.
//!
//! What an instruction costs is in [`costs`](super::costs); how the costs of a stretch of code add up is in
//! [`segment`](super::segment).

use super::segment::Segment;
use crate::time::Time;

/// The highest SYSCLK in Hz that `wait_states` are enough for (RM0008 3.3.3), the crystal's tolerance included.
#[must_use]
pub const fn highest_sysclk(wait_states: u32) -> u32 {
    match wait_states {
        0 => 24_000_000,
        1 => 48_000_000,
        _ => crate::periph::clocks::MAX_SYSCLK,
    }
}

/// Turns a count of instructions into the virtual time and into cycles of HCLK.
///
/// Cycles are counted from an anchor, the last instant at which time jumped or the rate changed, and time is
/// worked out from the anchor in whole numbers, so it does not drift.
#[derive(Clone, Copy, Debug)]
pub struct InstructionClock {
    hclk: u32,
    /// Picoseconds of a cycle.
    hclk_cycle: Ratio,
    /// The anchor: this instant, in this cycle.
    at: (Time, u64),
    /// This many instructions had ended in this cycle, and the code that follows them.
    count: u64,
    cycle: u64,
    segment: Segment,
    /// Since when HCLK runs at this rate: an instant and its cycle.
    since: (Time, u64),
}

impl InstructionClock {
    /// A clock that starts at `at` with no instruction done.
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

    /// When the `count`th instruction ends.
    #[inline]
    #[must_use]
    pub fn time(&self, count: u64) -> Time {
        let (at, base) = self.at;
        at + Time::from_ps(self.hclk_cycle.times(self.cycle(count) - base))
    }

    /// The cycle of HCLK in which the `count`th instruction ends.
    #[inline]
    #[must_use]
    pub fn cycle(&self, count: u64) -> u64 {
        self.cycle + self.segment.cycles(count - self.count)
    }

    /// When cycle `cycle` of HCLK begins, at the present rate.
    #[inline]
    #[must_use]
    pub fn time_of_cycle(&self, cycle: u64) -> Time {
        let (at, base) = self.since;
        if self.hclk == 0 {
            return if cycle > base { Time::MAX } else { at };
        }
        at + Time::from_ps(self.hclk_cycle.times(cycle.saturating_sub(base)))
    }

    /// After the `count`th instruction the core executes `segment`.
    #[inline]
    pub fn follow(&mut self, count: u64, segment: &Segment) {
        self.cycle = self.cycle(count);
        self.count = count;
        self.segment = *segment;
    }

    /// Whether the instruction after the `count`th belongs to the code that is followed, and is at `pc`.
    #[inline]
    #[must_use]
    pub fn goes_on(&self, count: u64, pc: u32) -> bool {
        self.segment.goes_on(count - self.count, pc)
    }

    /// The code that is followed, when it has ended with the `count`th instruction.
    #[inline]
    #[must_use]
    pub fn ended(&self, count: u64) -> Option<&Segment> {
        let length = self.segment.length();
        (length > 0 && count - self.count >= length).then_some(&self.segment)
    }

    /// The first cycle that does not end before `until`, while time does not jump and the rate stays.
    #[must_use]
    pub fn cycle_at(&self, until: Time) -> u64 {
        let (at, base) = self.at;
        until.checked_sub(at).map_or(0, |span| {
            base.saturating_add(self.hclk_cycle.least(span.as_ps()))
        })
    }

    /// How many instructions after the `count`th, but not beyond the code that is followed, the first one ends
    /// in cycle `last` or later: 0 when the `count`th does.
    #[must_use]
    pub fn instructions_to(&self, count: u64, last: u64) -> u64 {
        let done = count - self.count;
        let reached = self.segment.reaches(last.saturating_sub(self.cycle));
        reached.saturating_sub(done)
    }

    /// The same for the first one that ends at `until` or later.
    #[must_use]
    pub fn instructions_until(&self, count: u64, until: Time) -> u64 {
        self.instructions_to(count, self.cycle_at(until))
    }

    /// The core stands still for `cycles` of HCLK, or the instruction under way takes as many more.
    #[inline]
    pub fn charge(&mut self, cycles: u32) {
        self.cycle += u64::from(cycles);
    }

    /// Nothing was executed up to `until`, after the `count`th instruction: the core waited or stalled.
    pub fn jump(&mut self, count: u64, until: Time) {
        let until = until.max(self.time(count));
        let (at, base) = self.since;
        let mut cycle = self.cycle(count);
        if self.hclk != 0 {
            cycle = cycle.max(base + self.hclk_cycle.whole((until - at).as_ps()));
        }
        self.anchor(count, until, cycle);
    }

    /// The core's own timer has reached `cycle`: no instruction sees an earlier one.
    pub fn reach_cycle(&mut self, count: u64, cycle: u64) {
        let now = self.time(count);
        self.anchor(count, now, cycle.max(self.cycle(count)));
    }

    /// The core was reset: it counts its instructions from 0 again.
    pub fn restart_count(&mut self, count: u64) {
        self.jump(count, self.time(count));
        self.count = 0;
    }

    /// From the `count`th instruction on HCLK runs at `hclk` Hz. The code followed keeps its costs. At 0 Hz no
    /// cycle comes; no instruction may be counted then.
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

    fn every_cycle() -> Segment {
        Segment::of_costs(&[1, 3, 2, 12])
    }

    #[test]
    fn cycles_take_their_share_exactly_for_hours() {
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
    fn the_number_of_instructions_until_an_instant_is_the_smallest() {
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
    fn a_charge_moves_what_follows() {
        let mut clock = InstructionClock::new(Time::ZERO, 1_000_000);
        clock.follow(0, &every_cycle());
        clock.charge(5);
        assert_eq!(clock.cycle(2), 5 + 4);
        assert_eq!(clock.time(2), Time::from_us(9));
    }

    #[test]
    fn a_jump_moves_time_and_cycles_together() {
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
