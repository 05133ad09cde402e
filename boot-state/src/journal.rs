//! The boot state in two pages of flash: sealed records, the newest of which counts.
//!
//! ```text
//! half-word  0-1     number, which is never used twice
//!            2       preferred slot (bit 0), first key revoked (bit 1), codes of the states of A (bits 8-11)
//!                    and B (bits 12-15)
//!            3       details of the states of A (low byte) and B
//!            4       epoch floor
//!            5       the layout, and no erased half-word
//!            6-7     CRC-32 of the half-words before, as in the header of an image
//!            8, 9    seals: 0 when programmed
//! ```
//!
//! Records are appended to a page. When it is full, or when something lies behind its newest record, the other page is
//! erased and takes the next record, so a change is always one record, and the newest one is never erased. A record
//! counts once its first seal is programmed, after its CRC is complete: a cut leaves the state before or after. A seal
//! whose programming was cut may read differently from start to start; [`Journal::settle`] ends that before anything is
//! decided.

use ports::pages::{Page, Pages, WriteError};
use register_map::update::{Slot, State, crc32};

use crate::Record;

/// Bytes of a record.
const BYTES: usize = 20;
/// Offset of the CRC-32.
const CRC: usize = 12;
/// Offset of the seals.
const SEALS: usize = 16;
/// The bit of byte 4 that says which slot is preferred. The others are [`Record::bits`].
const PREFERS_B: u8 = 1;
/// Version of the layout.
const LAYOUT: u16 = 0x4201;

/// A record in flash.
#[derive(Clone, Copy, Debug)]
struct Found {
    page: Page,
    offset: usize,
    number: u32,
    record: Record,
    /// Both seals are programmed.
    sealed_twice: bool,
}

/// The state of the two pages.
#[derive(Clone, Copy, Debug)]
pub struct Journal {
    newest: Option<Found>,
    /// The highest number of a record whose CRC is right, sealed or not.
    number: u32,
    /// Where the next record goes without an erase.
    free: Option<(Page, usize)>,
}

impl Journal {
    /// Reads both pages.
    #[must_use]
    pub fn open(flash: &impl Pages) -> Self {
        let mut journal = Self {
            newest: None,
            number: 0,
            free: None,
        };
        for page in [Page::First, Page::Second] {
            journal.read(page, flash.page(page));
        }
        if let Some(found) = journal.newest {
            let behind = found.offset + BYTES;
            let rest = flash.page(found.page).get(behind..).unwrap_or_default();
            let is_free = rest.len() >= BYTES && rest.iter().all(|byte| *byte == 0xFF);
            journal.free = is_free.then_some((found.page, behind));
        }
        journal
    }

    fn read(&mut self, page: Page, bytes: &[u8]) {
        // The newest record is the last, and a CRC takes 0.2 ms at 8 MHz.
        for (at, bytes) in bytes.as_chunks::<BYTES>().0.iter().enumerate().rev() {
            let [n0, n1, n2, n3, ..] = *bytes;
            let number = u32::from_le_bytes([n0, n1, n2, n3]);
            let newest = self.newest.map_or(0, |newest| newest.number);
            if number <= newest || !is_right(bytes) {
                continue;
            }
            self.number = self.number.max(number);
            let [.., s0, s1, s2, s3] = *bytes;
            let seals = [[s0, s1] == [0; 2], [s2, s3] == [0; 2]];
            if seals != [false; 2]
                && let Some(record) = decoded(bytes)
            {
                self.newest = Some(Found {
                    page,
                    offset: at * BYTES,
                    number,
                    record,
                    sealed_twice: seals == [true; 2],
                });
            }
        }
    }

    /// Returns the boot state, or `None` before the first one was written.
    #[must_use]
    pub fn record(&self) -> Option<Record> {
        self.newest.map(|found| found.record)
    }

