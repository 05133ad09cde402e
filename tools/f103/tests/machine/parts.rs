//! Other parts of the family: their memories, pages, identity and pins.

use f103::part::{Part, STM32F103C8, STM32F103CB, STM32F103RC, STM32F103VC};
use f103::periph::gpio::Drive;
use f103::soc::{Circuit, Pin, Pins};
use f103::{Chip, Time, chip};

use super::asm::Asm;
use super::regs::*;

const FLASH_KIB: u32 = 0x1FFF_F7E0;
const IDCODE: u32 = 0xE004_2000;
const TIM5: u32 = 0x4000_0C00;
const I2C1: u32 = 0x4000_5400;
const FLASH_OBR: u32 = 0x4002_201C;
const FLASH_WRPR: u32 = 0x4002_2020;
const IWDG_RLR: u32 = 0x4000_3008;
const GPIOC_IDR: u32 = GPIOC + 8;

/// Returns a part that runs `program`, with nothing connected to its pins.
fn alone(part: &'static Part, program: Asm) -> Chip<()> {
    let config = chip::Config {
        part,
        ..chip::Config::default()
    };
    Chip::in_circuit(&program.image(), config, ()).expect("the program fits")
}

/// Copies the words at `addresses` to consecutive words from [`OUT`].
fn copies(addresses: &[u32]) -> Asm {
    let mut program = Asm::new();
    for (from, n) in addresses.iter().zip(0..) {
        program.copy(*from, OUT + 4 * n);
    }
    program.spin();
    program
}

fn out<C: Circuit>(chip: &Chip<C>, n: u32) -> u32 {
    chip.word(OUT + 4 * n).expect("in SRAM")
}

fn findings<C: Circuit>(chip: &Chip<C>) -> Vec<String> {
    let findings = chip.findings().iter();
    findings.map(|finding| finding.what.to_string()).collect()
}

#[test]
fn each_part_has_its_memories_and_its_identity() {
    for (part, kib, device) in [
        (&STM32F103C8, 64, 0x410),
        (&STM32F103CB, 128, 0x410),
        (&STM32F103RC, 256, 0x414),
        (&STM32F103VC, 256, 0x414),
    ] {
        let mut chip = alone(part, copies(&[FLASH_KIB, IDCODE]));
        chip.run_until(Time::from_ms(3));
        assert_eq!(out(&chip, 0) & 0xFFFF, kib, "{}", part.name);
        assert_eq!(out(&chip, 1) & 0xFFF, device, "{}", part.name);
        assert_eq!(chip.flash().len(), kib as usize * 1024);
        assert_eq!(chip.ram().len(), part.ram_size);
        assert_eq!(findings(&chip), [""; 0]);
    }
}

#[test]
fn an_address_after_the_last_of_a_memory_is_a_bus_fault() {
    for (part, address) in [
        (&STM32F103C8, 0x0801_0000),
        (&STM32F103CB, 0x0802_0000),
        (&STM32F103RC, 0x0804_0000),
        (&STM32F103C8, 0x2000_5000),
        (&STM32F103RC, 0x2000_C000),
    ] {
        let mut chip = alone(part, copies(&[address - 4]));
        chip.run_until(Time::from_ms(3));
        assert_eq!(findings(&chip), [""; 0], "{} {address:#x}", part.name);
        let mut chip = alone(part, copies(&[address]));
        chip.run_until(Time::from_ms(3));
        assert_eq!(findings(&chip).len(), 1, "{} {address:#x}", part.name);
    }
}

#[test]
fn code_in_the_upper_sram_of_a_high_density_part_runs() {
    const UPPER: u32 = 0x2000_A000;
    let mut program = Asm::new();
    // MOVS r0, #42; BX lr.
    program.store(UPPER, 0x4770_202A);
    program.set(3, UPPER | 1);
    program.blx(3);
    program.set(1, OUT);
    program.str(0, 1, 0);
    program.spin();
    let mut chip = alone(&STM32F103RC, program);
    for _ in 0..2 {
        chip.run_for(Time::from_ms(3));
        assert_eq!(out(&chip, 0), 42);
        chip.reset();
    }
}

#[test]
fn a_block_of_larger_parts_is_reported_by_its_name() {
    for (part, address, name) in [
        (&STM32F103CB, TIM5, "reserved address"),
        (&STM32F103RC, TIM5, "TIM5"),
        (&STM32F103CB, UART4, "reserved address"),
        (&STM32F103CB, DMA2, "reserved address"),
        (&STM32F103RC, UART4, "UART4"),
    ] {
        let mut chip = alone(part, copies(&[address]));
        chip.run_until(Time::from_ms(3));
        assert!(findings(&chip)[0].contains(name), "{:?}", findings(&chip));
    }
}

/// Continues a program: it writes all ones to these registers, which must then read back as these bits.
fn check_kept(mut program: Asm, kept: &[(u32, u32)]) -> Chip<()> {
    for ((register, _), n) in kept.iter().zip(0..) {
        program.store(*register, u32::MAX);
        program.copy(*register, OUT + 4 * n);
    }
    program.spin();
    let mut chip = alone(&STM32F103CB, program);
    chip.run_until(Time::from_ms(3));
    for ((register, bits), n) in kept.iter().zip(0..) {
        assert_eq!(out(&chip, n), *bits, "{register:#010x}");
    }
    chip
}

