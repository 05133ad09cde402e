//! What one part of the family has and another has not: memories, pins, identity.
//!
//! A part has a register block if RCC has a bit for its clock (RM0008 1.3 and table 3). A block of a larger part that
//! is not modelled is reported by its name when it is accessed.

use crate::soc::map::Block;

/// Number of ports that are modelled: A to E.
pub const PORTS: usize = 5;

/// The package's pins of ports A to E, one bit each.
type Ports = [u16; PORTS];

/// LQFP48 (DS5319 table 5).
const LQFP48: Ports = [0xFFFF, 0xFFFF, 0xE000, 0x0003, 0];
/// LQFP64 (DS5792 table 5).
const LQFP64: Ports = [0xFFFF, 0xFFFF, 0xFFFF, 0x0007, 0];
/// LQFP100 (DS5792 table 5).
const LQFP100: Ports = [0xFFFF; PORTS];

/// A part of the STM32F103 family.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Its name.
    pub name: &'static str,
    /// Bytes of flash; the register of the flash's size holds them in KiB (RM0008 30.1.1).
    pub flash_size: usize,
    /// Bytes that a page erase erases.
    pub page_size: usize,
    /// Bytes of SRAM.
    pub ram_size: usize,
    /// The pins of each port from A on, one bit each. Pins with an analog function are inputs of ADC1.
    pub ports: Ports,
    /// The interrupt lines that the NVIC has.
    pub interrupt_lines: u16,
    /// CPUID of the core (PM0056 4.4.1).
    pub cpuid: u32,
    /// DBGMCU_IDCODE: device and revision (RM0008 31.6.1).
    pub idcode: u32,
    /// The bits that RCC_AHBENR, RCC_APB2ENR and RCC_APB1ENR keep.
    pub clock_enables: [u32; 3],
    /// Blocks that this part has beyond those of the medium-density parts, none of which is modelled: base
    /// address and name.
    pub more_blocks: &'static [(u32, &'static str)],
}

/// Medium density, 64 KiB of flash (DS5319).
pub const STM32F103C8: Part = Part {
    name: "STM32F103C8",
    flash_size: 64 * 1024,
    ..STM32F103CB
};

/// Medium density, 128 KiB of flash (DS5319; pages: PM0075 table 2; interrupts: RM0008 table 63).
pub const STM32F103CB: Part = Part {
    name: "STM32F103CB",
    flash_size: 128 * 1024,
    page_size: 1024,
    ram_size: 20 * 1024,
    ports: LQFP48,
    interrupt_lines: 43,
    // Revision r1p1.
    cpuid: 0x411F_C231,
    // Revision Y.
    idcode: 0x2003_6410,
    // Read back from two boards after all ones were written (labwired-core, stm32f1_mmio_diff.rs).
    clock_enables: [0x55, 0x5E7D, 0x1AE6_4807],
    more_blocks: &[],
};

/// High density, 256 KiB of flash (DS5792; pages: PM0075 table 3; interrupts: RM0008 table 63).
pub const STM32F103RC: Part = Part {
    name: "STM32F103RC",
    flash_size: 256 * 1024,
    page_size: 2 * 1024,
    ram_size: 48 * 1024,
    ports: LQFP64,
    interrupt_lines: 60,
    cpuid: 0x411F_C231,
    // Revision Y.
    idcode: 0x1003_6414,
    // RM0008 7.3.6 to 7.3.8, without the bits that only connectivity-line and XL-density parts have.
    clock_enables: [0x557, 0xFFFD, 0x3AFE_C83F],
    more_blocks: &[
        (0x4000_0C00, "TIM5"),
        (0x4000_1000, "TIM6"),
        (0x4000_1400, "TIM7"),
        (0x4000_3C00, "SPI3"),
        (0x4000_5000, "UART5"),
        (0x4001_1C00, "GPIOF"),
        (0x4001_2000, "GPIOG"),
        (0x4001_3400, "TIM8"),
        (0x4001_3C00, "ADC3"),
        (0x4001_8000, "SDIO"),
    ],
};

/// As STM32F103RC in the package with 100 pins.
pub const STM32F103VC: Part = Part {
    name: "STM32F103VC",
    ports: LQFP100,
    ..STM32F103RC
};

/// Flash and SRAM in KiB of the STM32F103 with each last letter of its name, and that letter (the data sheets of the
/// four densities).
const SIZES: [(usize, usize, char); 9] = [
    (16, 6, '4'),
    (32, 10, '6'),
    (64, 20, '8'),
    (128, 20, 'B'),
    (256, 48, 'C'),
    (384, 64, 'D'),
    (512, 64, 'E'),
    (768, 96, 'F'),
    (1024, 96, 'G'),
];

impl Part {
    /// Checks that this part has at least these bytes of flash and SRAM. The error names a part that has them.
    pub(crate) fn check_memories(&self, flash: usize, ram: usize) -> Result<(), String> {
        if flash <= self.flash_size && ram <= self.ram_size {
            return Ok(());
        }
        let kib = |bytes: usize| bytes.div_ceil(1024);
        let mut sizes = SIZES.iter();
        let enough = sizes.find(|(f, r, _)| kib(flash) <= *f && kib(ram) <= *r);
        let other = match enough {
            Some((flash, ram, letter)) => {
                format!("an STM32F103x{letter} with {flash} and {ram} KiB would do")
            }
            None => "no STM32F103 has so much".to_owned(),
        };
        Err(format!(
            "the image needs {} KiB of flash and {} KiB of SRAM, but the {} has {} and {} KiB: {other}",
            kib(flash),
            kib(ram),
            self.name,
            kib(self.flash_size),
            kib(self.ram_size),
        ))
    }

    /// Returns whether the part has `block`.
    #[must_use]
    pub fn has(&self, block: Block) -> bool {
        // The order of `Block::clock`: APB2, APB1, AHB.
        let [ahb, apb2, apb1] = self.clock_enables;
        block
            .clock()
            .is_none_or(|(bus, bit)| [apb2, apb1, ahb][bus] >> bit & 1 != 0)
    }

    /// Returns the unmodelled block at `address` that only larger parts have, if this part has it.
    #[must_use]
    pub fn unmodelled(&self, address: u32) -> Option<&'static str> {
        self.more_blocks
            .iter()
            .find(|(base, _)| address & !0x3FF == *base)
            .map(|&(_, name)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusal_of_an_image_names_the_smallest_part_that_would_do() {
        const KIB: usize = 1024;
        let check = |part: &Part, flash, ram| part.check_memories(flash, ram);
        for part in [&STM32F103C8, &STM32F103CB, &STM32F103RC, &STM32F103VC] {
            assert_eq!(check(part, part.flash_size, part.ram_size), Ok(()));
        }
        for (flash, ram, part) in [
            (1, 20 * KIB + 4, "STM32F103xC"),
            (129 * KIB, 1, "STM32F103xC"),
            (1, 64 * KIB, "STM32F103xD"),
            (385 * KIB, 1, "STM32F103xE"),
            (1, 65 * KIB, "STM32F103xF"),
            (1025 * KIB, 1, "no STM32F103"),
            (1, 97 * KIB, "no STM32F103"),
        ] {
            let text = check(&STM32F103CB, flash, ram).unwrap_err();
            assert!(
                text.contains(part) && text.contains("STM32F103CB has 128 and 20"),
                "{text}"
            );
        }
        assert!(
            check(&STM32F103C8, 65 * KIB, 1)
                .unwrap_err()
                .contains("xB with 128 and 20")
        );
    }
}