    /// Returns whether every start reads the same state. A cut may have left a record whose seal reads as programmed at
    /// one start and as erased at the next.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.newest
            .is_none_or(|found| found.sealed_twice && found.number == self.number)
    }

    /// Makes what was read the state of every later start: programs the seals of the newest record again if a cut left
    /// only one, and writes the state again if a cut left a newer record without a seal. Call this at the start, before
    /// the state is used.
    ///
    /// # Errors
    ///
    /// When the flash refuses. The state is used as it was read.
    pub fn settle<F: Pages>(&mut self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        match &mut self.newest {
            Some(found) if found.number != self.number => {
                let record = found.record;
                self.write(flash, record)
            }
            Some(found) if !found.sealed_twice => {
                seal(flash, found.page, found.offset)?;
                found.sealed_twice = true;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Writes a new boot state.
    ///
    /// # Errors
    ///
    /// When the flash fails in both pages; [`WriteError`] says which state is in force.
    pub fn write<F: Pages>(
        &mut self,
        flash: &mut F,
        record: Record,
    ) -> Result<(), WriteError<F::Error>> {
        if let Some((page, offset)) = self.free.take()
            && self.append(flash, record, page, offset).is_ok()
        {
            return Ok(());
        }
        let page = self.newest.map_or(Page::First, |found| found.page.other());
        flash.erase(page)?;
        self.append(flash, record, page, 0)
    }

    fn append<F: Pages>(
        &mut self,
        flash: &mut F,
        record: Record,
        page: Page,
        offset: usize,
    ) -> Result<(), WriteError<F::Error>> {
        // Each attempt has another number, because its remains may read as a record later.
        self.number += 1;
        let unsealed = encoded(self.number, record);
        for (n, half) in unsealed.as_chunks().0.iter().enumerate() {
            flash.program(page, offset + 2 * n, u16::from_le_bytes(*half))?;
        }
        if flash.page(page).get(offset..offset + SEALS) != Some(&unsealed) {
            return Err(WriteError::Worn);
        }
        seal(flash, page, offset)?;
        self.newest = Some(Found {
            page,
            offset,
            number: self.number,
            record,
            sealed_twice: true,
        });
        let next = offset + BYTES;
        let has_room = next + BYTES <= flash.page(page).len();
        self.free = has_room.then_some((page, next));
        Ok(())
    }
}

fn seal<F: Pages>(flash: &mut F, page: Page, offset: usize) -> Result<(), WriteError<F::Error>> {
    for at in (SEALS..BYTES).step_by(2) {
        flash.program(page, offset + at, 0)?;
    }
    let seals = flash.page(page).get(offset + SEALS..offset + BYTES);
    if seals == Some(&[0; 4]) {
        Ok(())
    } else {
        Err(WriteError::Worn)
    }
}

/// Returns a record without its seals.
fn encoded(number: u32, record: Record) -> [u8; SEALS] {
    let [(a, of_a), (b, of_b)] = record.states.map(State::code);
    let bits = record.bits & !PREFERS_B | u8::from(record.preferred == Slot::B);
    let [n0, n1, n2, n3] = number.to_le_bytes();
    let [f0, f1] = record.floor.to_le_bytes();
    let [l0, l1] = LAYOUT.to_le_bytes();
    let mut bytes = [
        n0,
        n1,
        n2,
        n3,
        bits,
        a | b << 4,
        of_a,
        of_b,
        f0,
        f1,
        l0,
        l1,
        0,
        0,
        0,
        0,
    ];
    let (covered, crc) = bytes.split_at_mut(CRC);
    crc.copy_from_slice(&crc32([covered, &[]]).to_le_bytes());
    bytes
}

/// Returns whether the layout and the CRC of a record are right.
fn is_right(bytes: &[u8; BYTES]) -> bool {
    let (covered, rest) = bytes.split_at(CRC);
    covered.ends_with(&LAYOUT.to_le_bytes())
        && rest.starts_with(&crc32([covered, &[]]).to_le_bytes())
}

/// Returns the boot state of a record, or `None` if it has a state that only a newer image knows.
fn decoded(bytes: &[u8; BYTES]) -> Option<Record> {
    let [_, _, _, _, bits, codes, of_a, of_b, f0, f1, ..] = *bytes;
    Some(Record {
        preferred: if bits & PREFERS_B == 0 {
            Slot::A
        } else {
            Slot::B
        },
        states: [
            State::from_code(codes & 15, of_a)?,
            State::from_code(codes >> 4, of_b)?,
        ],
        floor: u16::from_le_bytes([f0, f1]),
        bits: bits & !PREFERS_B,
    })
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