/// What two STM32F103 read back after all ones were written (labwired-core, `stm32f1_mmio_diff.rs`).
#[test]
fn registers_keep_the_bits_that_silicon_keeps() {
    let kept = [
        (RCC_APB1ENR, 0x1AE6_4807),
        (RCC_APB2ENR, 0x5E7D),
        (RCC_AHBENR, 0x55),
        (AFIO + 0x08, 0x7FFF),
        (AFIO + 0x0C, 0x7FFF),
        (AFIO + 0x10, 0x7FFF),
        (AFIO + 0x14, 0x7FFF),
        (TIM2 + 0x04, 0xF8),
        (TIM2 + 0x08, 0xFFF7),
        (TIM2 + 0x0C, 0x5F5F),
        (TIM2 + 0x20, 0x3333),
    ];
    check_kept(Asm::new(), &kept);
}

/// What two STM32F103 returned after reset (labwired-core, `stm32f1_mmio_diff.rs`, `f103_conformance.rs`). The clocks
/// of the blocks after `None` have to be on.
#[test]
fn registers_have_the_reset_values_of_silicon() {
    let values = [
        Some((RCC_CFGR, 0)),
        Some((RCC_AHBENR, 0x14)),
        Some((RCC_APB2ENR, 0)),
        Some((RCC_APB1ENR, 0)),
        Some((RCC_CSR, 0x0C00_0000)),
        Some((FLASH_ACR, 0x30)),
        Some((FLASH_SR, 0)),
        Some((FLASH_CR, 0x80)),
        Some((FLASH_OBR, 0x03FF_FFFC)),
        Some((FLASH_WRPR, u32::MAX)),
        Some((IWDG_PR, 0)),
        Some((IWDG_RLR, 0xFFF)),
        Some((IWDG_SR, 0)),
        Some((EXTI, 0)),
        None,
        Some((USART3, 0xC0)),
        Some((I2C1 + 0x04, 0)),
        Some((I2C1 + 0x20, 2)),
        Some((TIM2, 0)),
        Some((TIM2 + 0x2C, 0xFFFF)),
        Some((ADC1 + 0x04, 0)),
        Some((ADC1 + 0x08, 0)),
    ];
    let mut program = Asm::new();
    for (value, n) in values.iter().zip(0..) {
        match value {
            Some((register, _)) => program.copy(*register, OUT + 4 * n),
            None => clocks_on(&mut program),
        }
    }
    program.spin();
    let mut chip = alone(&STM32F103CB, program);
    chip.run_until(Time::from_ms(3));
    for (value, n) in values.into_iter().zip(0..) {
        if let Some((register, after_reset)) = value {
            assert_eq!(out(&chip, n), after_reset, "{register:#010x}");
        }
    }
    assert_eq!(findings(&chip), [""; 0]);
}

/// What two STM32F103 read back after all ones were written (labwired-core, `stm32f1_mmio_diff.rs`), where every bit is
/// allowed.
#[test]
fn blocks_keep_the_bits_that_silicon_keeps() {
    let kept = [
        (I2C1 + 0x08, 0xC3FF),
        (I2C1 + 0x0C, 0xFF),
        (I2C1 + 0x1C, 0xCFFF),
        (I2C1 + 0x20, 0x3F),
        (TIM2 + 0x24, 0xFFFF),
        (TIM2 + 0x28, 0xFFFF),
        (TIM2 + 0x2C, 0xFFFF),
        (TIM2 + 0x34, 0xFFFF),
        (TIM2 + 0x38, 0xFFFF),
        (TIM2 + 0x3C, 0xFFFF),
        (TIM2 + 0x40, 0xFFFF),
        (USART3 + 0x08, 0xFFFF),
    ];
    let mut program = Asm::new();
    clocks_on(&mut program);
    let chip = check_kept(program, &kept);
    assert_eq!(findings(&chip), [""; 0]);
}

/// Turns the clocks of TIM2, USART3, I2C1 and ADC1 on.
fn clocks_on(program: &mut Asm) {
    program.store(RCC_APB1ENR, 1 | 1 << 18 | 1 << 21);
    program.store(RCC_APB2ENR, 1 << 9);
}

/// A circuit that drives PC0 high, a pin of the packages with 64 pins.
struct HighPc0;

impl Circuit for HighPc0 {
    fn drive(&self, pins: &mut Pins) {
        pins.drive(Pin::new('C', 0), Drive::High);
    }
}

#[test]
fn a_circuit_drives_the_pins_of_a_larger_package() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 4);
    program.copy(GPIOC_IDR, OUT);
    program.spin();
    let config = chip::Config {
        part: &STM32F103RC,
        ..chip::Config::default()
    };
    let mut chip = Chip::in_circuit(&program.image(), config, HighPc0).expect("the program fits");
    chip.run_until(Time::from_ms(3));
    assert_eq!(out(&chip, 0), 1);
}

#[test]
#[should_panic(expected = "STM32F103CB has no pin PC0")]
fn circuit_cannot_drive_a_pin_that_the_package_does_not_have() {
    let _ = Chip::in_circuit(&copies(&[]).image(), chip::Config::default(), HighPc0);
}

#[test]
fn an_image_that_is_too_large_for_the_part_is_refused() {
    let image =
        f103::Image::from_bytes(&[0; 64 * 1024 + 1]).expect("the image fits at least one part");
    for (part, fits) in [(&STM32F103C8, false), (&STM32F103CB, true)] {
        let config = chip::Config {
            part,
            ..chip::Config::default()
        };
        let chip = Chip::in_circuit(&image, config, ());
        assert_eq!(chip.is_ok(), fits, "{}", part.name);
    }
}
