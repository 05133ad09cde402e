//! The sealed part of the kept region.

use core::array;

use super::COPY;
use crate::fault::{Fault, FaultRecord, Kind};

/// The first word: the magic (upper half), the version of the layout, and the length in words (lowest byte).
const HEAD: u32 = 0x6B70 << 16 | 1 << 8 | COPY as u32;
/// Word of the kind of the last fault and, in the upper byte, the number of crystal faults.
const KIND: usize = 1;
/// Word of the number of faults and, in the upper half, the tasks without a mark.
const COUNT: usize = 2;
/// Words of the place of the fault.
const PLACE: usize = 3;
/// Word of the uptime at the fault.
const UPTIME: usize = 7;
/// Word of SW01 (bits 0 to 7), the numbers of saves and of records of outputs left (bits 16 to 23 and 24 to 31, inverted),
/// and the bits below.
pub(super) const FLAGS: usize = 8;
/// Word of the seconds from power-on to the last start.
pub(super) const STARTED: usize = 9;
/// Word of the reset flags that the loader found (bits 0 to 5), and whether the application has not seen them yet.
#[cfg(target_os = "none")]
pub(super) const CAUSE: usize = 10;

/// Word of the complement of [`STARTED`], of an image that keeps outputs.
pub(super) const OWNER: usize = 11;

/// SW01.
pub(super) const DIP: u32 = 0xFF;
/// SW01 has been read.
pub(super) const HAS_DIP: u32 = 1 << 8;
/// This restart was asked for by COMMAND 2.
#[cfg(target_os = "none")]
pub(super) const ASKED: u32 = 1 << 9;
/// The application has not seen the reset flags in [`CAUSE`] yet.
#[cfg(target_os = "none")]
pub(super) const UNSEEN: u32 = 1 << 8;
/// The loader trusts the development key.
#[cfg(target_os = "none")]
pub(super) const DEVELOPMENT: u32 = 1 << 9;
/// This restart is one as with SW01 = 255, COMMAND 0xB007.
#[cfg(target_os = "none")]
pub(super) const AS_255: u32 = 1 << 14;
/// The slot that SW01 = 254 chose at power-on: 0 none, 1 A, 2 B. Bit 13 is the loader's, too.
#[cfg(target_os = "none")]
pub(super) const CHOSEN: u32 = 0b11 << 11;
/// The fault was noted since the last start.
pub(super) const FRESH: u32 = 1 << 10;
/// The number of saves left.
pub(super) const SAVES: u32 = 0x00FF_0000;
/// The number of records of outputs left.
pub(super) const RECORDS: u32 = 0xFF00_0000;

/// What a reset keeps and what seldom changes.
///
/// The region holds two equal copies. An update writes the copy that is not in force, and then the other one. So one
/// copy is valid at every instant, and a reset during an update leaves the old or the new content.
///
/// Words that this image does not know belong to fields that a newer image has appended. They are kept as they are, and
/// 0 means that no image has written the field since power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sealed([u32; COPY]);

impl Sealed {
    /// Returns the content after power-on: no fault, SW01 not read, every budget full.
    pub(super) const fn after_power_on() -> Self {
        let mut words = [0; COPY];
        words[0] = HEAD;
        Self(words)
    }

    /// Returns the content of a copy, 0 or 1, given access to the words of the region.
    pub(super) fn copy(copy: usize, read: impl Fn(usize) -> u32) -> Self {
        Self(array::from_fn(|at| read(copy * COPY + at)))
    }

    /// Reads the copy in force, given access to the words of the region, and returns its number, 0 or 1. Without a valid
    /// copy returns `None`, and the content is that after power-on.
    pub(super) fn load(&mut self, read: impl Fn(usize) -> u32) -> Option<usize> {
        for copy in 0..2 {
            *self = Self::copy(copy, &read);
            if self.is_valid() {
                return Some(copy);
            }
        }
        *self = Self::after_power_on();
        None
    }

    fn is_valid(&self) -> bool {
        // The CRC-32 of words and their CRC-32 is 0.
        self.0[0] == HEAD && crc(&self.0) == 0
    }

    /// Seals the content and writes both copies, that of number `in_force` last.
    pub(super) fn store(&mut self, in_force: usize, mut write: impl FnMut(usize, u32)) {
        let [words @ .., seal] = &mut self.0;
        *seal = crc(words);
        let first = COPY - COPY * in_force;
        for at in first..first + 2 * COPY {
            write(at % (2 * COPY), self.0[at % COPY]);
        }
    }

    /// Replaces the bits of `mask` in a word. OWNER follows STARTED.
    pub(super) const fn set(&mut self, word: usize, mask: u32, bits: u32) {
        let value = self.0[word % COPY] & !mask | bits;
        self.0[word % COPY] = value;
        if word == STARTED {
            self.0[OWNER] = !value;
        }
    }

