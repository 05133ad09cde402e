//! The flash's cells, and what an operation does to them: whole, or torn by a power cut.

use crate::machine::memory::{FLASH_SIZE, Memory};

/// Bytes in a page (medium density, RM0008 table 5).
pub const PAGE: usize = 1024;

/// What an interrupted operation leaves. The part promises nothing; each choice is the same in every run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Torn {
    /// Each bit that was to change has changed with a likelihood that grows with the time spent: a mess. It is
    /// drawn from the bit's place, so that a longer operation has changed all that a shorter one has.
    #[default]
    Mess,
    /// Nothing has changed yet, however late the cut.
    Before,
    /// Everything has changed already, however early the cut.
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
    /// The bytes it changes: first and end.
    const fn span(self) -> (usize, usize) {
        match self {
            Self::Program { at, .. } => (at, at + 2),
            Self::Page { page } => (page * PAGE, (page + 1) * PAGE),
            Self::Mass => (0, FLASH_SIZE),
        }
    }

    /// What the byte at `at` is to become from `old`.
    const fn target(self, at: usize, old: u8) -> u8 {
        match self {
            Self::Program { at: start, value } => old & value.to_le_bytes()[at - start],
            Self::Page { .. } | Self::Mass => 0xFF,
        }
    }
}

/// The cells.
#[derive(Debug)]
pub(super) struct Cells(Memory);

impl Cells {
    pub(super) fn erased() -> Self {
        Self(Memory::new(FLASH_SIZE, 0xFF))
    }

    pub(super) fn host(&mut self) -> *mut u8 {
        self.0.host()
    }

    pub(super) fn bytes(&self) -> &[u8] {
        self.0.bytes()
    }

    pub(super) fn bytes_mut(&mut self) -> &mut [u8] {
        self.0.bytes_mut()
    }

    /// The half-word at byte `at` (even).
    pub(super) fn half(&self, at: usize) -> u16 {
        let bytes = self.0.bytes();
        u16::from_le_bytes([bytes[at], bytes[at + 1]])
    }

    /// Does `operation` whole; returns the bytes changed, first and end.
    pub(super) fn finish(&mut self, operation: Operation) -> (usize, usize) {
        self.tear(operation, Torn::After, 65_536)
    }

    /// Does `parts` / 65536 of `operation`; returns the bytes changed, first and end.
    pub(super) fn tear(&mut self, operation: Operation, torn: Torn, parts: u32) -> (usize, usize) {
        let (first, end) = operation.span();
        let bytes = self.0.bytes_mut();
        for (at, byte) in bytes[first..end].iter_mut().enumerate() {
            let at = first + at;
            let target = operation.target(at, *byte);
            let flips = match torn {
                Torn::Before => 0,
                Torn::After => 0xFF,
                Torn::Mess => (0..8)
                    .filter(|bit| draw(at * 8 + bit) < parts)
                    .fold(0, |mask, bit| mask | 1u8 << bit),
            };
            *byte ^= (*byte ^ target) & flips;
        }
        (first, end)
    }
}

/// A number from 0 to 65535 that depends on the bit's place alone (the mixer of splitmix64).
fn draw(bit: usize) -> u32 {
    let mut z = (bit as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ z >> 31) as u32 & 0xFFFF
}
