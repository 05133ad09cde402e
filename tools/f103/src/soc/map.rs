//! The memory map of the register blocks (RM0008 table 3), their clocks, and the access widths that they allow.

/// A register block that is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Block {
    /// General-purpose timer 2.
    Tim2,
    /// General-purpose timer 3.
    Tim3,
    /// General-purpose timer 4.
    Tim4,
    /// Independent watchdog.
    Iwdg,
    /// USART2.
    Usart2,
    /// USART3.
    Usart3,
    /// UART4, of high-density parts.
    Uart4,
    /// I2C1.
    I2c1,
    /// Controller area network.
    Can,
    /// Digital-to-analog converter, of high-density parts.
    Dac,
    /// Alternate-function I/O.
    Afio,
    /// External interrupts.
    Exti,
    /// Port A.
    GpioA,
    /// Port B.
    GpioB,
    /// Port C.
    GpioC,
    /// Port D.
    GpioD,
    /// Port E.
    GpioE,
    /// Analog-to-digital converter 1.
    Adc1,
    /// Advanced timer 1.
    Tim1,
    /// USART1.
    Usart1,
    /// Reset and clock control.
    Rcc,
    /// Flash interface.
    Flash,
    /// Power control.
    Pwr,
    /// CRC unit.
    Crc,
    /// DMA controller 1.
    Dma1,
    /// DMA controller 2, of high-density parts.
    Dma2,
}

/// Number of blocks that are modelled.
pub const BLOCKS: usize = 26;

/// The owner of an address in the peripheral region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A modelled block.
    Block(Block),
    /// A block of the part that is not modelled, with its name.
    Absent(&'static str),
    /// Reserved.
    Reserved,
}

/// Start address of the peripheral region.
pub const BASE: u32 = 0x4000_0000;
/// Every block starts at a multiple of this number of bytes.
const GRAIN: u32 = 0x400;
/// Number of grains up to the last block.
const GRAINS: usize = 0x2_4000 / GRAIN as usize;

/// Base address and owner of each block of the part.
const PLACES: [(u32, Place); 37] = {
    use Block as B;
    use Place::{Absent, Reserved};
    [
        (0x4000_0000, Place::Block(B::Tim2)),
        (0x4000_0400, Place::Block(B::Tim3)),
        (0x4000_0800, Place::Block(B::Tim4)),
        (0x4000_2800, Absent("RTC")),
        (0x4000_2C00, Absent("WWDG")),
        (0x4000_3000, Place::Block(B::Iwdg)),
        (0x4000_3800, Absent("SPI2")),
        (0x4000_4400, Place::Block(B::Usart2)),
        (0x4000_4800, Place::Block(B::Usart3)),
        (0x4000_4C00, Place::Block(B::Uart4)),
        (0x4000_5400, Place::Block(B::I2c1)),
        (0x4000_5800, Absent("I2C2")),
        (0x4000_5C00, Absent("USB")),
        (0x4000_6000, Absent("USB/CAN SRAM")),
        (0x4000_6400, Place::Block(B::Can)),
        (0x4000_6C00, Absent("BKP")),
        (0x4000_7000, Place::Block(B::Pwr)),
        (0x4000_7400, Place::Block(B::Dac)),
        (0x4001_0000, Place::Block(B::Afio)),
        (0x4001_0400, Place::Block(B::Exti)),
        (0x4001_0800, Place::Block(B::GpioA)),
        (0x4001_0C00, Place::Block(B::GpioB)),
        (0x4001_1000, Place::Block(B::GpioC)),
        (0x4001_1400, Place::Block(B::GpioD)),
        (0x4001_1800, Place::Block(B::GpioE)),
        (0x4001_2400, Place::Block(B::Adc1)),
        (0x4001_2800, Absent("ADC2")),
        (0x4001_2C00, Place::Block(B::Tim1)),
        (0x4001_3000, Absent("SPI1")),
        (0x4001_3800, Place::Block(B::Usart1)),
        (0x4002_0000, Place::Block(B::Dma1)),
        (0x4002_0400, Place::Block(B::Dma2)),
        (0x4002_1000, Place::Block(B::Rcc)),
        (0x4002_2000, Place::Block(B::Flash)),
        (0x4002_3000, Place::Block(B::Crc)),
        // The rest of the last grains of AHB blocks is reserved.
        (0x4002_1400, Reserved),
        (0x4002_2400, Reserved),
    ]
};

/// Owner of each grain.
static TABLE: [Place; GRAINS] = {
    let mut table = [Place::Reserved; GRAINS];
    let mut n = 0;
    while n < PLACES.len() {
        let (base, place) = PLACES[n];
        table[((base - BASE) / GRAIN) as usize] = place;
        n += 1;
    }
    table
};

/// Returns the owner of `address`, and the offset of the address in its block.
#[must_use]
pub fn place(address: u32) -> (Place, u32) {
    let grain = (address.wrapping_sub(BASE) / GRAIN) as usize;
    match TABLE.get(grain) {
        Some(&place) => (place, address % GRAIN),
        None => (Place::Reserved, 0),
    }
}

/// Access widths that a block allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Widths {
    /// Words only.
    Word,
    /// Half-words and words.
    HalfWord,
    /// Bytes, half-words and words.
    Any,
}