    /// Notes a fault at this number of seconds since the start. Only the first fault since the start counts, because a
    /// fault in a fault handler is a consequence of it.
    pub(super) fn note(&mut self, fault: &Fault, uptime: u32, missing: u16) {
        let words = &mut self.0;
        if words[FLAGS] & FRESH == 0 {
            words[FLAGS] |= FRESH;
            let crystal = fault.kind == Kind::Crystal;
            let crystals = ((words[KIND] >> 24) as u8).saturating_add(crystal.into());
            words[KIND] = u32::from(crystals) << 24 | fault.kind as u32;
            let count = (words[COUNT] as u16).saturating_add(1);
            words[COUNT] = u32::from(missing) << 16 | u32::from(count);
            words[PLACE..UPTIME].copy_from_slice(&fault.place);
            words[UPTIME] = uptime;
        }
    }

    /// Returns the fault record.
    pub(crate) fn record(&self) -> FaultRecord {
        let words = &self.0;
        FaultRecord {
            kind: words[KIND] as u8,
            crystal_faults: (words[KIND] >> 24) as u8,
            count: words[COUNT] as u16,
            missing: (words[COUNT] >> 16) as u16,
            place: array::from_fn(|at| words[PLACE + at]),
            uptime: words[UPTIME],
        }
    }

    /// Returns SW01 as read at power-on, or `None` before it was read.
    pub(crate) const fn dip(&self) -> Option<u8> {
        if self.0[FLAGS] & HAS_DIP == 0 {
            None
        } else {
            Some(self.0[FLAGS] as u8)
        }
    }

    /// Returns the word at an index.
    #[cfg(all(target_os = "none", feature = "loader"))]
    pub(super) const fn word(&self, at: usize) -> u32 {
        self.0[at % COPY]
    }

    /// Returns whether SW01 = 254 chose the slot that runs.
    #[cfg(target_os = "none")]
    pub(crate) const fn is_chosen(&self) -> bool {
        self.0[FLAGS] & CHOSEN != 0
    }

    /// Returns the number of saves left, 255 after power-on.
    pub(crate) const fn saves(&self) -> u8 {
        (!self.0[FLAGS] >> 16) as u8
    }

    /// Returns whether the outputs of the run before are valid.
    pub(super) const fn has_outputs(&self) -> bool {
        self.0[OWNER] == !self.0[STARTED]
    }
}

/// Returns the bits of a number of saves left.
pub(super) const fn saves(left: u8) -> u32 {
    (!left as u32) << 16
}

/// Returns the number of records of outputs left from the flags, 255 after power-on.
pub(super) const fn records_of(flags: u32) -> u8 {
    (!flags >> 24) as u8
}

/// Returns the bits of a number of records of outputs left.
pub(super) const fn records(left: u8) -> u32 {
    (!left as u32) << 24
}

