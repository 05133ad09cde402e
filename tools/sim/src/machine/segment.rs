//! A stretch of code without a branch in it, and what its instructions cost.
//!
//! The core runs a segment at a time: up to an instruction that may branch, change what interrupts are masked, or
//! wait. Whether a branch was taken is seen afterwards, by where the core is.

mod made;

use std::num::NonZero;
use std::sync::Arc;

use self::made::Made;
use super::costs::Pace;
pub use super::decode::End;
use super::decode::{Class, decode};

/// The most instructions of a segment.
const MOST: usize = 24;
/// Bytes that the flash reads together (PM0075), and that the core fetches from SRAM together.
const LINE: u32 = 8;
const WORD: u32 = 4;

/// Where a segment starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The address of its first instruction.
    pub start: u32,
    /// In flash, or else in SRAM.
    pub in_flash: bool,
    /// A branch has led there, whose cost contains the fetch.
    pub branched: bool,
}

/// A segment of code with the cycles its instructions take.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Where it starts, and how many bytes it was made from.
    start: u32,
    size: u8,
    /// Instructions.
    length: u8,
    /// How it ends.
    pub end: End,
    /// Cycles when as many instructions have ended, and where the next one is, from the start.
    costs: [u16; MOST + 1],
    offsets: [u8; MOST + 1],
}

impl Segment {
    /// No code: an instruction that is counted nevertheless takes a cycle.
    pub const EMPTY: Self = Self {
        start: 0,
        size: 0,
        length: 0,
        end: End::Sequential,
        costs: [0; MOST + 1],
        offsets: [0; MOST + 1],
    };

    /// The segment at `place`, whose bytes are `code`.
    #[must_use]
    pub fn new(place: Place, code: &[u8], pace: &Pace) -> Self {
        let Place {
            start, in_flash, ..
        } = place;
        let mut segment = Self {
            start,
            ..Self::EMPTY
        };
        let half = |at: usize| {
            let bytes = code.get(at..at + 2)?;
            Some(u16::from_le_bytes([bytes[0], bytes[1]]))
        };
        let mut fetch = Fetch::new(place);
        let mut after_access = false;
        let (mut at, mut cycles) = (0, 0);
        while usize::from(segment.length) < MOST {
            let Some(first) = half(at) else { break };
            let (size, class, end) = decode(first, half(at + 2).unwrap_or(0));
            cycles += fetch.wait(start + at as u32, size, cycles, pace);
            let literal = matches!(class, Class::Literal | Class::Table);
            cycles += cost(class, after_access, in_flash, pace);
            after_access = matches!(class, Class::Load | Class::Store) || literal;
            at += size as usize;
            segment.length += 1;
            segment.costs[usize::from(segment.length)] = cycles as u16;
            segment.offsets[usize::from(segment.length)] = at as u8;
            segment.end = end;
            if end != End::Sequential {
                break;
            }
        }
        segment.size = at.min(code.len()) as u8;
        segment
    }

    /// A segment of instructions that take so many cycles each.
    #[cfg(test)]
    pub fn of_costs(costs: &[u16]) -> Self {
        let mut segment = Self::EMPTY;
        for cost in costs {
            let before = segment.costs[usize::from(segment.length)];
            segment.length += 1;
            segment.costs[usize::from(segment.length)] = before + cost;
        }
        segment
    }

    /// Whether the segment has an instruction after its first `n`, and this instruction is at `pc`.
    #[inline]
    #[must_use]
    pub fn goes_on(&self, n: u64, pc: u32) -> bool {
        n < self.length() && self.start + u32::from(self.offsets[n as usize]) == pc
    }

    /// Instructions in it.
    #[inline]
    #[must_use]
    pub fn length(&self) -> u64 {
        u64::from(self.length)
    }

    /// The address after its last instruction.
    #[inline]
    #[must_use]
    pub fn after(&self) -> u32 {
        self.start + u32::from(self.size)
    }

    /// The cycles of its first `n` instructions; beyond its end one each.
    #[inline]
    #[must_use]
    pub fn cycles(&self, n: u64) -> u64 {
        let beyond = n.saturating_sub(self.length());
        u64::from(self.costs[(n - beyond) as usize]) + beyond
    }

    /// The least number of its instructions that take `cycles` or more; all of them when that is not enough.
    #[inline]
    #[must_use]
    pub fn reaches(&self, cycles: u64) -> u64 {
        let costs = &self.costs[..=usize::from(self.length)];
        if costs.last().is_none_or(|&all| u64::from(all) < cycles) {
            return self.length();
        }
        let n = costs.partition_point(|&cost| u64::from(cost) < cycles);
        n as u64
    }
}

/// The fetches of code in sequence.
struct Fetch {
    in_flash: bool,
    /// The line or word fetched last, and the cycle in which its first instruction began.
    unit: u32,
    since: i32,
    /// The first unit of a segment that begins at the unit's start follows another one in sequence.
    fresh: bool,
}

