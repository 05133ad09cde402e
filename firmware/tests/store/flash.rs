//! A mock flash that enforces the rules of RM0008 3.3, and whose power can be cut in the middle of any operation.

use std::cell::Cell;

use firmware::store::{Operation, Page, Pages};

use crate::PAGE_SIZE;

/// The state that a power cut leaves of the interrupted operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mess {
    /// Nothing has changed yet.
    Untouched,
    /// The operation was just complete. An erased page may still be weak.
    Complete,
    /// The operation was complete except for one cell of a half-word, which reads as before the operation at every
    /// second start, but not at the first. For an erase the same as [`Self::Complete`].
    Nearly,
    /// A random part of the bits to be changed has changed.
    Sprinkled(u64),
    /// The bytes before this index have changed.
    Front(usize),
    /// The bytes from this index on have changed.
    Back(usize),
    /// An erase leaves noise. For a half-word the same as [`Self::Sprinkled`].
    Noise(u64),
}

/// Messes of every kind.
pub const MESSES: [Mess; 11] = [
    Mess::Untouched,
    Mess::Complete,
    Mess::Nearly,
    Mess::Sprinkled(1),
    Mess::Sprinkled(2),
    Mess::Sprinkled(3),
    Mess::Front(1),
    Mess::Front(512),
    Mess::Back(1),
    Mess::Back(2),
    Mess::Noise(4),
];

/// A half-word whose programming was interrupted, the cells that were to change, and the value to be programmed.
#[derive(Clone, Copy, Debug)]
struct Torn {
    page: usize,
    offset: usize,
    before: u16,
    half: u16,
    mess: Mess,
}

impl Torn {
    /// Returns what the half-word reads as. The same number of the read always returns the same value.
    fn read(&self, nth: u64) -> [u8; 2] {
        let cells = match self.mess {
            Mess::Nearly if !nth.is_multiple_of(2) => 1 << self.before.trailing_zeros(),
            Mess::Nearly => 0,
            _ => Noise(nth << 16 ^ self.offset as u64).next() as u16,
        };
        (self.half | self.before & cells).to_le_bytes()
    }
}

/// Error of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The power was cut during the operation.
    PowerCut,
    /// The half-word read as erased a moment ago, but its programming was once interrupted, and now it reads
    /// differently. The controller refuses to program it (PGERR, RM0008 3.3).
    NotErased,
}

/// The mock flash and a log of its operations.
#[derive(Clone, Debug)]
pub struct MockFlash {
    pub pages: [[u8; PAGE_SIZE]; 2],
    /// An erase was interrupted: the page must not be programmed, whatever it reads as.
    weak: [bool; 2],
    /// The page's bits read differently at every start.
    pub unsteady: [bool; 2],
    /// Half-words whose programming was interrupted.
    torn: Vec<Torn>,
    /// The pages as every second read finds them: half-words whose programming was interrupted read differently.
    other: [[u8; PAGE_SIZE]; 2],
    reads: Cell<u64>,
    /// Number of times the power has returned.
    starts: u64,
    /// Number of operations before the one in which the power is cut.
    pub cut: Option<(usize, Mess)>,
    off: bool,
    /// A worn-out half-word, whose bits cannot be cleared.
    pub worn: Option<(Page, usize)>,
    /// The operations so far, each with the flash before it, if they are recorded.
    pub journal: Option<Vec<(MockFlash, Operation)>>,
    pub programs: usize,
    pub erases: [usize; 2],
}

impl MockFlash {
    /// Returns a flash as it leaves the factory.
    pub fn erased() -> Self {
        Self::holding([[0xFF; PAGE_SIZE]; 2])
    }

    pub fn holding(pages: [[u8; PAGE_SIZE]; 2]) -> Self {
        Self {
            pages,
            weak: [false; 2],
            unsteady: [false; 2],
            torn: Vec::new(),
            other: pages,
            reads: Cell::new(0),
            starts: 0,
            cut: None,
            off: false,
            worn: None,
            journal: None,
            programs: 0,
            erases: [0; 2],
        }
    }

    /// Returns a flash with these bytes at the start of its pages.
    pub fn with(first: &[u8], second: &[u8]) -> Self {
        let mut flash = Self::erased();
        flash.pages[0][..first.len()].copy_from_slice(first);
        flash.pages[1][..second.len()].copy_from_slice(second);
        flash
    }

    pub fn operations(&self) -> usize {
        self.programs + self.erases[0] + self.erases[1]
    }

    /// Turns the power on again. Unsteady pages read a little differently every time.
    pub fn power_on(&mut self) {
        (self.off, self.cut) = (false, None);
        self.starts += 1;
        for torn in &self.torn {
            let read = torn.read(self.starts);
            self.pages[torn.page][torn.offset..][..2].copy_from_slice(&read);
        }
        for index in 0..2 {
            if self.unsteady[index] {
                let mut noise = Noise(self.operations() as u64 + 99);
                for _ in 0..4 {
                    let bit = noise.next() as usize % (PAGE_SIZE * 8);
                    self.pages[index][bit / 8] ^= 1 << (bit % 8);
                }
            }
            self.read_otherwise(index);
        }
    }