/// Returns the CRC-32 that the part's CRC unit computes (RM0008 4): polynomial 04C11DB7, start FFFFFFFF, not
/// reflected. By bits, because it is computed at a start and at a save, and else once a minute at most.
#[inline(never)]
fn crc(words: &[u32]) -> u32 {
    words.iter().fold(u32::MAX, |crc, word| {
        (0..32).fold(crc ^ word, |crc, _| {
            let out = if crc >> 31 == 0 { 0 } else { 0x04C1_1DB7 };
            crc << 1 ^ out
        })
    })
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const HARD_FAULT: Fault = Fault {
        kind: Kind::HardFault,
        place: [0x0800_1234, 0x0800_5679, 0x8200, 0x6000_0000],
    };

    type Region = [u32; 2 * COPY];

    fn find(region: &Region) -> Option<Sealed> {
        let mut sealed = Sealed::after_power_on();
        sealed.load(|at| region[at]).map(|_| sealed)
    }

    /// Returns the region after every number of writes of an update, beginning with none.
    fn update(region: &Region, change: impl FnOnce(&mut Sealed)) -> Vec<Region> {
        let mut sealed = Sealed::after_power_on();
        let copy = sealed.load(|at| region[at]).unwrap_or_default();
        change(&mut sealed);
        let mut states = std::vec![*region];
        let mut region = *region;
        sealed.store(copy, |at, word| {
            region[at] = word;
            states.push(region);
        });
        states
    }

    /// Returns the region of a unit in service.
    fn in_service() -> Region {
        let noise = [0xA5A5_5A5A; 2 * COPY];
        *update(&noise, |sealed| {
            sealed.set(STARTED, 0, 1_000);
            sealed.note(&HARD_FAULT, 77, 0);
            sealed.set(FLAGS, DIP | SAVES, HAS_DIP | 17 | saves(9));
        })
        .last()
        .unwrap()
    }

    #[test]
    fn reset_after_any_write_of_an_update_leaves_the_old_or_the_new_content() {
        let region = in_service();
        let old = find(&region).unwrap();
        let states = update(&region, |sealed| sealed.set(FLAGS, SAVES, saves(8)));
        for first in &states {
            let between = find(first).expect("a copy is valid");
            assert!([9, 8].contains(&between.saves()));
            // The update of the next start may be interrupted as well.
            for second in update(first, |sealed| sealed.set(STARTED, u32::MAX, 2_000)) {
                let now = find(&second).expect("a copy is valid");
                assert!([1_000, 2_000].contains(&now.0[STARTED]));
                assert_eq!(now.saves(), between.saves());
                assert_eq!((now.record(), now.dip()), (old.record(), Some(17)));
            }
        }
        let last = states.last().unwrap();
        assert_eq!(find(last).unwrap().saves(), 8);
        assert_eq!(last[..COPY], last[COPY..], "both copies are new");
    }

    /// Begins a start.
    fn start(sealed: &mut Sealed) {
        sealed.set(FLAGS, FRESH, 0);
    }

    #[test]
    fn first_fault_since_the_start_is_kept_with_the_uptime_and_counted_once() {
        let mut sealed = Sealed::after_power_on();
        start(&mut sealed);
        for kind in [Kind::HardFault, Kind::Watchdog] {
            sealed.note(&Fault { kind, ..HARD_FAULT }, 77, 0b101);
        }
        let record = sealed.record();
        assert_eq!((record.kind, record.place), (2, HARD_FAULT.place));
        let numbers = (record.count, record.uptime, record.missing);
        assert_eq!(numbers, (1, 77, 0b101));
        start(&mut sealed);
        assert_eq!(sealed.record(), record);
    }

    #[test]
    fn crystal_faults_are_counted_separately_and_counts_stop_at_their_largest_value() {
        let mut sealed = Sealed::after_power_on();
        let crystal_faults = |sealed: &mut Sealed, kind| {
            sealed.note(&Fault { kind, ..HARD_FAULT }, 0, 0);
            start(sealed);
            sealed.record().crystal_faults
        };
        let kinds = [Kind::Crystal, Kind::Panic, Kind::Crystal];
        assert_eq!(
            kinds.map(|kind| crystal_faults(&mut sealed, kind)),
            [1, 1, 2]
        );
        sealed.0[KIND] = 0xFF00_0000;
        sealed.0[COUNT] = 0xFFFF;
        assert_eq!(crystal_faults(&mut sealed, Kind::Crystal), u8::MAX);
        assert_eq!(sealed.record().count, u16::MAX);
    }

    #[test]
    fn noise_and_a_flipped_bit_in_both_copies_count_as_after_power_on() {
        for noise in [[0; 2 * COPY], [u32::MAX; 2 * COPY]] {
            assert_eq!(find(&noise), None);
        }
        let region = in_service();
        for (word, bit) in (0..COPY).flat_map(|word| (0..32).map(move |bit| (word, bit))) {
            let mut broken = region;
            broken[word] ^= 1 << bit;
            assert_eq!(find(&broken), find(&region), "the other copy");
            broken[COPY + word] ^= 1 << bit;
            assert_eq!(find(&broken), None, "word {word} bit {bit}");
        }
        let after = Sealed::after_power_on();
        assert_eq!((after.dip(), after.saves()), (None, u8::MAX));
        assert_eq!(records_of(after.0[FLAGS]), u8::MAX);
    }

    #[test]
    fn numbers_of_saves_and_of_records_left_are_kept_apart() {
        let mut sealed = find(&in_service()).unwrap();
        for left in [0, 80, 7] {
            sealed.set(FLAGS, RECORDS, records(left));
            assert_eq!((sealed.saves(), records_of(sealed.0[FLAGS])), (9, left));
        }
        sealed.set(FLAGS, SAVES, saves(20));
        assert_eq!((sealed.saves(), records_of(sealed.0[FLAGS])), (20, 7));
        assert_eq!(sealed.dip(), Some(17));
    }

    #[test]
    fn outputs_are_those_of_the_run_before_only_if_it_wrote_both_words_for_them() {
        assert!(!Sealed::after_power_on().has_outputs());
        let own = |sealed: &mut Sealed, started| sealed.set(STARTED, u32::MAX, started);
        let before = *update(&in_service(), |sealed| own(sealed, 1_000))
            .last()
            .unwrap();
        // A reset after any write of the next run's update leaves the words of one run.
        for region in update(&before, |sealed| own(sealed, 2_000)) {
            assert!(find(&region).unwrap().has_outputs());
        }
        // An older image does not know OWNER.
        let older = update(&before, |sealed| sealed.0[STARTED] = 2_000);
        assert!(!find(older.last().unwrap()).unwrap().has_outputs());
    }

    #[test]
    fn fields_of_a_newer_image_are_kept_and_the_crc_is_that_of_the_parts_unit() {
        let states = update(&in_service(), |sealed| sealed.0[COPY - 2] = 1234);
        let states = update(states.last().unwrap(), |sealed| sealed.set(FLAGS, DIP, 18));
        assert_eq!(find(states.last().unwrap()).unwrap().0[COPY - 2], 1234);
        // CRC-32/MPEG-2 of the characters 12345678.
        assert_eq!(crc(&[0x3132_3334, 0x3536_3738]), 0x49E3_C2FB);
    }
}