impl Fetch {
    fn new(place: Place) -> Self {
        let size = if place.in_flash { LINE } else { WORD };
        // Of a line entered before, each half-word has taken a cycle.
        let before = if place.branched {
            0
        } else {
            place.start % size / 2
        };
        Self {
            in_flash: place.in_flash,
            unit: place.start / size,
            since: -(before as i32),
            fresh: !place.branched && place.start.is_multiple_of(size),
        }
    }

    /// How long the core waits for an instruction of `size` bytes at `address`, in cycle `cycle`.
    fn wait(&mut self, address: u32, size: u32, cycle: u32, pace: &Pace) -> u32 {
        let unit = if self.in_flash { LINE } else { WORD };
        let last = (address + size - 1) / unit;
        let entered = last - self.unit + u32::from(core::mem::take(&mut self.fresh));
        if entered == 0 {
            return 0;
        }
        let first = last == self.unit;
        let cycle = cycle as i32;
        let spent = (cycle - self.since) as u32;
        (self.unit, self.since) = (last, cycle);
        if !self.in_flash {
            return entered * pace.costs.sram_fetch;
        }
        if !pace.prefetch {
            // Each word of a line is read on its own.
            return entered * (LINE / WORD) * pace.wait_states;
        }
        let overlapped = if !pace.costs.overlapped_fetch {
            0
        } else if first {
            // The segment before this one covered it.
            pace.wait_states
        } else {
            spent.saturating_sub(1)
        };
        let wait = pace.wait_states.saturating_sub(overlapped);
        self.since += wait as i32;
        wait
    }
}

/// What an instruction costs, its fetch aside. A branch counts as not taken.
fn cost(class: Class, after_access: bool, in_flash: bool, pace: &Pace) -> u32 {
    let costs = &pace.costs;
    let shared = if in_flash { 0 } else { costs.shared_bus };
    let load = if after_access {
        costs.next_load
    } else {
        costs.load
    };
    // Reads of flash that the bus charges are not charged here.
    let constant = if in_flash && !costs.charges_tables {
        pace.flash_read()
    } else {
        0
    };
    match class {
        Class::Simple => 1,
        Class::Load => load + shared,
        Class::Literal => load + shared + constant,
        Class::Table => 2 + shared + constant,
        Class::Store => costs.store + shared,
        Class::Multiple(n) => 1 + n * (1 + shared),
        Class::Accumulate => costs.accumulate,
        Class::LongMultiply => costs.long_multiply,
        Class::LongAccumulate => costs.long_accumulate,
        Class::Divide => costs.divide,
        Class::System => costs.system,
        Class::Barrier => costs.barrier,
        Class::Refill => 1 + pace.taken(in_flash),
    }
}

/// The segments made so far, by where they start.
#[derive(Debug)]
pub struct Segments {
    pace: Pace,
    kept: Vec<Kept>,
}

/// A segment, and what a lookup needs. It is small, because every machine has its table of these.
#[derive(Clone, Debug, Default)]
struct Kept {
    start: u32,
    branched: bool,
    /// The memory's count of changes when the code was last the same, if it counts them.
    changes: Option<NonZero<u64>>,
    made: Option<Arc<Made>>,
}

impl Segments {
    /// Places for segments: a power of two.
    const PLACES: usize = 1 << 14;

    /// None, for a core with these costs.
    #[must_use]
    pub fn new(pace: Pace) -> Self {
        Self {
            pace,
            kept: vec![Kept::default(); Self::PLACES],
        }
    }

    /// What code costs now.
    #[inline]
    #[must_use]
    pub fn pace(&self) -> &Pace {
        &self.pace
    }

    /// FLASH_ACR holds these now.
    pub fn set_flash(&mut self, wait_states: u32, prefetch: bool) {
        let pace = Pace {
            wait_states,
            prefetch,
            ..self.pace
        };
        if pace != self.pace {
            *self = Self::new(pace);
        }
    }

    /// The segment at `place`, whose bytes are `code`. They are the same as long as `changes` is.
    #[inline]
    pub fn at(&mut self, place: Place, code: &[u8], changes: Option<NonZero<u64>>) -> &Segment {
        let index = (place.start | u32::from(place.branched)) as usize % Self::PLACES;
        let kept = &mut self.kept[index];
        let known = (kept.start, kept.branched) == (place.start, place.branched)
            && (changes.is_some() && changes == kept.changes
                || kept.made.as_ref().is_some_and(|made| made.is_of(code)));
        if !known {
            kept.made = None;
            (kept.start, kept.branched) = (place.start, place.branched);
        }
        kept.changes = changes;
        let made = kept
            .made
            .get_or_insert_with(|| made::shared(place, code, &self.pace));
        &made.segment
    }
}
