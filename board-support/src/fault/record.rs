//! The layout of the fault record and its changes at a start.

use super::{Fault, FaultRecord, Kind, TASKS};

/// Words of the record. The last one is the checksum.
pub(super) const WORDS: usize = 9;

/// Distinguishes this layout from other layouts and from the content of RAM after power-on.
const MAGIC: u32 = 0x4661_7501;
/// Bit of the second word, above the kind: the fault was noted since the last start.
const FRESH: u32 = 1 << 16;
/// Shift of the crystal fault count in the second word: its most significant byte.
const CRYSTAL_FAULTS: u32 = 24;

/// Bits of the reset cause (RM0008 7.3.10, starting with LPWRRSTF).
const BY_WATCHDOG: u8 = 1 << 2;
const BY_POWER_ON: u8 = 1 << 4;

/// A record and whether it was noted since the last start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Noted {
    pub(super) record: FaultRecord,
    pub(super) fresh: bool,
}

const fn kind_of(number: u8) -> Option<Kind> {
    Some(match number {
        0 => Kind::None,
        1 => Kind::Panic,
        2 => Kind::HardFault,
        3 => Kind::Watchdog,
        4 => Kind::Crystal,
        5 => Kind::StackOverflow,
        _ => return None,
    })
}

/// Returns a checksum that detects every flipped bit. A record that is all zeros, inverted or shifted never has a
/// valid checksum.
fn checksum(words: &[u32; WORDS]) -> u32 {
    let [content @ .., _] = words;
    content.iter().fold(MAGIC, |sum, word| {
        (sum ^ word).rotate_left(7).wrapping_add(1)
    })
}

impl Noted {
    pub(super) fn words(&self) -> [u32; WORDS] {
        let FaultRecord {
            fault,
            count,
            uptime,
            missing,
            crystal_faults,
        } = self.record;
        let fresh = if self.fresh { FRESH } else { 0 };
        let mut words = [
            MAGIC,
            fault.kind as u32 | fresh | u32::from(crystal_faults) << CRYSTAL_FAULTS,
            u32::from(count) | u32::from(missing) << 16,
            fault.pc,
            fault.lr,
            fault.status,
            fault.address,
            uptime,
            0,
        ];
        words[WORDS - 1] = checksum(&words);
        words
    }

    /// Returns the record, or `None` when the words are not a valid record.
    pub(super) fn from_words(words: &[u32; WORDS]) -> Option<Self> {
        let [magic, kind, count, pc, lr, status, address, uptime, sum] = *words;
        if magic != MAGIC || sum != checksum(words) {
            return None;
        }
        let fault = Fault {
            kind: kind_of(kind as u8)?,
            pc,
            lr,
            status,
            address,
        };
        Some(Self {
            record: FaultRecord {
                fault,
                count: count as u16,
                uptime,
                missing: (count >> 16) as u16,
                crystal_faults: (kind >> CRYSTAL_FAULTS) as u8,
            },
            fresh: kind & FRESH != 0,
        })
    }

    /// Adds a fault. Only the first one since the start counts, because a fault in a fault handler is a consequence
    /// of it.
    pub(super) fn add(&mut self, fault: Fault, uptime: u32, missing: u16) {
        if !self.fresh {
            self.fresh = true;
            let more = u8::from(fault.kind == Kind::Crystal);
            self.record = FaultRecord {
                fault,
                count: self.record.count.saturating_add(1),
                uptime,
                missing,
                crystal_faults: self.record.crystal_faults.saturating_add(more),
            };
        }
    }

    /// Updates the kept record, if there is a valid one, for a start with this `reset_cause`. `uptime` and `marks`
    /// are what the firmware kept before the reset.
    pub(super) fn at_start(
        kept: &mut Option<Self>,
        reset_cause: u8,
        uptime: u32,
        marks: [u8; TASKS],
    ) -> &Self {
        let power_on = reset_cause & BY_POWER_ON != 0;
        if power_on {
            *kept = None;
        }
        // Without a valid record, the uptime and the marks beside it are not valid either.
        let (uptime, missing) = match kept {
            Some(_) => (uptime, missing(marks)),
            None => (0, 0),
        };
        let noted = kept.get_or_insert_default();
        if reset_cause & BY_WATCHDOG != 0 && !power_on {
            let watchdog_reset = Fault {
                kind: Kind::Watchdog,
                ..Fault::default()
            };
            noted.add(watchdog_reset, uptime, missing);
        }
        noted.fresh = false;
        noted
    }
}

