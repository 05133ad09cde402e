//! The time base of a timer: prescaler, counter and the values they are compared with, up-counting
//! (RM0008 15.3.1, 15.3.2).
//!
//! The counter is not simulated cycle by cycle. Each read calculates it from whole cycles of the timer clock since
//! an anchor, so it is exact however rarely it is read.

use crate::time::Time;

/// The update flag, UIF, as [`Counter::run`] reports it; the compare flags CC1IF to CC4IF follow it.
pub const UPDATE: u32 = 1;

/// Returns the compare flag of channel `n`, 0 to 3.
pub const fn compare(n: usize) -> u32 {
    2 << n
}

/// A register with a shadow that takes its value at the update event.
#[derive(Clone, Copy, Debug, Default)]
pub struct Buffered {
    /// The value that the program wrote.
    pub preload: u32,
    /// The value that the counter uses.
    pub active: u32,
}

impl Buffered {
    /// Writes the preload register, and the active one too unless `buffered`.
    pub fn write(&mut self, value: u32, buffered: bool) {
        self.preload = value;
        if !buffered {
            self.active = value;
        }
    }

    const fn load(&mut self) {
        self.active = self.preload;
    }
}

/// Prescaler, counter, reload and compare values.
#[derive(Clone, Debug)]
pub struct Counter {
    hz: u32,
    anchor: Time,
    /// Cycles since `anchor` that have been counted.
    done: u64,
    /// CEN.
    pub running: bool,
    /// OPM: the next update event clears `running`.
    pub one_pulse: bool,
    /// UDIS: no update events.
    pub no_updates: bool,
    count: u32,
    prescaler: u32,
    /// PSC: always buffered.
    pub divider: Buffered,
    /// ARR.
    pub reload: Buffered,
    /// CCR1 to CCR4.
    pub compare: [Buffered; 4],
}

impl Counter {
    /// Returns a stopped counter at 0, as after reset.
    pub fn new(hz: u32, now: Time) -> Self {
        Self {
            hz,
            anchor: now,
            done: 0,
            running: false,
            one_pulse: false,
            no_updates: false,
            count: 0,
            prescaler: 0,
            divider: Buffered::default(),
            reload: Buffered {
                preload: 0xFFFF,
                active: 0xFFFF,
            },
            compare: [Buffered::default(); 4],
        }
    }

    /// Returns CNT.
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// Writes CNT; the prescaler keeps its count.
    pub const fn set_count(&mut self, count: u32) {
        self.count = count;
    }

    /// Changes the timer clock.
    pub fn set_clock(&mut self, hz: u32, now: Time) -> u32 {
        let flags = self.run(now);
        self.hz = hz;
        self.anchor = now;
        self.done = 0;
        flags
    }

    /// Starts the counter, one cycle after CEN is set (15.3.1).
    pub fn start(&mut self) {
        if !self.running {
            self.running = true;
            self.done += 1;
        }
    }

    /// Handles UG: restarts counter and prescaler, with an update event unless update events are disabled (15.4.6).
    /// Returns the compare flags; the caller decides about the update flag (URS).
    pub fn restart(&mut self) -> u32 {
        self.count = 0;
        self.prescaler = 0;
        self.update();
        self.matches(0, 0)
    }

    /// Counts up to `now` and returns the flags raised on the way: [`UPDATE`] and [`compare`].
    pub fn run(&mut self, now: Time) -> u32 {
        let target = now.saturating_sub(self.anchor).in_cycles(self.hz);
        let mut cycles = target.saturating_sub(self.done);
        self.done = self.done.max(target);
        let mut flags = 0;
        while cycles > 0 && self.counts() {
            let to_wrap = self.cycles_to_wrap();
            if cycles < to_wrap {
                flags |= self.within(cycles);
                break;
            }
            cycles -= to_wrap;
            flags |= self.wrap();
            cycles = self.skip(cycles, &mut flags);
        }
        flags
    }

    /// Returns the instant at which one of the `wanted` flags may rise next. At that instant it rises, or the instant
    /// has to be computed again.
    pub fn next(&self, wanted: u32) -> Option<Time> {
        if wanted == 0 || !self.counts() || self.hz == 0 {
            return None;
        }
        let mut cycles = self.cycles_to_wrap();
        for (n, value) in self.compare.iter().enumerate() {
            if wanted & compare(n) != 0 && value.active > self.count && value.active <= self.top() {
                cycles = cycles.min(self.cycles_to(value.active));
            }
        }
        Some(self.anchor + Time::cycles(self.done + cycles, self.hz))
    }

    /// Returns whether the counter moves: it is blocked while the reload value is 0 (15.4.12).
    const fn counts(&self) -> bool {
        self.running && self.reload.active != 0
    }

    fn period(&self) -> u64 {
        u64::from(self.divider.active) + 1
    }

    /// Returns the last value before the counter wraps. A counter that is already past the reload value counts up to
    /// its maximum.
    const fn top(&self) -> u32 {
        if self.count <= self.reload.active {
            self.reload.active
        } else {
            0xFFFF
        }
    }

    /// Returns the cycles until the counter reaches `value`, which is above it.
    fn cycles_to(&self, value: u32) -> u64 {
        u64::from(value - self.count) * self.period() - u64::from(self.prescaler)
    }

    fn cycles_to_wrap(&self) -> u64 {
        self.cycles_to(self.top() + 1)
    }

    /// Counts `cycles`, fewer than up to the wrap.
    fn within(&mut self, cycles: u64) -> u32 {
        let total = u64::from(self.prescaler) + cycles;
        let from = self.count;
        self.count += (total / self.period()) as u32;
        self.prescaler = (total % self.period()) as u32;
        if self.count == from {
            return 0;
        }
        self.matches(from + 1, self.count)
    }

    /// Counts up to the wrap and over it.
    fn wrap(&mut self) -> u32 {
        let top = self.top();
        let mut flags = if self.count < top {
            self.matches(self.count + 1, top)
        } else {
            0
        };
        self.count = 0;
        self.prescaler = 0;
        if top == self.reload.active {
            // A compare value past the reload value matches at the overflow (15.4.5, CC1IF).
            flags |= self.matches(top + 1, 0xFFFF);
            if self.update() {
                flags |= UPDATE;
            }
        }
        flags | self.matches(0, 0)
    }

    /// Skips whole identical periods. Each of them raises every flag that can rise.
    fn skip(&self, cycles: u64, flags: &mut u32) -> u64 {
        if !self.counts() || self.count != 0 || self.prescaler != 0 {
            return cycles;
        }
        let whole = (u64::from(self.reload.active) + 1) * self.period();
        if cycles >= whole {
            *flags |= self.matches(0, 0xFFFF);
            if !self.no_updates {
                *flags |= UPDATE;
            }
        }
        cycles % whole
    }

    /// Makes the update event: loads the buffered registers and stops a one-pulse counter. Returns `false` when update
    /// events are disabled.
    fn update(&mut self) -> bool {
        if self.no_updates {
            return false;
        }
        self.divider.load();
        self.reload.load();
        self.compare.iter_mut().for_each(Buffered::load);
        if self.one_pulse {
            self.running = false;
        }
        true
    }

    /// Returns the compare flags of the channels whose value is in `from..=to`.
    fn matches(&self, from: u32, to: u32) -> u32 {
        self.compare
            .iter()
            .enumerate()
            .filter(|(_, value)| (from..=to).contains(&value.active))
            .map(|(n, _)| compare(n))
            .sum()
    }
}
