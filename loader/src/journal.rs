//! The boot state in two pages of flash: sealed records, the newest of which counts.
//!
//! ```text
//! half-word  0-1     number, which is never used twice
//!            2       preferred slot (bit 0), codes of the states of A (bits 8-11) and B (bits 12-15)
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

use board_support::pages::{Page, Pages, WriteError};
use register_map::update::{Slot, State, crc32};

use crate::Record;

/// Half-words of a record.
const HALVES: usize = 10;
/// Half-words in front of the seals.
const UNSEALED: usize = HALVES - 2;
const BYTES: usize = 2 * HALVES;
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
            let halves: [u16; HALVES] = core::array::from_fn(|n| {
                u16::from_le_bytes([bytes[2 * n % BYTES], bytes[(2 * n + 1) % BYTES]])
            });
            let number = u32::from(halves[1]) << 16 | u32::from(halves[0]);
            let newest = self.newest.map_or(0, |newest| newest.number);
            if number <= newest || !is_right(&halves) {
                continue;
            }
            self.number = self.number.max(number);
            let seals = [halves[UNSEALED] == 0, halves[UNSEALED + 1] == 0];
            if seals != [false; 2]
                && let Some(record) = decoded(&halves)
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
        let halves = encoded(self.number, record);
        for (n, half) in halves.into_iter().enumerate() {
            flash.program(page, offset + 2 * n, half)?;
        }
        let bytes = flash.page(page).get(offset..offset + 2 * UNSEALED);
        if bytes != Some(halves.map(u16::to_le_bytes).as_flattened()) {
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
    for n in UNSEALED..HALVES {
        flash.program(page, offset + 2 * n, 0)?;
    }
    let seals = flash.page(page).get(offset + 2 * UNSEALED..offset + BYTES);
    if seals == Some(&[0; 4]) {
        Ok(())
    } else {
        Err(WriteError::Worn)
    }
}

fn encoded(number: u32, record: Record) -> [u16; UNSEALED] {
    let [a, b] = record.states.map(State::code);
    let preferred = u16::from(record.preferred == Slot::B);
    let mut halves = [
        number as u16,
        (number >> 16) as u16,
        preferred | u16::from(a.0) << 8 | u16::from(b.0) << 12,
        u16::from_le_bytes([a.1, b.1]),
        record.floor,
        LAYOUT,
        0,
        0,
    ];
    let crc = crc_of(&halves);
    halves[UNSEALED - 2] = crc as u16;
    halves[UNSEALED - 1] = (crc >> 16) as u16;
    halves
}

/// Returns the CRC-32 of the half-words in front of it.
fn crc_of(halves: &[u16; UNSEALED]) -> u32 {
    let bytes = halves.map(u16::to_le_bytes);
    crc32([bytes.as_flattened().split_at(2 * UNSEALED - 4).0, &[]])
}

/// Returns whether the layout and the CRC of a record are right.
fn is_right(halves: &[u16; HALVES]) -> bool {
    let Some((unsealed, _)) = halves.split_first_chunk::<UNSEALED>() else {
        return false;
    };
    let [.., layout, low, high] = *unsealed;
    layout == LAYOUT && u32::from(high) << 16 | u32::from(low) == crc_of(unsealed)
}

/// Returns the boot state of a record, or `None` if it has a state that only a newer image knows.
fn decoded(halves: &[u16; HALVES]) -> Option<Record> {
    let [_, _, codes, details, floor, ..] = *halves;
    let [a, b] = details.to_le_bytes();
    Some(Record {
        preferred: if codes & 1 == 0 { Slot::A } else { Slot::B },
        states: [
            State::from_code((codes >> 8) as u8 & 15, a)?,
            State::from_code((codes >> 12) as u8, b)?,
        ],
        floor,
    })
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
