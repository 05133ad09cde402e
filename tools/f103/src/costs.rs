//! Costs of the core's instructions and exceptions in cycles of HCLK, by class.
//!
//! Sources: the Cortex-M3 TRM, DDI 0337E, 18.2 (instruction timings) and 18.3 (load-store timings), for a memory
//! without wait states; PM0075 and RM0008 3.3.3 for the flash, which reads 64 bits in one cycle and its wait
//! states, with a prefetch buffer of two such lines. What these leave open is a range: [`Costs::NOMINAL`] takes
//! its usual value, [`Costs::SLOW`] its highest everywhere at once, which no part reaches.
//!
//! | class | nominal | slow |
//! |---|---|---|
//! | line of flash fetched in sequence | overlaps the line before it | waits for all wait states |
//! | pipeline refill of a taken branch | 2, and the wait states | 3, the wait states, and the end of a prefetch under way |
//! | branch not taken | 1 | 1, and a fetch of the target that nobody needs |
//! | load; load right after a load or store | 2; 1 | 2; 2 |
//! | store | 1 | 2 |
//! | read of constants in flash | literals: the wait states | all: the wait states, and the end of a prefetch under way |
//! | division, long multiplication | half of their range | the most |
//! | APB access | 2 cycles of PCLK | 3 of PCLK and one of HCLK, for stores too |
//! | interrupt entry | 12, and the wait states | 16, the wait states twice, and the end of a prefetch |
//!
//! The slow entry's 16 contains the wake-up from sleep: 1.8 us at 8 MHz are 14.4 cycles (DS5319 table 26).

/// The costs of a core, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Costs {
    /// Fetches in sequence overlap execution as far as the prefetch buffer lets them.
    pub overlapped_fetch: bool,
    /// Cycles that a prefetch under way delays another read of the flash, beside its wait states.
    pub prefetch_under_way: bool,
    /// P of the TRM's table: the pipeline's refill.
    pub refill: u32,
    /// The target is fetched even when the branch is not taken.
    pub needless_fetch: bool,
    /// A load, on its own.
    pub load: u32,
    /// A load right after a load or a store.
    pub next_load: u32,
    /// A store.
    pub store: u32,
    /// MLA and MLS.
    pub accumulate: u32,
    /// SMULL and UMULL: 3 to 5.
    pub long_multiply: u32,
    /// SMLAL and UMLAL: 4 to 7.
    pub long_accumulate: u32,
    /// SDIV and UDIV: 2 to 12.
    pub divide: u32,
    /// CPS, MSR and MRS: 1 or 2.
    pub system: u32,
    /// DMB and DSB.
    pub barrier: u32,
    /// Code in SRAM: additional cost of each data access, which shares the system bus with the fetches.
    pub shared_bus: u32,
    /// Code in SRAM: additional cost of each word fetched.
    pub sram_fetch: u32,
    /// APB: cycles of PCLK for a load, and cycles of HCLK on top.
    pub apb_load: (u32, u32),
    /// The same for a store.
    pub apb_store: (u32, u32),
    /// A register on the AHB: additional cost compared with SRAM.
    pub ahb: u32,
    /// Exception entry without wait states.
    pub entry: u32,
    /// Exception return without wait states.
    pub exit: u32,
    /// From one handler to the next.
    pub tail_chain: u32,
    /// Reads of the flash's vector and of the handler's first line that an entry waits for.
    pub entry_reads: u32,
    /// Every read of constants in flash is charged, not only a literal's.
    pub charges_tables: bool,
}

impl Costs {
    /// The usual costs by the TRM and the manuals.
    pub const NOMINAL: Self = Self {
        overlapped_fetch: true,
        prefetch_under_way: false,
        refill: 2,
        needless_fetch: false,
        load: 2,
        next_load: 1,
        store: 1,
        accumulate: 2,
        long_multiply: 4,
        long_accumulate: 6,
        divide: 7,
        system: 1,
        barrier: 2,
        shared_bus: 1,
        sram_fetch: 0,
        // 18 MHz at a pin (DS5319, GPIOs): a store every two cycles, one of them the store's own.
        apb_store: (2, 0),
        apb_load: (2, 0),
        ahb: 0,
        entry: 12,
        exit: 12,
        tail_chain: 6,
        entry_reads: 1,
        charges_tables: false,
    };

    /// The slow corner: every cost at its maximum, without overlap.
    pub const SLOW: Self = Self {
        overlapped_fetch: false,
        prefetch_under_way: true,
        refill: 3,
        needless_fetch: true,
        load: 2,
        next_load: 2,
        store: 2,
        accumulate: 2,
        long_multiply: 5,
        long_accumulate: 7,
        divide: 12,
        system: 2,
        // The longest store a barrier waits for: one to APB1, at half of HCLK.
        barrier: 9,
        shared_bus: 1,
        sram_fetch: 1,
        apb_store: (3, 1),
        apb_load: (3, 1),
        ahb: 1,
        entry: 16,
        exit: 12,
        tail_chain: 6,
        entry_reads: 2,
        charges_tables: true,
    };
}

/// The costs with the flash as FLASH_ACR sets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pace {
    /// The core's.
    pub costs: Costs,
    /// FLASH_ACR.LATENCY.
    pub wait_states: u32,
    /// FLASH_ACR.PRFTBE.
    pub prefetch: bool,
}

impl Pace {
    /// Returns the additional cost of a read of constants in flash, compared with a read of SRAM.
    #[must_use]
    pub const fn flash_read(&self) -> u32 {
        self.wait_states + self.conflict()
    }

    /// Returns the wait for a prefetch under way: it takes as long as any read.
    const fn conflict(&self) -> u32 {
        if self.costs.prefetch_under_way && self.prefetch && self.wait_states > 0 {
            1 + self.wait_states
        } else {
            0
        }
    }

    /// Returns the cycles that a taken branch to flash or to SRAM takes beside its first one.
    #[must_use]
    pub const fn taken(&self, to_flash: bool) -> u32 {
        if to_flash {
            self.costs.refill + self.wait_states + self.conflict()
        } else {
            self.costs.refill + self.costs.shared_bus + self.costs.sram_fetch
        }
    }

    /// Returns the cycles that a branch in flash takes beside its first one when it is not taken.
    #[must_use]
    pub const fn not_taken(&self) -> u32 {
        if self.costs.needless_fetch {
            1 + self.wait_states
        } else {
            0
        }
    }

    /// Returns the entry of an exception.
    #[must_use]
    pub const fn entry(&self) -> u32 {
        self.costs.entry + self.costs.entry_reads * self.wait_states + self.conflict()
    }

    /// Returns the return from an exception.
    #[must_use]
    pub const fn exit(&self) -> u32 {
        self.costs.exit + self.wait_states + self.conflict()
    }

    /// Returns the cost from the end of a handler to the next one.
    #[must_use]
    pub const fn tail_chain(&self) -> u32 {
        self.costs.tail_chain + self.costs.entry_reads * self.wait_states + self.conflict()
    }

    /// Returns the additional cost of an access to a block, compared with an access to SRAM: on the AHB, or on an APB
    /// that runs at HCLK divided by `divider`.
    #[must_use]
    pub const fn block(&self, write: bool, divider: Option<u32>) -> u32 {
        let Some(divider) = divider else {
            return self.costs.ahb;
        };
        let ((pclk, hclk), own) = if write {
            (self.costs.apb_store, 1)
        } else {
            (self.costs.apb_load, 0)
        };
        (pclk * divider + hclk).saturating_sub(own)
    }
}