/// A block: its name in RM0008, the bus and the bit of [`Block::clock`], and the access widths with which the section of
/// its registers in RM0008 begins.
type Facts = (Block, &'static str, Option<(usize, u32)>, Widths);

/// Every block, in the order of the numbers.
const BLOCK_FACTS: [Facts; BLOCKS] = {
    use Block as B;
    use Widths::{Any, HalfWord, Word};
    [
        (B::Tim2, "TIM2", Some((1, 0)), HalfWord),
        (B::Tim3, "TIM3", Some((1, 1)), HalfWord),
        (B::Tim4, "TIM4", Some((1, 2)), HalfWord),
        (B::Iwdg, "IWDG", None, HalfWord),
        (B::Usart2, "USART2", Some((1, 17)), HalfWord),
        (B::Usart3, "USART3", Some((1, 18)), HalfWord),
        (B::Uart4, "UART4", Some((1, 19)), HalfWord),
        (B::I2c1, "I2C1", Some((1, 21)), HalfWord),
        (B::Can, "CAN", Some((1, 25)), Word),
        (B::Dac, "DAC", Some((1, 29)), Word),
        (B::Afio, "AFIO", Some((0, 0)), Word),
        (B::Exti, "EXTI", None, Word),
        (B::GpioA, "GPIOA", Some((0, 2)), Word),
        (B::GpioB, "GPIOB", Some((0, 3)), Word),
        (B::GpioC, "GPIOC", Some((0, 4)), Word),
        (B::GpioD, "GPIOD", Some((0, 5)), Word),
        (B::GpioE, "GPIOE", Some((0, 6)), Word),
        (B::Adc1, "ADC1", Some((0, 9)), Word),
        (B::Tim1, "TIM1", Some((0, 11)), HalfWord),
        (B::Usart1, "USART1", Some((0, 14)), HalfWord),
        (B::Rcc, "RCC", None, Any),
        (B::Flash, "FLASH", None, Word),
        (B::Pwr, "PWR", Some((1, 28)), HalfWord),
        (B::Crc, "CRC", Some((2, 6)), Word),
        (B::Dma1, "DMA1", Some((2, 0)), Word),
        (B::Dma2, "DMA2", Some((2, 1)), Word),
    ]
};

impl Block {
    /// Every block, in the order of the numbers.
    pub const ALL: [Self; BLOCKS] = {
        let mut all = [Self::Tim2; BLOCKS];
        let mut n = 0;
        while n < BLOCKS {
            all[n] = BLOCK_FACTS[n].0;
            n += 1;
        }
        all
    };

    /// Returns the block whose clock and reset are bit `bit` of RCC's registers for APB2 (`bus` 0) or APB1 (`bus` 1).
    #[must_use]
    pub fn of_bit(bus: usize, bit: u32) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|block| block.clock() == Some((bus, bit)))
    }

    /// Returns the bus, APB2 (0), APB1 (1) or AHB (2), and the bit in RCC's registers that enables the clock of the block
    /// and, on APB1 and APB2, resets it (RM0008 7.3.4 to 7.3.8). `None` if the block always has its clock.
    #[must_use]
    pub const fn clock(self) -> Option<(usize, u32)> {
        BLOCK_FACTS[self as usize].2
    }

    /// Returns the access widths that the block allows.
    #[must_use]
    pub const fn widths(self) -> Widths {
        BLOCK_FACTS[self as usize].3
    }

    /// Returns the name of the block in RM0008.
    #[must_use]
    pub const fn name(self) -> &'static str {
        BLOCK_FACTS[self as usize].1
    }
}

/// The interrupt lines (RM0008 table 63).
pub mod irq {
    /// Number of lines of the largest parts.
    pub const LINES: u16 = 60;
    /// FLASH.
    pub const FLASH: u16 = 4;
    /// ADC1 and ADC2.
    pub const ADC1: u16 = 18;
    /// TIM1 update.
    pub const TIM1_UP: u16 = 25;
    /// TIM1 capture and compare.
    pub const TIM1_CC: u16 = 27;
    /// TIM2.
    pub const TIM2: u16 = 28;
    /// TIM3.
    pub const TIM3: u16 = 29;
    /// TIM4.
    pub const TIM4: u16 = 30;
    /// I2C1 event.
    pub const I2C1_EV: u16 = 31;
    /// I2C1 error.
    pub const I2C1_ER: u16 = 32;
    /// USART1.
    pub const USART1: u16 = 37;
    /// USART2.
    pub const USART2: u16 = 38;
    /// USART3.
    pub const USART3: u16 = 39;
    /// UART4.
    pub const UART4: u16 = 52;

    /// The lines of DMA1, each with a mask of the channels that share it.
    pub const DMA1: [(u16, u32); 7] = [
        (11, 1 << 0),
        (12, 1 << 1),
        (13, 1 << 2),
        (14, 1 << 3),
        (15, 1 << 4),
        (16, 1 << 5),
        (17, 1 << 6),
    ];
    /// The lines of DMA2, as for DMA1.
    pub const DMA2: [(u16, u32); 4] = [(56, 1 << 0), (57, 1 << 1), (58, 1 << 2), (59, 0x18)];

    /// The lines of EXTI, each with a mask of the pins that share it.
    pub const EXTI: [(u16, u32); 7] = [
        (6, 1 << 0),
        (7, 1 << 1),
        (8, 1 << 2),
        (9, 1 << 3),
        (10, 1 << 4),
        (23, 0x03E0),
        (40, 0xFC00),
    ];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_returns_the_block_of_an_address() {
        assert_eq!(place(0x4001_3804), (Place::Block(Block::Usart1), 4));
        assert_eq!(place(0x4000_0C00).0, Place::Reserved);
        assert_eq!(place(0x4001_2800).0, Place::Absent("ADC2"));
        assert_eq!(place(0x4003_0000).0, Place::Reserved);
        assert_eq!(place(0x3FFF_FFFF).0, Place::Reserved);
        for (n, block) in Block::ALL.into_iter().enumerate() {
            assert_eq!(block as usize, n);
            if let Some((bus, bit)) = block.clock() {
                assert_eq!(Block::of_bit(bus, bit), Some(block));
            }
        }
    }
}
