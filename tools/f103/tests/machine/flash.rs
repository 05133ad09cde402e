//! The flash: stalls, code in SRAM during an operation, power cuts.

use f103::Time;
use f103::chip::Config;
use f103::periph::flash::Torn;

use super::asm::{Asm, When};
use super::regs::*;
use super::{chip_with, findings, out};

/// Address of the page that the programs use: the last but one.
pub const PAGE: u32 = 0x0801_F800;
pub const OFFSET: usize = 0x1_F800;

pub fn unlock(program: &mut Asm) {
    program.store(FLASH_KEYR, 0x4567_0123);
    program.store(FLASH_KEYR, 0xCDEF_89AB);
}

/// Erases [`PAGE`]. The last instruction starts the erase.
pub fn erase(program: &mut Asm) {
    program.store(FLASH_CR, 2);
    program.store(FLASH_AR, PAGE);
    program.store(FLASH_CR, 0x42);
}

/// The eight instructions that the core may have fetched in advance. The next one waits for the end of the operation.
pub fn wait(program: &mut Asm) {
    (0..8).for_each(|_| program.nop());
}

pub fn program_half(program: &mut Asm, offset: u32, value: u32) {
    program.store(FLASH_CR, 1);
    program.set(0, PAGE + offset);
    program.set(1, value);
    program.strh(1, 0, 0);
}

fn filled() -> Config {
    Config {
        flash: Some(vec![0; 128 * 1024]),
        ..Config::default()
    }
}