    /// Ends an operation on a page.
    fn ended(&mut self, index: usize) -> Result<(), Fault> {
        self.read_otherwise(index);
        if self.off {
            Err(Fault::PowerCut)
        } else {
            Ok(())
        }
    }

    /// Updates what every second read finds on a page.
    fn read_otherwise(&mut self, page: usize) {
        self.other[page] = self.pages[page];
        for torn in self.torn.iter().filter(|torn| torn.page == page) {
            let read = torn.read(self.starts + 1);
            self.other[page][torn.offset..][..2].copy_from_slice(&read);
        }
    }

    /// Cuts the power in the middle of this operation.
    pub fn cut_in(&mut self, operation: Operation, mess: Mess) {
        self.power_on();
        self.cut = Some((0, mess));
        let result = match operation {
            Operation::Program { page, offset, half } => self.program(page, offset, half),
            Operation::Erase(page) => self.erase(page),
        };
        assert_eq!(result, Err(Fault::PowerCut));
    }

    /// Counts down to the power cut. Returns the mess when the cut is due.
    fn begin(&mut self, operation: Operation) -> Option<Mess> {
        assert!(!self.off, "{operation:?} without power");
        if let Some(mut journal) = self.journal.take() {
            journal.push((self.clone(), operation));
            self.journal = Some(journal);
        }
        let (left, mess) = self.cut.as_mut()?;
        if *left > 0 {
            *left -= 1;
            return None;
        }
        let mess = *mess;
        self.off = true;
        Some(mess)
    }
}

impl Pages for MockFlash {
    type Error = Fault;

    fn page(&self, page: Page) -> &[u8] {
        let index = page as usize;
        let nth = self.reads.get();
        self.reads.set(nth + 1);
        if nth.is_multiple_of(2) || self.torn.iter().all(|torn| torn.page != index) {
            &self.pages[index]
        } else {
            &self.other[index]
        }
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), Fault> {
        let operation = Operation::Program { page, offset, half };
        let mess = self.begin(operation);
        self.programs += 1;
        assert!(offset.is_multiple_of(2), "{operation:?} is not aligned");
        let place = self.pages[page as usize][offset..offset + 2]
            .as_mut_array()
            .unwrap();
        let before = u16::from_le_bytes(*place);
        if before != 0xFFFF && half != 0 {
            let at_place = |torn: &Torn| (torn.page, torn.offset) == (page as usize, offset);
            assert!(
                self.torn.iter().any(at_place),
                "{operation:?} over {before:#06x}"
            );
            return Err(if self.off {
                Fault::PowerCut
            } else {
                Fault::NotErased
            });
        }
        // When a mark cannot be written, the program cannot know that the page is weak.
        assert!(
            !self.weak[page as usize] || half == 0 || self.worn.is_some(),
            "{operation:?} on a weak page"
        );
        let mut after = match mess {
            None | Some(Mess::Complete | Mess::Nearly) => half,
            Some(Mess::Untouched) => before,
            Some(Mess::Front(_)) => half | (before & 0xFF00),
            Some(Mess::Back(_)) => half | (before & 0x00FF),
            Some(Mess::Sprinkled(seed) | Mess::Noise(seed)) => {
                half | (before & Noise(seed ^ offset as u64).next() as u16)
            }
        };
        if self.worn == Some((page, offset)) {
            after |= before;
        }
        *place = after.to_le_bytes();
        // A complete programming makes its cells steady.
        let index = page as usize;
        self.torn.retain(|torn| {
            (torn.page, torn.offset) != (index, offset) || mess.is_some() || torn.before & half != 0
        });
        if let Some(mess @ (Mess::Nearly | Mess::Sprinkled(_) | Mess::Noise(_))) = mess
            && before != half
        {
            self.torn.push(Torn {
                page: index,
                offset,
                before: before & !half,
                half,
                mess,
            });
        }
        self.ended(index)
    }

    fn erase(&mut self, page: Page) -> Result<(), Fault> {
        let mess = self.begin(Operation::Erase(page));
        let index = page as usize;
        self.erases[index] += 1;
        self.weak[index] = mess.is_some();
        self.torn.retain(|torn| torn.page != index);
        self.unsteady[index] = matches!(mess, Some(Mess::Sprinkled(_) | Mess::Noise(_)));
        let bytes = &mut self.pages[index];
        match mess {
            None | Some(Mess::Complete | Mess::Nearly) => bytes.fill(0xFF),
            Some(Mess::Untouched) => {}
            Some(Mess::Front(to)) => bytes[..to].fill(0xFF),
            Some(Mess::Back(from)) => bytes[from..].fill(0xFF),
            Some(Mess::Sprinkled(seed)) => {
                let mut noise = Noise(seed);
                bytes
                    .iter_mut()
                    .for_each(|byte| *byte |= noise.next() as u8);
            }
            Some(Mess::Noise(seed)) => {
                let mut noise = Noise(seed);
                bytes.fill_with(|| noise.next() as u8);
            }
        }
        self.ended(index)
    }
}

/// Pseudo-random numbers, the same in every run (xorshift64*).
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> u64 {
        let mut x = self.0 | 1 << 63;
        x ^= x >> 12;
        x ^= x << 25;
        x ^= x >> 27;
        self.0 = x;
        x.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32
    }
}
