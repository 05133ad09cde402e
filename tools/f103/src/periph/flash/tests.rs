//! The controller against PM0075.

use super::*;
use crate::memory::FLASH_BASE;
use crate::part::{STM32F103CB, STM32F103RC};

const NOW: Time = Time::ZERO;
const SEED: u64 = 7;

fn unlock(flash: &mut Flash) {
    for key in KEYS {
        flash.write(4, key, NOW).unwrap();
    }
}

/// Starts to erase the page at `offset`.
fn erase(flash: &mut Flash, offset: u32, now: Time) {
    flash.write(0x10, CR_PER, now).unwrap();
    flash.write(0x14, FLASH_BASE + offset, now).unwrap();
    flash.write(0x10, CR_PER | CR_STRT, now).unwrap();
}

fn open() -> Flash {
    let mut flash = Flash::new(&STM32F103CB, u32::MAX, SEED);
    unlock(&mut flash);
    assert_eq!(flash.read(0x10, NOW), Ok(0));
    flash
}

fn program(flash: &mut Flash, offset: u32, value: u16) {
    flash.write(0x10, CR_PG, NOW).unwrap();
    flash.program(offset, true, value, NOW);
}

#[test]
fn half_word_is_stored_after_the_program_time() {
    let mut flash = open();
    program(&mut flash, 0x400, 0x1234);
    assert_eq!(flash.read(0x0C, NOW), Ok(SR_BSY), "at the first read");
    assert_eq!(flash.bytes()[0x400], 0xFF);
    let end = flash.next_event().unwrap();
    assert_eq!(end, Time::from_ns(52_500));
    flash.advance(end);
    assert_eq!(flash.read(0x0C, end), Ok(SR_EOP));
    assert_eq!(flash.bytes()[0x400..0x402], [0x34, 0x12]);
    assert_eq!(flash.take_changed(), Some((0x400, 0x402)));
    assert_eq!(flash.take_complaint(), None);
}

#[test]
fn bsy_of_an_erase_is_late_for_one_read_and_fetches_stall_after_the_prefetched_instructions() {
    let mut flash = open();
    erase(&mut flash, 0, NOW);
    assert_eq!(flash.read(0x10, NOW), Ok(CR_PER | CR_STRT), "any register");
    assert_eq!(flash.read(0x0C, NOW), Ok(SR_BSY));
    flash.ran(u64::from(FETCHED_AHEAD) - 1);
    assert_eq!(flash.stalled_until(), None);
    flash.ran(1);
    assert_eq!(flash.stalled_until(), flash.busy_until());
    let later = Time::from_ms(50);
    flash.advance(later);
    flash.write(0x0C, SR_EOP, later).unwrap();
    erase(&mut flash, 0, later);
    assert_eq!(flash.read(0x0C, later), Ok(0), "late");
    assert_eq!(flash.read(0x0C, later), Ok(SR_BSY));
    let later = Time::from_ms(100);
    flash.advance(later);
    flash.write(0x0C, SR_EOP, later).unwrap();
    erase(&mut flash, 0, later);
    flash.ran(u64::from(FETCHED_AHEAD));
    assert_eq!(flash.read(0x0C, later), Ok(SR_BSY), "no longer late");
}

#[test]
fn program_that_takes_a_late_bsy_for_the_end_clears_per_and_locks_without_effect() {
    let mut flash = open();
    erase(&mut flash, 0x400, NOW);
    assert_eq!(flash.read(0x0C, NOW), Ok(0), "late");
    for clears in [0, CR_LOCK] {
        flash.write(0x10, clears, NOW).unwrap();
        let text = flash.take_complaint().unwrap().text;
        assert!(text.contains("while an operation runs"), "{text}");
    }
    assert_eq!(flash.read(0x10, NOW), Ok(CR_PER | CR_STRT));
    let end = Time::from_ms(30);
    flash.advance(end);
    assert_eq!(flash.take_changed(), Some((0x400, 0x800)));
    assert_eq!(flash.read(0x10, end), Ok(CR_PER), "still open");
}

#[test]
fn chosen_operation_ends_without_eop() {
    let mut flash = open();
    flash.end_without_eop(2);
    for (n, status) in [SR_EOP, 0, SR_EOP].into_iter().enumerate() {
        let end = Time::from_ms(n as u64 + 1);
        flash.write(0x0C, SR_EOP, NOW).unwrap();
        program(&mut flash, 2 * n as u32, 0x1234);
        flash.advance(end);
        assert_eq!(flash.read(0x0C, end), Ok(status), "operation {n}");
        assert_eq!(flash.half_at(2 * n), 0x1234);
    }
}

#[test]
fn a_programmed_half_word_takes_only_zero() {
    let mut flash = open();
    flash.bytes_mut()[0x400] = 0xFE;
    program(&mut flash, 0x400, 0xFEFE);
    assert_eq!(flash.read(0x0C, NOW), Ok(SR_PGERR));
    assert!(flash.take_complaint().is_some());
    flash.write(0x0C, SR_PGERR, NOW).unwrap();
    program(&mut flash, 0x400, 0);
    flash.advance(Time::from_ms(1));
    assert_eq!(flash.half_at(0x400), 0);
}

