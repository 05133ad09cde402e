//! Flash pages with any content, and an independent decoder of them.

use std::fmt;

use register_map::record::{BEGINNING, OUTPUTS, SEALS};

use crate::PAGE_SIZE;
use crate::running::{Settings, random_settings};
use crate::script::Script;

/// The two pages of a store.
pub type Pages = [[u8; PAGE_SIZE]; 2];

/// Decodes a page of a script: consecutive pieces up to the end piece.
///
/// ```text
///   0 the end       1 a page mark     2 a record         3 a record without its last half-words
///   4 bytes         5 erased cells    6 the beginning    7 erased cells up to a distance from the end
///   a record: sequence number minus base, then 0 seed size: settings; or n: n times address, value
/// ```
pub fn page(script: &mut Script<'_>, base: u32) -> [u8; PAGE_SIZE] {
    let mut bytes = Vec::new();
    while bytes.len() < PAGE_SIZE {
        match script.tag().unwrap_or(0) & 7 {
            0 => break,
            1 => bytes.extend(b"ok"),
            2 => bytes.extend(record(script, base)),
            3 => {
                let mut record = record(script, base);
                let cut = usize::from(script.byte()) * 2;
                record.truncate(record.len().saturating_sub(cut.max(2)));
                bytes.extend(record);
            }
            4 => bytes.extend(script.string()),
            5 => bytes.extend(vec![0xFF; usize::from(script.byte()) * 2]),
            6 => bytes.extend(BEGINNING),
            _ => {
                let to = PAGE_SIZE - usize::from(script.byte()) * 2;
                bytes.resize(to.max(bytes.len()), 0xFF);
            }
        }
    }
    bytes.resize(PAGE_SIZE, 0xFF);
    bytes.try_into().expect("a page")
}

/// Encodes a record in the layout of `register_map::record`, independently of that module.
fn record(script: &mut Script<'_>, base: u32) -> Vec<u8> {
    let sequence = base.wrapping_add(u32::from(script.half()));
    let pairs: Vec<(u16, u16)> = match script.byte() {
        0 => {
            let (seed, size) = (script.byte(), script.byte() % 60);
            let settings = random_settings(u64::from(seed), usize::from(size));
            settings.changed_from(0).collect()
        }
        // No addresses of outputs, which are recorded by events only.
        count => (0..count)
            .map(|_| (script.half() % OUTPUTS, script.half()))
            .collect(),
    };
    let mut record = b"mo\x01\x01".to_vec();
    record.extend(sequence.to_le_bytes());
    record.extend((pairs.len() as u16).to_le_bytes());
    for (address, value) in pairs {
        record.extend(address.to_le_bytes());
        record.extend(value.to_le_bytes());
    }
    let check = crc32(&record);
    record.extend(check.to_le_bytes());
    record.extend([0; SEALS]);
    record
}

/// A configuration that a start may find.
#[derive(Clone, PartialEq)]
pub struct Found {
    /// The settings in force.
    pub settings: Settings,
    /// Something was stored, but the settings are the defaults.
    pub invalid: bool,
    /// Number of values that are not allowed.
    pub rejected: u16,
}

impl Found {
    /// Returns settings that this firmware has stored.
    #[must_use]
    pub fn good(settings: &Settings) -> Self {
        Self {
            settings: *settings,
            invalid: false,
            rejected: 0,
        }
    }

    /// Returns the result for pages on which something was stored, but no record is valid.
    #[must_use]
    pub fn damaged() -> Self {
        Self {
            invalid: true,
            ..Self::good(&Settings::defaults())
        }
    }
}

impl fmt::Debug for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            invalid, rejected, ..
        } = self;
        write!(f, "invalid: {invalid}, rejected: {rejected}, ")?;
        f.debug_map()
            .entries(self.settings.changed_from(0))
            .finish()
    }
}

/// Returns whether no page contains a valid record.
#[must_use]
pub fn nothing_good(pages: &Pages) -> bool {
    pages.iter().all(|page| records(page).is_empty())
}

/// Returns the configurations that a start may find on these pages: the newest sealed record, or the newest of all
/// records when none is sealed. When the sequence numbers are too far apart to have an order, which the store never
/// produces, it may be any of the records.
#[must_use]
pub fn read(pages: &Pages) -> Vec<Found> {
    let good: Vec<_> = pages.iter().flat_map(|page| records(page)).collect();
    let any_sealed = good.iter().any(|(_, sealed, _)| *sealed);
    let all: Vec<(u32, Found)> = good
        .into_iter()
        .filter(|(_, sealed, _)| *sealed || !any_sealed)
        .map(|(sequence, _, found)| (sequence, found))
        .collect();
    let Some((first, _)) = all.first() else {
        let vacant = pages.iter().all(|page| is_vacant(page));
        return vec![if vacant {
            Found::good(&Settings::defaults())
        } else {
            Found::damaged()
        }];
    };
    let age = |sequence: u32| i64::from(sequence.wrapping_sub(*first) as i32);
    let ages = || all.iter().map(|(sequence, _)| age(*sequence));
    let (Some(oldest), Some(newest)) = (ages().min(), ages().max()) else {
        unreachable!("there is at least one record")
    };
    if newest - oldest > 1 << 30 {
        return all.into_iter().map(|(_, found)| found).collect();
    }
    // Of equal ages the first one counts, which is on the first page.
    let place = ages().position(|age| age == newest);
    place.map(|at| all[at].1.clone()).into_iter().collect()
}

/// Returns sequence number, seal and content of every valid record.
fn records(page: &[u8]) -> Vec<(u32, bool, Found)> {
    let half = |at: usize| u16::from_le_bytes([page[at], page[at + 1]]);
    let word = |at: usize| u32::from(half(at)) | u32::from(half(at + 2)) << 16;
    let mut found = Vec::new();
    let mut at = 0;
    while at + 14 <= page.len() {
        let end = at + 10 + 4 * usize::from(half(at + 8));
        // The high byte of the schema is the layout.
        let looks_right = &page[at..at + 2] == b"mo" && page[at + 3] == 1;
        if !looks_right || end + 4 > page.len() || crc32(&page[at..end]) != word(end) {
            at += 2;
            continue;
        }
        let pairs = (at + 10..end).step_by(4).map(|at| (half(at), half(at + 2)));
        let (settings, rejected) = Settings::load(pairs);
        let invalid = false;
        let settings = Found {
            settings,
            invalid,
            rejected,
        };
        // The first of the two seals decides.
        let sealed = end + 8 <= page.len() && half(end + 4) == 0;
        found.push((word(at + 4), sealed, settings));
        at = end + 4;
    }
    found
}

/// Returns whether nothing was ever stored on the page: it is erased, or contains only a mark of any kind and a
/// beginning that may be interrupted.
fn is_vacant(page: &[u8]) -> bool {
    page.iter().enumerate().skip(2).all(|(at, byte)| {
        let full = BEGINNING.get(at - 2).copied().unwrap_or(0xFF);
        byte & full == full
    })
}

/// Computes CRC-32/ISO-HDLC, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let mut register = u32::MAX;
    for byte in bytes {
        register ^= u32::from(*byte);
        for _ in 0..8 {
            let carry = register & 1 != 0;
            register >>= 1;
            if carry {
                register ^= 0xEDB8_8320;
            }
        }
    }
    !register
}
