//! Target `update`: a slot with any content, then two pages of the boot state with any content and a history: changes,
//! starts, a power cut in any operation that leaves any mess.
//!
//! The header is compared with an independent reading, a manifest with the right one, and no content may cause a panic or
//! be called genuine. Every start must find the boot state that was written last or, after a power cut, the old or the new
//! one; once it is settled, every later start finds the same.
//!
//! ```text
//!   script: bytes of the application (2 bytes), what replaces the header: place (2 bytes) and a string,
//!           1 = the CRC-32 is made right;  what replaces a part of a manifest: place and a string;
//!           two pages (a string each, filled up with one byte);  events
//!   event:  0 change  preferred, states (2 bytes), floor (2 bytes)     1 a start
//!           2 a cut   number of operations before it, mess
//! ```

use boot_state::Record;
use boot_state::journal::Journal;
use loader::genuine;
use ports::pages::{Page, Pages};
use register_map::update::{Manifest, Reason, Slot, State, crc32, intact};

use crate::PAGE_SIZE;
use crate::flash::{Fault, MockFlash};
use crate::script::Script;
use crate::store::mess;

/// Bytes of the slot.
const SLOT: usize = 2048;
const ADDRESS: u32 = 0x0801_1800;

/// Target `update`.
pub fn run(input: &[u8]) {
    let mut script = Script::new(input);
    header(&mut script);
    manifest(&mut script);
    let pages = [0; 2].map(|_| {
        let (bytes, fill) = (script.string(), script.byte());
        let mut page = [fill; PAGE_SIZE];
        page[..bytes.len()].copy_from_slice(bytes);
        page
    });
    let mut unit = Unit::new(MockFlash::holding(pages));
    while let Some(tag) = script.tag() {
        match tag % 3 {
            0 => unit.change(record(&mut script)),
            1 => unit.power_cycle(),
            _ => {
                let after = usize::from(script.byte());
                unit.flash.0.cut = Some((after, mess(&mut script)));
            }
        }
    }
    unit.power_cycle();
    unit.change(record(&mut script));
}

/// Checks a slot whose header was changed.
fn header(script: &mut Script<'_>) {
    let length = script.half();
    let mut slot = vec![0xA5; SLOT];
    slot[..512].fill(0);
    slot[..6].copy_from_slice(b"MODI\x02\x01");
    slot[12..16].copy_from_slice(&ADDRESS.to_le_bytes());
    slot[16..18].copy_from_slice(&length.to_le_bytes());
    let (at, bytes) = (usize::from(script.half()) % (SLOT - 255), script.string());
    slot[at..at + bytes.len()].copy_from_slice(bytes);
    let length = u32::from_le_bytes(slot[16..20].try_into().expect("four bytes"));
    let end = 512 + u64::from(length);
    let bounds = length >= 512 && length % 4 == 0 && end <= SLOT as u64;
    if script.byte() == 1 && bounds {
        let crc = crc32([&slot[..20], &slot[512..end as usize]]);
        slot[20..24].copy_from_slice(&crc.to_le_bytes());
    }
    let form = slot.starts_with(b"MODI\x02") && slot[160..512].iter().all(|byte| *byte == 0);
    let right = form && bounds && {
        let crc = crc32([&slot[..20], &slot[512..end as usize]]);
        slot[20..24] == crc.to_le_bytes()
    };
    assert_eq!(intact(&slot, crc32).is_ok(), right);
    // Hash and signature would have to be guessed.
    let number = u32::from_be_bytes(slot[156..160].try_into().expect("four bytes"));
    let refused = genuine::check(&slot, ADDRESS, 1, 0, &[([7; 32], number)]);
    let reason = refused.expect_err("nobody has signed it");
    assert_eq!(reason == Reason::Magic, !form);
    assert_eq!(reason == Reason::Length, form && !bounds);
}

/// Checks the manifest of a file whose body is one slot, with changes.
fn manifest(script: &mut Script<'_>) {
    let right = Manifest {
        images: [[0, 1516], [1536, 512]],
        hash: [0xA5; 64],
    };
    let mut bytes = right.encode();
    let at = usize::from(script.byte()) % bytes.len();
    let new = script.string();
    let end = bytes.len().min(at + new.len());
    bytes[at..end].copy_from_slice(&new[..end - at]);
    let found = Manifest::decode(&bytes);
    assert_eq!(found == Some(right), bytes == right.encode());
    if let Some(found) = found {
        let body = [0; SLOT];
        for image in found.images_in(&body).into_iter().flatten() {
            assert!(image.len() <= SLOT);
        }
    }
}

fn record(script: &mut Script<'_>) -> Record {
    let preferred = Slot::ALL[usize::from(script.byte() & 1)];
    let states = [0; 2].map(|_| {
        let byte = script.byte();
        State::from_code(byte & 7, byte >> 3).unwrap_or(State::Confirmed)
    });
    let floor = script.half();
    Record {
        preferred,
        states,
        floor,
        bits: script.byte() & !1,
    }
}

/// The mock flash, which after a power cut refuses what the journal still tries.
struct Powered(MockFlash, bool);

impl Powered {
    fn note(&mut self, result: Result<(), Fault>) -> Result<(), Fault> {
        self.1 &= result != Err(Fault::PowerCut);
        result
    }
}

impl Pages for Powered {
    type Error = Fault;

    fn page(&self, page: Page) -> &[u8] {
        self.0.page(page)
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), Fault> {
        if !self.1 {
            return Err(Fault::PowerCut);
        }
        let result = self.0.program(page, offset, half);
        self.note(result)
    }

    fn erase(&mut self, page: Page) -> Result<(), Fault> {
        if !self.1 {
            return Err(Fault::PowerCut);
        }
        let result = self.0.erase(page);
        self.note(result)
    }
}

/// A unit with the boot state in its flash.
struct Unit {
    flash: Powered,
    journal: Journal,
    /// Boot states that the next start may find.
    expected: Vec<Option<Record>>,
}

impl Unit {
    fn new(flash: MockFlash) -> Self {
        let flash = Powered(flash, true);
        let journal = Journal::open(&flash);
        let mut unit = Self {
            expected: vec![journal.record()],
            flash,
            journal,
        };
        unit.settle();
        unit
    }

    fn power_cycle(&mut self) {
        self.flash.0.power_on();
        self.flash.1 = true;
        self.journal = Journal::open(&self.flash);
        let found = self.journal.record();
        assert!(
            self.expected.contains(&found),
            "found {found:?} in place of {:?}",
            self.expected
        );
        self.settle();
    }

    fn settle(&mut self) {
        let found = self.journal.record();
        if self.journal.settle(&mut self.flash).is_ok() {
            self.expected = vec![found];
        } else {
            // Before the first record anything may be on the pages.
            self.flash_is_off();
        }
    }

    fn change(&mut self, record: Record) {
        match self.journal.write(&mut self.flash, record) {
            Ok(()) => self.expected = vec![Some(record)],
            Err(_) => {
                self.expected.push(Some(record));
                self.flash_is_off();
            }
        }
    }

    /// After a cut the power returns.
    fn flash_is_off(&mut self) {
        if !self.flash.1 {
            self.power_cycle();
        }
    }
}