#[test]
fn a_wrong_key_locks_until_reset() {
    let mut flash = Flash::new(&STM32F103CB, u32::MAX, SEED);
    flash.write(4, KEYS[1], NOW).unwrap();
    assert!(flash.take_complaint().unwrap().bus_error);
    unlock(&mut flash);
    assert_eq!(flash.read(0x10, NOW), Ok(CR_LOCK));
    flash.reset(NOW);
    unlock(&mut flash);
    assert_eq!(flash.read(0x10, NOW), Ok(0));
}

#[test]
fn clone_hides_that_it_is_locked_and_takes_the_keys_once() {
    let mut flash = Flash::new(&STM32F103CB, u32::MAX, SEED);
    flash.hides_lock = true;
    assert_eq!(flash.read(0x10, NOW), Ok(0));
    unlock(&mut flash);
    assert_eq!(flash.read(0x10, NOW), Ok(0));
    flash.write(0x10, CR_LOCK, NOW).unwrap();
    unlock(&mut flash);
    assert!(flash.take_complaint().is_none());
    // It is open.
    flash.write(4, KEYS[0], NOW).unwrap();
    assert!(flash.take_complaint().unwrap().bus_error);
}

#[test]
fn an_erase_takes_30_ms_and_only_its_page() {
    let mut flash = open();
    flash.bytes_mut().fill(0);
    erase(&mut flash, 0x800, NOW);
    assert_eq!(flash.next_event(), Some(Time::from_ms(30)));
    flash.advance(Time::from_ms(30));
    assert!(flash.bytes()[0x800..0xC00].iter().all(|&b| b == 0xFF));
    assert_eq!((flash.bytes()[0x7FF], flash.bytes()[0xC00]), (0, 0));
}

#[test]
fn a_torn_erase_is_between_old_and_new_and_grows() {
    let torn_at = |ms| {
        let mut flash = open();
        flash.bytes_mut()[..1024].fill(0);
        erase(&mut flash, 0, NOW);
        flash.power_off(Time::from_ms(ms));
        assert_eq!(flash.next_event(), None);
        flash.bytes()[..1024].to_vec()
    };
    let ones = |page: &[u8]| page.iter().map(|b| b.count_ones()).sum::<u32>();
    let (early, late) = (torn_at(6), torn_at(24));
    assert!((1_000..2_500).contains(&ones(&early)), "{}", ones(&early));
    assert!((6_000..7_200).contains(&ones(&late)), "{}", ones(&late));
    assert!(
        early.iter().zip(&late).all(|(e, l)| e & !l == 0),
        "monotonic"
    );
    assert_eq!(early, torn_at(6), "the same every time");
}

/// Returns the half-word at 0 after a program of 0 that was cut when half of it was done.
fn torn_half(seed: u64) -> Flash {
    let mut flash = Flash::new(&STM32F103CB, u32::MAX, seed);
    unlock(&mut flash);
    program(&mut flash, 0, 0);
    flash.power_off(Time::from_ns(26_250));
    unlock(&mut flash);
    flash
}

fn reads(flash: &mut Flash) -> Vec<u16> {
    (0..100).map(|_| flash.half_at(0)).collect()
}

#[test]
fn half_programmed_cells_read_differently_from_read_to_read() {
    let mut flash = torn_half(SEED);
    let read = reads(&mut flash);
    let ones = read.iter().fold(0, |all, half| all | half);
    let always = read.iter().fold(0xFFFF, |all, half| all & half);
    assert_ne!(ones, always, "some cells are unsteady");
    assert_ne!(ones, 0xFFFF, "others read as 0");
    assert_ne!(always, 0, "others read as 1");
    assert!(flash.is_unsteady(0..1024), "the core reads through the bus");
    assert_eq!(read, reads(&mut torn_half(SEED)), "the same for a seed");
    assert_ne!(read, reads(&mut torn_half(SEED + 1)));
}

#[test]
fn complete_program_steadies_only_the_cells_it_programs() {
    for (value, steady) in [(0, true), (0xFFFF, false)] {
        let mut flash = torn_half(SEED);
        flash.cells.finish(Operation::Program { at: 0, value });
        let read = reads(&mut flash);
        assert_eq!(
            read.iter().all(|half| *half == read[0]),
            steady,
            "{value:#x}"
        );
    }
}

#[test]
fn half_erased_cells_stay_unsteady_over_a_reset_until_an_erase_is_complete() {
    let mut flash = open();
    flash.bytes_mut()[..1024].fill(0);
    let unlock_and_erase = |flash: &mut Flash| {
        unlock(flash);
        erase(flash, 0, NOW);
    };
    flash.reset(NOW);
    unlock_and_erase(&mut flash);
    flash.reset(Time::from_ms(15));
    let words = |flash: &mut Flash| -> Vec<u32> {
        (0..256).map(|word| flash.read_word(4 * word)).collect()
    };
    assert_ne!(words(&mut flash), words(&mut flash));
    assert!(flash.is_unsteady(0..1024));
    flash.reset(NOW);
    assert_ne!(words(&mut flash), words(&mut flash));
    unlock_and_erase(&mut flash);
    flash.advance(Time::from_ms(30));
    assert_eq!(words(&mut flash), [u32::MAX; 256]);
    assert!(!flash.is_unsteady(0..1024));
}

