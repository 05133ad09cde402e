//! The I2C block's registers and bits (RM0008 26.6) by their names there.

/// Offsets, 26.6.10.
pub mod offset {
    pub const CR1: u32 = 0x00;
    pub const CR2: u32 = 0x04;
    pub const OAR1: u32 = 0x08;
    pub const OAR2: u32 = 0x0C;
    pub const DR: u32 = 0x10;
    pub const SR1: u32 = 0x14;
    pub const SR2: u32 = 0x18;
    pub const CCR: u32 = 0x1C;
    pub const TRISE: u32 = 0x20;
}

/// Control register 1, 26.6.1.
pub mod cr1 {
    pub const PE: u32 = 1 << 0;
    pub const START: u32 = 1 << 8;
    pub const STOP: u32 = 1 << 9;
    pub const ACK: u32 = 1 << 10;
    pub const POS: u32 = 1 << 11;
    pub const SWRST: u32 = 1 << 15;
    pub const MASK: u32 = 0xBFFB;
    /// The bits that this model implements.
    pub const MODELLED: u32 = PE | START | STOP | ACK | POS | SWRST;
}

/// Control register 2, 26.6.2.
pub mod cr2 {
    pub const FREQ: u32 = 0x3F;
    pub const ITERREN: u32 = 1 << 8;
    pub const ITEVTEN: u32 = 1 << 9;
    pub const ITBUFEN: u32 = 1 << 10;
    pub const DMA: u32 = 3 << 11;
    pub const MASK: u32 = 0x1F3F;
}

/// Status register 1, 26.6.6.
pub mod sr1 {
    pub const SB: u32 = 1 << 0;
    pub const ADDR: u32 = 1 << 1;
    pub const BTF: u32 = 1 << 2;
    pub const RXNE: u32 = 1 << 6;
    pub const TXE: u32 = 1 << 7;
    pub const BERR: u32 = 1 << 8;
    pub const ARLO: u32 = 1 << 9;
    pub const AF: u32 = 1 << 10;
    /// Cleared by writing 0.
    pub const RC_W0: u32 = 0xDF00;
    /// The events that interrupt with ITEVTEN alone.
    pub const EVENTS: u32 = SB | ADDR | BTF;
    pub const BUFFER: u32 = RXNE | TXE;
    pub const ERRORS: u32 = 0xDF00;
}

/// Status register 2, 26.6.7.
pub mod sr2 {
    pub const MSL: u32 = 1 << 0;
    pub const BUSY: u32 = 1 << 1;
    pub const TRA: u32 = 1 << 2;
}

/// Clock control register, 26.6.8.
pub mod ccr {
    pub const CCR: u32 = 0xFFF;
    pub const DUTY: u32 = 1 << 14;
    pub const FAST: u32 = 1 << 15;
    pub const MASK: u32 = 0xCFFF;
}