/// Returns one bit for each task whose mark does not say that it has run to its end.
fn missing(marks: [u8; TASKS]) -> u16 {
    marks
        .iter()
        .enumerate()
        .filter(|(_, mark)| **mark != 1)
        .fold(0, |missing, (task, _)| missing | 1 << task)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BY_SOFTWARE: u8 = 1 << 3 | 1 << 5;
    const WATCHDOG: u8 = BY_WATCHDOG | 1 << 5;

    fn fault() -> Fault {
        Fault {
            kind: Kind::HardFault,
            pc: 0x0800_1234,
            lr: 0x0800_5679,
            status: 0x8200,
            address: 0x6000_0000,
        }
    }

    fn with(mut noted: Noted, fault: Fault, uptime: u32) -> Noted {
        noted.add(fault, uptime, 0);
        noted
    }

    fn noted() -> Noted {
        with(Noted::default(), fault(), 77)
    }

    fn at_start(words: &[u32; WORDS], cause: u8, uptime: u32, marks: [u8; TASKS]) -> Noted {
        *Noted::at_start(&mut Noted::from_words(words), cause, uptime, marks)
    }

    #[test]
    fn every_kind_is_found_by_its_number() {
        for number in 0..=5 {
            assert_eq!(kind_of(number).map(|kind| kind as u8), Some(number));
        }
        assert_eq!(kind_of(6), None);
    }

    #[test]
    fn a_record_is_restored_from_its_words_and_any_flipped_bit_is_detected() {
        let words = noted().words();
        assert_eq!(Noted::from_words(&words), Some(noted()));
        for word in 0..WORDS {
            for bit in 0..32 {
                let mut broken = words;
                broken[word] ^= 1 << bit;
                assert_eq!(Noted::from_words(&broken), None, "word {word} bit {bit}");
            }
        }
        for other in [[0; WORDS], [u32::MAX; WORDS], words.map(|word| !word)] {
            assert_eq!(Noted::from_words(&other), None);
        }
    }

    #[test]
    fn a_fault_is_kept_over_several_resets_and_counted_once() {
        let mut words = noted().words();
        for cause in [BY_SOFTWARE, 1 << 5, BY_SOFTWARE] {
            let start = at_start(&words, cause, 1_000, [1; TASKS]);
            assert_eq!(start.record.fault, fault());
            assert_eq!((start.record.count, start.record.uptime), (1, 77));
            words = start.words();
        }
    }

    #[test]
    fn a_power_on_clears_a_valid_record() {
        let cause = BY_POWER_ON | 1 << 5;
        let start = at_start(&noted().words(), cause, 5, [0; TASKS]);
        assert_eq!(start, Noted::default());
    }

    #[test]
    fn a_watchdog_reset_records_the_uptime_and_the_missing_marks() {
        let words = Noted::default().words();
        let start = at_start(&words, WATCHDOG, 42, [1, 0, 1, 2, 1, 1, 1, 1, 0]);
        assert_eq!(start.record.fault.kind, Kind::Watchdog);
        assert_eq!(start.record.uptime, 42);
        assert_eq!(start.record.missing, 0b1_0000_1010);
        assert_eq!(start.record.count, 1);
        let again = at_start(&start.words(), WATCHDOG, 3, [0, 1, 1, 1, 1, 1, 1, 1, 1]);
        assert_eq!((again.record.count, again.record.missing), (2, 1));
    }

    #[test]
    fn a_watchdog_reset_after_a_noted_fault_keeps_that_fault() {
        let start = at_start(&noted().words(), WATCHDOG, 42, [0; TASKS]);
        assert_eq!(start.record.fault, fault());
        assert_eq!((start.record.count, start.record.missing), (1, 0));
    }

    #[test]
    fn a_watchdog_reset_without_a_valid_record_is_noted() {
        let start = at_start(&[0xA5A5_A5A5; WORDS], WATCHDOG, 0xA5A5_A5A5, [0xA5; TASKS]);
        assert_eq!(start.record.fault.kind, Kind::Watchdog);
        assert_eq!((start.record.uptime, start.record.missing), (0, 0));
    }

    #[test]
    fn only_the_first_fault_since_the_start_is_noted() {
        let second = Fault {
            kind: Kind::Panic,
            ..Fault::default()
        };
        assert_eq!(with(noted(), second, 78), noted());
        let after = at_start(&noted().words(), BY_SOFTWARE, 0, [1; TASKS]);
        let then = with(after, second, 5);
        assert_eq!((then.record.fault, then.record.count), (second, 2));
    }

    #[test]
    fn crystal_faults_are_counted_separately_until_power_on() {
        let crystal = Fault {
            kind: Kind::Crystal,
            ..Fault::default()
        };
        let mut words = Noted::default().words();
        for (fault, count) in [(crystal, 1), (fault(), 1), (crystal, 2)] {
            let start = at_start(&words, BY_SOFTWARE, 0, [1; TASKS]);
            let noted = with(start, fault, 5);
            assert_eq!(noted.record.crystal_faults, count);
            words = noted.words();
        }
        let start = at_start(&words, BY_SOFTWARE, 0, [1; TASKS]);
        assert_eq!((start.record.crystal_faults, start.record.count), (2, 3));
        let start = at_start(&words, BY_POWER_ON, 0, [1; TASKS]);
        assert_eq!(start.record.crystal_faults, 0);
    }

    #[test]
    fn the_count_of_faults_stops_at_its_largest_value() {
        let mut noted = noted();
        noted.record.count = u16::MAX;
        noted.fresh = false;
        assert_eq!(with(noted, fault(), 0).record.count, u16::MAX);
    }
}
