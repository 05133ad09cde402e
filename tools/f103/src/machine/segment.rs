//! Segments: code without a branch in it, and the cycles that its instructions take.
//!
//! The core runs one segment at a time, up to an instruction that may branch, mask interrupts, or wait. The address of
//! the core afterwards shows whether a branch was taken.

mod made;

use std::num::NonZero;
use std::sync::Arc;

use self::made::Made;
pub use super::decode::End;
use super::decode::{Class, decode};
use crate::costs::Pace;

/// Largest number of instructions in a segment.
const MOST: usize = 24;
/// Number of bytes that one read of the flash returns (PM0075), and that one fetch from SRAM returns.
const LINE: u32 = 8;
const WORD: u32 = 4;

/// Start of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// Address of the first instruction.
    pub start: u32,
    /// Whether the address is in flash; otherwise it is in SRAM.
    pub in_flash: bool,
    /// Whether a branch has led there. The branch's cost contains the first fetch.
    pub branched: bool,
}

/// A segment of code, with the cycles that its instructions take.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Address of the first instruction.
    start: u32,
    /// Length in bytes.
    size: u8,
    /// Number of instructions.
    length: u8,
    /// How the segment ends.
    pub end: End,
    /// Cycles after N instructions, and the offset of the next instruction from the start, by N.
    costs: [u16; MOST + 1],
    offsets: [u8; MOST + 1],
}

impl Segment {
    /// A segment without code. Instructions that are executed nevertheless take one cycle each.
    pub const EMPTY: Self = Self {
        start: 0,
        size: 0,
        length: 0,
        end: End::Sequential,
        costs: [0; MOST + 1],
        offsets: [0; MOST + 1],
    };

    /// Returns the segment that starts at `place`. `code` begins with its bytes.
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

    /// Returns a segment whose instructions take these numbers of cycles.
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

    /// Returns whether the segment has an instruction after its first `n`, and this instruction is at `pc`.
    #[inline]
    #[must_use]
    pub fn goes_on(&self, n: u64, pc: u32) -> bool {
        n < self.length() && self.start + u32::from(self.offsets[n as usize]) == pc
    }

    /// Returns the number of instructions.
    #[inline]
    #[must_use]
    pub fn length(&self) -> u64 {
        u64::from(self.length)
    }

    /// Returns the address after the last instruction.
    #[inline]
    #[must_use]
    pub fn after(&self) -> u32 {
        self.start + u32::from(self.size)
    }

    /// Returns the cycles of the first `n` instructions. Instructions after the segment's end take one cycle each.
    #[inline]
    #[must_use]
    pub fn cycles(&self, n: u64) -> u64 {
        let beyond = n.saturating_sub(self.length());
        u64::from(self.costs[(n - beyond) as usize]) + beyond
    }

    /// Returns the smallest number of instructions that take at least `cycles`, or all when they take less.
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

/// State of the fetches while code runs in sequence.
struct Fetch {
    in_flash: bool,
    /// Number of the line or word that was fetched last, and the cycle in which its first instruction began.
    unit: u32,
    since: i32,
    /// Whether the segment begins at the start of a line or word and follows another segment in sequence, so that its
    /// first fetch is still to be charged.
    fresh: bool,
}

impl Fetch {
    fn new(place: Place) -> Self {
        let size = if place.in_flash { LINE } else { WORD };
        // When the segment before has entered this line, each half-word before the start has taken a cycle.
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

    /// Returns how many cycles the core waits for an instruction of `size` bytes at `address`, in cycle `cycle`.
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
            // Without prefetch, the core reads each word of a line separately.
            return entered * (LINE / WORD) * pace.wait_states;
        }
        let overlapped = if !pace.costs.overlapped_fetch {
            0
        } else if first {
            // The wait has passed during the segment before.
            pace.wait_states
        } else {
            spent.saturating_sub(1)
        };
        let wait = pace.wait_states.saturating_sub(overlapped);
        self.since += wait as i32;
        wait
    }
}

/// Returns the cycles of an instruction, without its fetch. A branch is counted as not taken.
fn cost(class: Class, after_access: bool, in_flash: bool, pace: &Pace) -> u32 {
    let costs = &pace.costs;
    let shared = if in_flash { 0 } else { costs.shared_bus };
    let load = if after_access {
        costs.next_load
    } else {
        costs.load
    };
    // Do not charge reads of the flash here when the bus charges them.
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

/// A machine's segments, by start address.
#[derive(Debug)]
pub struct Segments {
    pace: Pace,
    kept: Vec<Kept>,
}

/// A segment, and the values that a lookup compares. This type is small because every machine has a table of them.
#[derive(Clone, Debug, Default)]
struct Kept {
    start: u32,
    branched: bool,
    /// Value of the memory's counter of changes when the code was last compared, if the memory has such a counter.
    changes: Option<NonZero<u64>>,
    made: Option<Arc<Made>>,
}

impl Segments {
    /// Size of the table, a power of two.
    const PLACES: usize = 1 << 14;

    /// Returns an empty table for a core with these costs.
    #[must_use]
    pub fn new(pace: Pace) -> Self {
        Self {
            pace,
            kept: vec![Kept::default(); Self::PLACES],
        }
    }

    /// Returns the current costs of code.
    #[inline]
    #[must_use]
    pub fn pace(&self) -> &Pace {
        &self.pace
    }

    /// Sets the wait states and the prefetch that FLASH_ACR selects. When they change, all segments are dropped.
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

    /// Returns the segment that starts at `place`; `code` begins with its bytes. While `changes` has the same value,
    /// the bytes are the same.
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