#[test]
fn torn_can_be_set_to_nothing_or_everything() {
    for (torn, left) in [(Torn::Before, 0xFFFF), (Torn::After, 0x0102)] {
        let mut flash = open();
        flash.torn = torn;
        program(&mut flash, 0, 0x0102);
        flash.power_off(Time::from_us(20));
        assert_eq!(flash.half_at(0), left);
    }
}

#[test]
fn protected_pages_refuse_and_bytes_are_a_bus_error() {
    let mut flash = Flash::new(&STM32F103CB, !1, SEED);
    unlock(&mut flash);
    program(&mut flash, 0, 0);
    assert_eq!(flash.read(0x0C, NOW), Ok(SR_WRPRTERR));
    flash.program(0x4000, false, 0, NOW);
    assert!(flash.take_complaint().unwrap().bus_error);
    flash.write(0x10, 0, NOW).unwrap();
    flash.program(0x4000, true, 0, NOW);
    assert_eq!(flash.next_event(), None, "PG is clear");
    assert!(!flash.take_complaint().unwrap().bus_error);
}

#[test]
fn locking_again_closes_and_a_write_while_locked_is_reported() {
    let mut flash = open();
    flash.write(0x10, CR_LOCK, NOW).unwrap();
    assert_eq!(flash.take_complaint(), None);
    flash.write(0x10, CR_PG, NOW).unwrap();
    assert!(flash.take_complaint().is_some());
    assert_eq!(flash.read(0x10, NOW), Ok(CR_LOCK));
}

#[test]
fn nothing_happens_without_the_hsi() {
    let mut flash = open();
    flash.hsi_on = false;
    program(&mut flash, 0, 0);
    assert_eq!(flash.next_event(), None);
    assert!(flash.take_complaint().is_some());
}

#[test]
fn mass_erase_clears_every_page_and_none_when_one_is_protected() {
    for (wrpr, status) in [(u32::MAX, SR_BSY), (!1, SR_WRPRTERR)] {
        let mut flash = Flash::new(&STM32F103CB, wrpr, SEED);
        flash.bytes_mut().fill(0);
        unlock(&mut flash);
        flash.write(0x10, CR_MER, NOW).unwrap();
        flash.write(0x10, CR_MER | CR_STRT, NOW).unwrap();
        let _ = flash.read(0x0C, NOW);
        assert_eq!(flash.read(0x0C, NOW), Ok(status));
        flash.advance(Time::from_ms(30));
        let byte = if status == SR_BSY { 0xFF } else { 0 };
        assert!(flash.bytes().iter().all(|b| *b == byte));
    }
}

#[test]
fn interrupts_report_the_end_and_the_errors_that_are_enabled() {
    for (enabled, value, end, error) in [(CR_EOPIE, 1, true, false), (CR_ERRIE, 1, false, true)] {
        let mut flash = open();
        flash.write(0x10, CR_PG | enabled, NOW).unwrap();
        flash.program(0, true, value, NOW);
        assert!(!flash.irq());
        flash.advance(Time::from_ms(1));
        assert_eq!(flash.irq(), end);
        flash.write(0x0C, SR_EOP, NOW).unwrap();
        assert!(!flash.irq());
        flash.program(0, true, 2, NOW);
        assert_eq!(flash.irq(), error, "not erased");
    }
}

impl Flash {
    fn half_at(&mut self, at: usize) -> u16 {
        u16::from_le_bytes(self.cells.read(at))
    }
}

#[test]
fn a_high_density_part_erases_and_protects_pages_of_2_kib() {
    let mut flash = Flash::new(&STM32F103RC, !2, SEED);
    flash.bytes_mut().fill(0);
    unlock(&mut flash);
    let mut erase = |offset: u32, now: Time| {
        erase(&mut flash, offset, now);
        flash.advance(now + Time::from_ms(30));
        let status = flash.read(0x0C, now).unwrap();
        flash.write(0x0C, status, now).unwrap();
        (status, flash.take_changed(), flash.take_complaint())
    };
    let last = 256 * 1024 - 0x800;
    let changed = Some((last as usize, 256 * 1024));
    assert_eq!(erase(last + 0x400, NOW), (SR_EOP, changed, None));
    // Bit 1 of FLASH_WRPR: pages 2 and 3.
    assert_eq!(erase(0x1000, NOW), (SR_WRPRTERR, None, None));
    assert_eq!(erase(0x1FFF, NOW), (SR_WRPRTERR, None, None));
    assert_eq!(erase(0x2000, NOW).1, Some((0x2000, 0x2800)));
    assert!(erase(256 * 1024, NOW).2.is_some(), "beyond the last page");
}
