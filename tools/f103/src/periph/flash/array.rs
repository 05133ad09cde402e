//! The flash's cells, and the effect of an operation on them, complete or torn by a power cut or a reset.
//!
//! PM0075 promises nothing about a half-word or a page whose operation was interrupted. The model takes the
//! worst case that a floating-gate cell allows: a cell that was left near the threshold of the sense amplifier
//! reads as 0 or as 1, anew at every read, until its page is completely erased. A complete program of the
//! half-word drives the cells that it programs to 0; the other cells of the half-word do not change.

use core::ops::Range;
use std::collections::BTreeMap;

use crate::memory::Memory;
use crate::part::Part;

/// The result of an interrupted operation. The part guarantees nothing; each choice is the same in every run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Torn {
    /// Each cell that was to change has its own speed, drawn from its place and the part's seed. Cells that
    /// are far from the threshold read as the old or as the new bit; those near it read differently from
    /// read to read.
    #[default]
    Mess,
    /// Nothing has changed yet, however late the cut. Every read gives the old bits.
    Before,
    /// Everything has changed already, however early the cut. Every read gives the new bits.
    After,
}

/// An operation on the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    /// Program the half-word at byte `at` (even).
    Program { at: usize, value: u16 },
    /// Erase a page.
    Page { page: usize },
    /// Erase everything.
    Mass,
}

impl Operation {
    /// Returns the value that the operation gives the byte at `at`, which is `old` now.
    const fn target(self, at: usize, old: u8) -> u8 {
        match self {
            Self::Program { at: start, value } => old & value.to_le_bytes()[at - start],
            Self::Page { .. } | Self::Mass => 0xFF,
        }
    }
}

/// Distance from the threshold within which a cell reads either way, in parts of 65536 of the whole operation.
/// No data sheet gives a figure; a quarter leaves several such cells in most torn half-words.
const UNSTEADY: u32 = 16_384;

/// The cells of one byte that read differently from read to read.
#[derive(Clone, Copy, Debug)]
struct Unsteady {
    /// Those cells.
    bits: u8,
    /// The value that the operation was to give the byte.
    target: u8,
    /// How much of the operation was done, of 65536.
    parts: u32,
}

/// The cells. A reader that needs only one answer, such as the flash file, gets the likelier value of each bit.
#[derive(Debug)]
pub(super) struct Cells {
    memory: Memory,
    /// Bytes in a page.
    page: usize,
    unsteady: BTreeMap<usize, Unsteady>,
    seed: u64,
    /// Draws the value of each read of an unsteady cell.
    noise: fastrand::Rng,
}

impl Cells {
    pub(super) fn erased(part: &Part, seed: u64) -> Self {
        Self {
            memory: Memory::new(part.flash_size, 0xFF),
            page: part.page_size,
            unsteady: BTreeMap::new(),
            seed,
            noise: fastrand::Rng::with_seed(seed),
        }
    }

    pub(super) fn host(&mut self) -> *mut u8 {
        self.memory.host()
    }

    pub(super) fn move_to(&mut self, mut memory: Memory) {
        memory.bytes_mut().copy_from_slice(self.memory.bytes());
        self.memory = memory;
    }

    pub(super) fn take_memory(&mut self) -> Memory {
        core::mem::replace(&mut self.memory, Memory::new(1, 0))
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.memory.bytes()
    }

    /// Returns the bytes, for changes from outside. Such a change leaves every cell steady, as a programmer does.
    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        self.unsteady.clear();
        self.memory.bytes_mut()
    }

    /// Reads `N` bytes from byte `at` on.
    pub(super) fn read<const N: usize>(&mut self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.memory.bytes()[at..at + N]);
        for (&at_byte, cell) in self.unsteady.range(at..at + N) {
            let byte = &mut bytes[at_byte - at];
            for bit in (0..8).filter(|bit| cell.bits >> bit & 1 != 0) {
                let noise = self.noise.u32(0..2 * UNSTEADY);
                let changed = cell.parts + noise >= draw(self.seed, at_byte * 8 + bit) + UNSTEADY;
                let value = if changed { cell.target } else { !cell.target };
                *byte = *byte & !(1 << bit) | value & 1 << bit;
            }
        }
        bytes
    }

    /// Returns whether there are unsteady cells among these bytes.
    pub(super) fn is_unsteady(&self, bytes: Range<usize>) -> bool {
        self.unsteady.range(bytes).next().is_some()
    }

    /// Returns the page that the byte at `offset` is in; `None` beyond the last one.
    pub(super) fn page_of(&self, offset: usize) -> Option<usize> {
        (offset < self.bytes().len()).then_some(offset / self.page)
    }

    /// Returns the bytes that `operation` changes: first and end.
    fn span(&self, operation: Operation) -> (usize, usize) {
        match operation {
            Operation::Program { at, .. } => (at, at + 2),
            Operation::Page { page } => (page * self.page, (page + 1) * self.page),
            Operation::Mass => (0, self.bytes().len()),
        }
    }

    /// Completes `operation`; returns the bytes changed, first and end.
    pub(super) fn finish(&mut self, operation: Operation) -> (usize, usize) {
        let (first, end) = self.span(operation);
        for at in first..end {
            let old = self.memory.bytes()[at];
            let target = operation.target(at, old);
            self.memory.bytes_mut()[at] = target;
            if let Some(cell) = self.unsteady.get_mut(&at) {
                // A program drives cells to 0 and leaves the others alone; an erase drives all to 1.
                cell.bits &= match operation {
                    Operation::Program { value, .. } => value.to_le_bytes()[at - first],
                    Operation::Page { .. } | Operation::Mass => 0,
                };
            }
        }
        self.unsteady.retain(|_, cell| cell.bits != 0);
        (first, end)
    }

    /// Does `parts` / 65536 of `operation`; returns the bytes changed, first and end.
    pub(super) fn tear(&mut self, operation: Operation, torn: Torn, parts: u32) -> (usize, usize) {
        let (first, end) = self.span(operation);
        if torn == Torn::Before {
            return (first, end);
        }
        if torn == Torn::After {
            return self.finish(operation);
        }
        for at in first..end {
            let old = self.memory.bytes()[at];
            let target = operation.target(at, old);
            let changing = old ^ target;
            let places = |test: &dyn Fn(u32) -> bool| {
                (0..8)
                    .filter(|bit| test(draw(self.seed, at * 8 + bit)))
                    .fold(0, |mask, bit| mask | 1u8 << bit)
            };
            let changed = changing & places(&|place| place < parts);
            let near = changing & places(&|place| place.abs_diff(parts) < UNSTEADY);
            self.memory.bytes_mut()[at] = old ^ changed;
            if near != 0 {
                let cell = Unsteady {
                    bits: near,
                    target,
                    parts,
                };
                self.unsteady.insert(at, cell);
            }
        }
        (first, end)
    }
}

/// Returns a number from 0 to 65535 that depends only on the seed and the bit's place (the mixer of splitmix64).
fn draw(seed: u64, bit: usize) -> u32 {
    let mut z = (seed ^ (bit as u64 + 1)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ z >> 31) as u32 & 0xFFFF
}
