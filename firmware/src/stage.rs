//! The stage between the coils of a port and its terminals: dead time of a pair, longest time on, shortest time off.
//!
//! A *coil* is what masters, links, SAFE and START want of a digital output, a *terminal* is what the output has. Channels
//! 1 and 2 of a port are a *pair* while channel 1 has a DEAD_TIME, channels 3 and 4 while channel 3 has one. The coils of a
//! pair are never both on, and a terminal goes on only when the other one has been off for DEAD_TIME.
//!
//! Masks have channel 1 in bit 0. This module does not know hardware, registers or links.

use modio_drivers::CHANNELS;

/// A master who gives 1 again to an output that is on repeats himself. For this time in ms after his last repetition, a
/// further 1 is a repetition too, also when MAX_ON has switched the output off in between.
const REPEAT_MS: u32 = 60_000;

/// The first channels of the pairs.
const FIRST_OF_PAIRS: u8 = 0b0101;

/// The times of an output, in ms; 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// Time between the two outputs of a pair, at its first channel.
    pub dead: u32,
    /// Longest time on.
    pub max_on: u32,
    /// Shortest time off.
    pub min_off: u32,
}

/// Outputs that level links hold, and those of them that are held on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held {
    /// Outputs that are held.
    pub outputs: u8,
    /// Outputs that are held on.
    pub on: u8,
}

/// An output of the stage.
#[derive(Clone, Copy, Debug)]
struct Output {
    /// DEAD_TIME is at both channels of a pair.
    times: Times,
    /// Time in ms since the terminal has changed or began to be kept off, up to the largest value.
    since: u32,
    /// Time in ms since a master repeated himself, up to the largest value.
    repeated: u32,
}

/// The stage of the outputs of one port.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// Digital outputs.
    digital: u8,
    outputs: [Output; CHANNELS],
    /// Channels of pairs.
    paired: u8,
    /// Channels for which a time is set, and those of pairs.
    staged: u8,
    /// Terminals that are on.
    terminals: u8,
    /// Outputs that MAX_ON has ended.
    ended: u8,
    /// Outputs that wait: the coil is on, the terminal is not.
    waiting: u8,
    /// What level links hold.
    held: Held,
    /// Terminals whose time began between two milliseconds, which does not count.
    fresh: u8,
}

impl Stage {
    /// Returns the stage of these digital outputs, without times: it does nothing. All terminals are off.
    #[must_use]
    pub const fn new(digital: u8) -> Self {
        Self {
            digital,
            outputs: [Output {
                times: Times {
                    dead: 0,
                    max_on: 0,
                    min_off: 0,
                },
                since: 0,
                repeated: u32::MAX,
            }; CHANNELS],
            paired: 0,
            staged: 0,
            terminals: 0,
            ended: 0,
            waiting: 0,
            held: Held { outputs: 0, on: 0 },
            fresh: 0,
        }
    }

    /// Sets the times of a channel, which have no effect for one that is no digital output. Outputs whose times change begin
    /// anew. Returns the coils.
    #[must_use]
    pub fn set(&mut self, coils: u8, channel: usize, times: Times) -> u8 {
        let one = 1 << channel;
        let pair = one | partners(one);
        let times = if self.digital & one == 0 {
            Times::default()
        } else {
            times
        };
        let dead = if pair & !self.digital == 0 {
            times.dead
        } else {
            0
        };
        let is_first = one & FIRST_OF_PAIRS != 0;
        let is_same = |of: Times| {
            (!is_first || of.dead == dead)
                && (of.max_on, of.min_off) == (times.max_on, times.min_off)
        };
        if self
            .outputs
            .get(channel)
            .is_none_or(|output| is_same(output.times))
        {
            return coils;
        }
        let (mut changed, mut paired, mut staged) = (0, 0, 0);
        for (other, output) in self.outputs.iter_mut().enumerate() {
            let (bit, of) = (1 << other, &mut output.times);
            let before = *of;
            if bit == one {
                (of.max_on, of.min_off) = (times.max_on, times.min_off);
            }
            if is_first && bit & pair != 0 {
                of.dead = dead;
            }
            if *of != before {
                changed |= bit;
            }
            if of.dead > 0 {
                paired |= bit;
            }
            if *of != Times::default() {
                staged |= bit;
            }
        }
        if self.staged == 0 {
            // As they were without the stage.
            (self.terminals, self.ended) = (coils & self.digital, 0);
            for output in &mut self.outputs {
                (output.since, output.repeated) = (u32::MAX, u32::MAX);
            }
        }
        (self.paired, self.staged) = (paired, staged);
        self.terminals &= !changed;
        self.ended &= !changed;
        self.start_times(changed, true);
        coils & !changed
    }

    /// Returns the digital outputs.
    #[must_use]
    pub const fn digital(&self) -> u8 {
        self.digital
    }