#[test]
fn code_in_flash_stalls_for_the_whole_operation() {
    let mut program = Asm::new();
    unlock(&mut program);
    erase(&mut program);
    let after = program.address();
    program.copy(FLASH_SR, OUT);
    program.copy(FLASH_SR, OUT + 4);
    program_half(&mut program, 0, 0x1234);
    program.copy(FLASH_SR, OUT + 8);
    program.copy(FLASH_SR, OUT + 12);
    let programmed = program.address();
    program.spin();
    let mut chip = chip_with(&program.image(), filled());
    let limit = Time::from_ms(100);

    assert!(chip.run_until_pc(after - 2, limit), "at the store");
    let (before, count) = (chip.now(), chip.instructions());
    assert!(chip.run_until_pc(after, limit));
    assert_eq!(chip.instructions(), count + 1);
    // Two moves and the load of FLASH_SR: BSY is set late.
    chip.step(3);
    assert_eq!((chip.register(1), chip.flash()[OFFSET]), (Some(0), 0));
    // The rest of the instructions that the core may have fetched in advance.
    chip.step(5);
    assert!(chip.now() < before + Time::from_ms(1));
    chip.step(1);
    // The store and a load in addition to the 30 ms.
    let more = (chip.now() - before).as_ps() - 30_000_000_000;
    assert_eq!(more, Time::cycles(3, 8_000_000).as_ps());
    assert!(chip.run_until_pc(programmed, limit));
    assert!(
        chip.flash()[OFFSET + 2..OFFSET + 1024]
            .iter()
            .all(|&b| b == 0xFF)
    );
    assert_eq!(chip.flash()[OFFSET..OFFSET + 2], [0x34, 0x12]);
    assert_eq!(chip.flash()[OFFSET - 1], 0);
    let read = [0, 1, 2, 3].map(|n| out(&chip, n));
    assert_eq!(
        read,
        [0, 0x20, 0x21, 0x20],
        "BSY of an erase is set late, that of a half-word is not; EOP stays set"
    );
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn a_run_can_end_in_the_middle_of_a_stall() {
    let mut program = Asm::new();
    unlock(&mut program);
    erase(&mut program);
    let after = program.address();
    program.spin();
    let mut chip = chip_with(&program.image(), filled());
    chip.run_until(Time::from_ms(10));
    assert_eq!((chip.now(), chip.pc()), (Time::from_ms(10), after));
    let count = chip.instructions();
    chip.run_until(Time::from_ms(30));
    assert_eq!(chip.instructions(), count);
    assert_eq!(chip.flash()[OFFSET], 0, "the page is not erased yet");
    chip.run_until(Time::from_ms(40));
    assert!(chip.instructions() > count);
    assert_eq!(chip.flash()[OFFSET], 0xFF);
}

/// A piece of code in SRAM that starts an erase, counts in r7 while BSY is set, and returns.
#[test]
fn code_in_sram_runs_during_an_operation_and_stalls_when_it_returns() {
    const CODE: u32 = 0x2000_1000;
    let mut ram = Asm::at(CODE);
    erase(&mut ram);
    ram.set(7, 0);
    let top = ram.here();
    ram.add(7, 1);
    ram.set(6, 20_000);
    ram.raw(0x42B7); // cmp r7, r6
    ram.branch(When::NotEqual, top);
    ram.copy(FLASH_SR, OUT);
    ram.bx(14);

    let mut program = Asm::new();
    unlock(&mut program);
    program.set(3, CODE | 1);
    program.blx(3);
    let back = program.address();
    program.copy(FLASH_SR, OUT + 4);
    program.spin();
    let mut chip = chip_with(&program.image(), filled());
    let code = ram.bytes();
    chip.ram_mut()[0x1000..0x1000 + code.len()].copy_from_slice(&code);

    assert!(chip.run_until_pc(back, Time::from_ms(200)));
    assert_eq!(out(&chip, 0), 1, "BSY is seen from SRAM");
    // 100 000 instructions take 15 ms; the erase takes twice as long.
    assert!(chip.instructions() > 100_000);
    chip.step(10);
    assert_eq!(
        out(&chip, 1),
        0x20,
        "the operation has ended when flash is fetched again"
    );
    let at = chip.now().as_us();
    assert!((32_500..32_700).contains(&at), "{at}");
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn code_in_sram_that_reads_flash_stalls_until_the_operation_ends_and_is_reported() {
    const CODE: u32 = 0x2000_1000;
    let mut ram = Asm::at(CODE);
    ram.store(OUT + 8, 0);
    erase(&mut ram);
    ram.copy(FLASH_SR, OUT);
    ram.copy(0x0800_0100, OUT + 4);
    ram.copy(FLASH_SR, OUT + 8);
    ram.spin();

    let mut program = Asm::new();
    unlock(&mut program);
    program.set(3, CODE | 1);
    program.bx(3);
    let mut chip = chip_with(&program.image(), Config::default());
    let first = u32::from_le_bytes(chip.flash()[0x100..0x104].try_into().unwrap());
    let code = ram.bytes();
    chip.ram_mut()[0x1000..0x1000 + code.len()].copy_from_slice(&code);

    chip.run_until(Time::from_ms(10));
    assert_eq!(out(&chip, 2), 0, "the read of flash stalls");
    chip.run_until(Time::from_ms(50));
    assert_eq!([0, 1, 2].map(|n| out(&chip, n)), [0, first, 0x20]);
    let text = "read of 0x08000100: code in SRAM reads flash while flash is erased or programmed";
    assert_eq!(findings(&chip), [text]);
}

#[test]
fn program_reads_unsteady_cells_differently_from_read_to_read() {
    // Erases a page that holds 0, and reads sixteen words of another page twice each.
    let mut program = Asm::new();
    program.set(3, PAGE);
    program.ldr(4, 3, 0);
    program.cmp(4, 0);
    let filled_page = program.forward(When::Equal);
    program.set(6, OUT);
    for word in 0..16 {
        for read in 0..2 {
            program.ldr(4, 3, 4 * word);
            program.str(4, 6, 4 * word + 64 * read);
        }
    }
    program.spin();
    program.land(filled_page);
    unlock(&mut program);
    erase(&mut program);
    program.spin();

    let mut chip = chip_with(&program.image(), filled());
    chip.cut_in_flash_operation(1, 0.5);
    chip.run_until(Time::from_ms(60));
    assert!(!chip.powered());
    chip.power_on();
    chip.run_until(Time::from_ms(70));
    let reads = |from| -> Vec<u32> { (from..from + 16).map(|n| out(&chip, n)).collect() };
    assert_ne!(reads(0), reads(16));
}

#[test]
fn power_cut_between_any_two_instructions_keeps_the_written_half_words() {
    // The program writes 0x1111 to 0x4444 to four half-words, then loops.
    let image = || {
        let mut program = Asm::new();
        unlock(&mut program);
        for n in 0..4 {
            program_half(&mut program, 2 * n, 0x1111 * (n + 1));
            wait(&mut program);
        }
        program.store(OUT, 0xD0);
        program.spin();
        program.image()
    };
    let all: Vec<u8> = (1..=4u8).flat_map(|n| [n * 0x11; 2]).collect();
    for cut in 0..100 {
        let mut chip = chip_with(&image(), Config::default());
        // The test does not cover the cells of a torn half-word.
        chip.set_torn(Torn::Before);
        chip.step(cut);
        chip.power_off();
        let left = chip.flash()[OFFSET..OFFSET + 8].to_vec();
        let written = left.iter().take_while(|&&b| b != 0xFF).count();
        assert_eq!(written % 2, 0, "every half-word is completely old or new");
        assert_eq!(left[..written], all[..written], "after {cut}");
        chip.power_on();
        assert_eq!(chip.resets(), 0);
        assert_eq!(chip.flash()[OFFSET..OFFSET + 8], left);
        chip.run_for(Time::from_ms(10));
        // The flash refuses to program the same value again, so the rest is as the second run left it.
        assert_eq!(chip.flash()[OFFSET..OFFSET + 8], all, "after {cut}");
    }
}

#[test]
fn new_code_in_flash_is_executed() {
    // A function at PAGE returns 1. It is erased, programmed to return 2, and called each time.
    let mut program = Asm::new();
    program.set(3, PAGE | 1);
    program.blx(3);
    program.set(0, OUT);
    program.str(5, 0, 0);
    unlock(&mut program);
    erase(&mut program);
    wait(&mut program);
    program_half(&mut program, 0, 0x2502); // movs r5, #2
    wait(&mut program);
    program_half(&mut program, 2, 0x4770); // bx lr
    wait(&mut program);
    program.set(3, PAGE | 1);
    program.blx(3);
    program.set(0, OUT);
    program.str(5, 0, 4);
    program.spin();
    let mut flash = vec![0xFF; 128 * 1024];
    flash[OFFSET..OFFSET + 4].copy_from_slice(&[0x01, 0x25, 0x70, 0x47]);
    let config = Config {
        flash: Some(flash),
        ..Config::default()
    };
    let mut chip = chip_with(&program.image(), config);
    chip.run_until(Time::from_ms(50));
    assert_eq!((out(&chip, 0), out(&chip, 1)), (1, 2));
}

#[test]
fn code_copied_to_sram_at_every_start_runs_in_its_last_version() {
    const CODE: u32 = 0x2000_1000;
    let mut program = Asm::new();
    program.copy(PAGE, CODE);
    program.set(3, CODE | 1);
    program.blx(3);
    program.set(0, OUT);
    program.str(5, 0, 0);
    program.spin();
    let mut chip = chip_with(&program.image(), filled());
    for (start, returns) in [1, 1, 2, 2, 1].into_iter().enumerate() {
        chip.power_off();
        let code = [returns, 0x25, 0x70, 0x47]; // movs r5, #returns; bx lr
        chip.flash_mut().expect("the power is off")[OFFSET..OFFSET + 4].copy_from_slice(&code);
        chip.power_on();
        for _ in 0..3 {
            chip.run_for(Time::from_ms(5));
            assert_eq!(out(&chip, 0), returns.into(), "start {start}");
            chip.reset();
        }
    }
}
