//! The parts that the boards have.

/// First address of flash (RM0008 3.3).
pub const FLASH_BASE: u32 = 0x0800_0000;
/// First address of RAM.
pub const RAM_BASE: u32 = 0x2000_0000;

/// Bytes of a KiB.
pub const KIB: u32 = 1024;

/// A microcontroller of the STM32F103 family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name, as in probe-rs.
    pub name: &'static str,
    /// Bytes of flash.
    pub flash: u32,
    /// Bytes of a flash page, the smallest unit that can be erased (PM0075 2.1).
    pub page: u32,
    /// Bytes of RAM.
    pub ram: u32,
    /// Number of interrupts (RM0008 table 63).
    pub interrupts: u32,
}

/// Medium density (DS5319 table 2).
pub const STM32F103C8: Part = Part {
    name: "STM32F103C8",
    flash: 64 * KIB,
    ..STM32F103CB
};

/// Medium density (DS5319 table 2).
pub const STM32F103CB: Part = Part {
    name: "STM32F103CB",
    flash: 128 * KIB,
    page: KIB,
    ram: 20 * KIB,
    interrupts: 43,
};

/// High density (DS5792 table 2).
pub const STM32F103VC: Part = Part {
    name: "STM32F103VC",
    ..STM32F103RC
};

/// High density (DS5792 table 2).
pub const STM32F103RC: Part = Part {
    name: "STM32F103RC",
    flash: 256 * KIB,
    page: 2 * KIB,
    ram: 48 * KIB,
    interrupts: 60,
};