    /// Returns whether there is nothing to do, because no output has a time: then the terminals are as the coils.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.staged | self.fresh == 0
    }

    /// Returns the terminals that are on.
    #[must_use]
    pub const fn terminals(&self) -> u8 {
        self.terminals
    }

    /// Returns the outputs that MAX_ON has ended, until the next order.
    #[must_use]
    pub const fn ended(&self) -> u8 {
        self.ended
    }

    /// Returns the outputs that are to be on, and waited in the last scan.
    #[must_use]
    pub const fn waiting(&self) -> u8 {
        self.waiting
    }

    /// Returns the coils after an order of one instant for the outputs `named`, those of `on` to 1: START, SAFE, or the
    /// edge links of one scan. Outputs that level links hold take no orders. Of a pair the newer order wins; an order for
    /// both to be on is one for neither.
    #[must_use]
    pub fn order(&mut self, coils: u8, named: u8, on: u8) -> u8 {
        let named = named & !self.held.outputs;
        let on = on & named;
        self.ended &= !named;
        resolved(coils & !named | on, on, self.paired)
    }

    /// Returns the coils after a request of a master, as [`order`](Self::order). A master who gives 1 to an output that is
    /// on repeats himself: after the end by MAX_ON such a 1 is no order.
    #[must_use]
    pub fn request(&mut self, coils: u8, named: u8, on: u8) -> u8 {
        let on = on & named;
        let mut repeats = 0;
        for (channel, output) in self.outputs.iter_mut().enumerate() {
            let bit = on & 1 << channel;
            let recent = coils
                | if output.repeated < REPEAT_MS {
                    self.ended
                } else {
                    0
                };
            if bit & recent != 0 {
                output.repeated = 0;
                repeats |= bit;
            }
        }
        let ignored = repeats & self.ended;
        let cancelled = both(on, self.paired) & (ignored | partners(ignored));
        self.order(coils, named & !ignored, on & !ignored & !cancelled)
    }

    /// Takes what level links hold from now on. An output that MAX_ON has ended may go on again when a link begins to hold it,
    /// and after its link has wanted 0.
    pub fn take_held(&mut self, held: Held) {
        self.ended &= !(held.outputs & !(self.held.outputs & held.on));
        self.held = held;
    }

    /// Returns the coils with what level links hold.
    #[must_use]
    pub const fn hold(&self, coils: u8) -> u8 {
        let on = self.held.on & !self.ended;
        resolved(coils & !self.held.outputs | on, on, self.paired)
    }

    /// Runs the stage behind the links of a scan, `ms` milliseconds after the scan before, 0 for a scan because of a write.
    /// `manual`: outputs that are switched by hand. Returns the coils.
    #[must_use]
    pub fn scan(&mut self, coils: u8, manual: u8, ms: u32) -> u8 {
        let mut coils = self.hold(coils);
        if self.is_idle() {
            (self.terminals, self.waiting) = (coils, 0);
            return coils;
        }
        let paired = self.paired;

        let (mut over, mut rested, mut apart) = (0, 0, !paired);
        for (channel, output) in self.outputs.iter_mut().enumerate() {
            let bit = 1 << channel;
            if ms > 0 {
                let fresh = u32::from(self.fresh & bit != 0);
                output.since = output.since.saturating_add(ms - fresh);
                output.repeated = output.repeated.saturating_add(ms);
            }
            let Times {
                dead,
                max_on,
                min_off,
            } = output.times;
            if max_on > 0 && output.since >= max_on {
                over |= bit;
            }
            if output.since >= min_off.max(1) {
                rested |= bit;
            }
            if output.since >= dead {
                apart |= partners(bit);
            }
        }
        if ms > 0 {
            self.fresh = 0;
        }

        let too_long = over & self.terminals & coils;
        coils &= !too_long;
        self.ended |= too_long;

        let by_hand = manual & self.staged;
        let wanted = coils & !(by_hand | partners(by_hand) & paired);
        let off = self.terminals & !wanted | by_hand;
        let on = wanted & rested & apart & !self.terminals & !(partners(off) & paired);
        self.terminals = self.terminals & !off | on;
        self.waiting = coils & !self.terminals;
        self.start_times(off | on, ms == 0);
        coils
    }

    /// Begins the times of these terminals anew. `between`: between two milliseconds.
    fn start_times(&mut self, terminals: u8, between: bool) {
        self.fresh = self.fresh & !terminals | if between { terminals } else { 0 };
        for (channel, output) in self.outputs.iter_mut().enumerate() {
            if terminals >> channel & 1 != 0 {
                output.since = 0;
            }
        }
    }
}

/// Returns the other channels of the pairs of these.
const fn partners(channels: u8) -> u8 {
    (channels & FIRST_OF_PAIRS) << 1 | channels >> 1 & FIRST_OF_PAIRS
}

/// Returns the channels of the pairs of which both are among these.
const fn both(channels: u8, paired: u8) -> u8 {
    channels & partners(channels) & paired
}

/// Returns the coils without those of which both of a pair are on, but the one of them that alone is in `on`.
const fn resolved(coils: u8, on: u8, paired: u8) -> u8 {
    let winners = on & !both(on, paired);
    let both = both(coils, paired);
    coils & !both | winners & both
}
