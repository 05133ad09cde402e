//! The bits of the USART's registers (RM0008 27.6) by their names there.

/// Status register, 27.6.1.
pub mod sr {
    pub const PE: u32 = 1 << 0;
    pub const FE: u32 = 1 << 1;
    pub const NE: u32 = 1 << 2;
    pub const ORE: u32 = 1 << 3;
    pub const IDLE: u32 = 1 << 4;
    pub const RXNE: u32 = 1 << 5;
    pub const TC: u32 = 1 << 6;
    pub const TXE: u32 = 1 << 7;
    pub const LBD: u32 = 1 << 8;
    pub const CTS: u32 = 1 << 9;
    /// Cleared by writing 0; the others do not change by a write.
    pub const RC_W0: u32 = CTS | LBD | TC | RXNE;
    pub const RESET: u32 = TXE | TC;
}

/// Control register 1, 27.6.4.
pub mod cr1 {
    pub const SBK: u32 = 1 << 0;
    pub const RWU: u32 = 1 << 1;
    pub const RE: u32 = 1 << 2;
    pub const TE: u32 = 1 << 3;
    pub const IDLEIE: u32 = 1 << 4;
    pub const RXNEIE: u32 = 1 << 5;
    pub const TCIE: u32 = 1 << 6;
    pub const TXEIE: u32 = 1 << 7;
    pub const PEIE: u32 = 1 << 8;
    pub const PS: u32 = 1 << 9;
    pub const PCE: u32 = 1 << 10;
    pub const M: u32 = 1 << 12;
    pub const UE: u32 = 1 << 13;
    pub const MASK: u32 = 0x3FFF;
}

/// Control register 2, 27.6.5.
pub mod cr2 {
    pub const STOP: u32 = 3 << 12;
    pub const STOP_ONE: u32 = 0;
    pub const STOP_TWO: u32 = 2 << 12;
    pub const LINEN: u32 = 1 << 14;
    pub const CLKEN: u32 = 1 << 11;
    pub const LBDIE: u32 = 1 << 6;
    pub const MASK: u32 = 0x7F6F;
}

/// Control register 3, 27.6.6.
pub mod cr3 {
    pub const EIE: u32 = 1 << 0;
    pub const DMAR: u32 = 1 << 6;
    pub const DMAT: u32 = 1 << 7;
    pub const MASK: u32 = 0x07FF;
}
