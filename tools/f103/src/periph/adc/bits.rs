//! The registers of the ADC and their bits (RM0008 11.12) by their names there.

/// Offsets, RM0008 11.12.15.
pub mod offset {
    pub const SR: u32 = 0x00;
    pub const CR1: u32 = 0x04;
    pub const CR2: u32 = 0x08;
    pub const SMPR1: u32 = 0x0C;
    pub const SMPR2: u32 = 0x10;
    pub const HTR: u32 = 0x24;
    pub const LTR: u32 = 0x28;
    pub const SQR1: u32 = 0x2C;
    pub const SQR2: u32 = 0x30;
    pub const SQR3: u32 = 0x34;
    pub const DR: u32 = 0x4C;
}

/// SR, 11.12.1.
pub mod sr {
    pub const EOC: u32 = 1 << 1;
    pub const STRT: u32 = 1 << 4;
}

/// CR1, 11.12.2.
pub mod cr1 {
    pub const EOCIE: u32 = 1 << 5;
    pub const SCAN: u32 = 1 << 8;
    pub const MASK: u32 = 0x00CF_FFFF;
    /// Bits without an effect while the features below are off.
    pub const IDLE: u32 = 0xE01F;
}

/// CR2, 11.12.3.
pub mod cr2 {
    pub const ADON: u32 = 1 << 0;
    pub const CONT: u32 = 1 << 1;
    pub const CAL: u32 = 1 << 2;
    pub const RSTCAL: u32 = 1 << 3;
    pub const DMA: u32 = 1 << 8;
    pub const ALIGN: u32 = 1 << 11;
    pub const EXTSEL: u32 = 7 << 17;
    pub const EXTTRIG: u32 = 1 << 20;
    pub const SWSTART: u32 = 1 << 22;
    pub const TSVREFE: u32 = 1 << 23;
    pub const MASK: u32 = 0x00FE_F90F;
    pub const MODELLED: u32 =
        ADON | CONT | CAL | RSTCAL | DMA | ALIGN | EXTSEL | EXTTRIG | SWSTART | TSVREFE;
}
