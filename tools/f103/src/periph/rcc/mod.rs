//! Reset and clock control, RM0008 chapter 7: oscillators, PLL, prescalers, clock enables, reset flags.
//!
//! The backup domain (BDCR), ready interrupts (CIR) and MCO are not modelled. The failure of the crystal is in
//! [`mod@crystal`].

mod crystal;
mod registers;

use crate::peripheral::Unmodelled;
use crate::time::Time;

use crate::periph::clocks::{Clocks, Oscillators};

/// HSI wake-up: DS5319 table 24, maximum.
const HSI_START: Time = Time::from_us(2);
/// LSI start-up: DS5319 table 25, maximum.
const LSI_START: Time = Time::from_us(85);
/// PLL lock: DS5319 table 27, maximum.
const PLL_LOCK: Time = Time::from_us(200);

/// Time from PLLON = 0 to PLLRDY = 0. RM0008 gives no time. This value is pessimistic, so that firmware that does
/// not wait for PLLRDY raises a finding.
const PLL_STOP: Time = Time::from_us(10);

/// CSSF in CIR, and CSSC, which clears it (RM0008 7.3.3).
const CIR_CSSF: u32 = 1 << 7;
const CIR_CSSC: u32 = 1 << 23;

const CR_HSION: u32 = 1 << 0;
const CR_HSIRDY: u32 = 1 << 1;
const CR_HSITRIM: u32 = 0x1F << 3;
const CR_HSICAL: u32 = 0x5A << 8;
const CR_HSEON: u32 = 1 << 16;
const CR_HSERDY: u32 = 1 << 17;
const CR_HSEBYP: u32 = 1 << 18;
const CR_CSSON: u32 = 1 << 19;
const CR_PLLON: u32 = 1 << 24;
const CR_PLLRDY: u32 = 1 << 25;
const CR_RESET: u32 = CR_HSION | 16 << 3;

const CFGR_SW: u32 = 0b11;
/// PLLSRC, PLLXTPRE, PLLMUL: written only while the PLL is off (RM0008 7.3.2).
const CFGR_PLL: u32 = 0b11_1111 << 16;
const CFGR_MCO: u32 = 0b111 << 24;
const CFGR_WRITABLE: u32 = 0x077F_FFF3;

const CSR_LSION: u32 = 1 << 0;
const CSR_LSIRDY: u32 = 1 << 1;
const CSR_RMVF: u32 = 1 << 24;
/// SRAMEN and FLITFEN.
const AHBENR_RESET: u32 = 0x14;

/// Cause of a reset: the flag in RCC_CSR (RM0008 7.3.10). Every reset also pulls NRST low (RM0008 7.1.1), so
/// PINRSTF is always set too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Power-on.
    PowerOn,
    /// The NRST pin alone.
    Pin,
    /// SYSRESETREQ.
    Software,
    /// The independent watchdog.
    Iwdg,
}

impl Cause {
    const fn flags(self) -> u32 {
        const PIN: u32 = 1 << 26;
        match self {
            Self::PowerOn => PIN | 1 << 27,
            Self::Pin => PIN,
            Self::Software => PIN | 1 << 28,
            Self::Iwdg => PIN | 1 << 29,
        }
    }
}

/// Changes that a write to RCC requests from the rest of the part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Clock frequencies or clock enables have changed.
    pub clocks: bool,
    /// Bits newly set in APB2RSTR and APB1RSTR: those blocks are to be reset.
    pub resets: (u32, u32),
}

/// An oscillator or the PLL: off, or on and ready at an instant (never, for a broken crystal).
type Ready = Option<Time>;

/// The RCC registers.
#[derive(Debug)]
pub struct Rcc {
    crystal: bool,
    oscillators: Oscillators,
    /// The bits that AHBENR, APB2ENR and APB1ENR keep.
    enables: [u32; 3],
    cr: u32,
    cfgr: u32,
    sws: u32,
    rstr: (u32, u32),
    ahbenr: u32,
    enr: (u32, u32),
    csr_flags: u32,
    hsi: Ready,
    hse: Ready,
    pll: Ready,
    /// Instant until which PLLRDY stays set after the PLL was switched off.
    pll_stops: Time,
    lsi: Ready,
    iwdg_needs_lsi: bool,
    /// CSSF: the clock security system has detected a failure of the HSE.
    failed: bool,
    now: Time,
    changes: Changes,
}

impl Rcc {
    /// Returns the oscillators.
    #[must_use]
    pub fn oscillators(&self) -> Oscillators {
        self.oscillators
    }

    /// Sets the rates of the RC oscillators in Hz from now on.
    pub fn set_rc_oscillators(&mut self, hsi: u32, lsi: u32) {
        self.oscillators = Oscillators {
            hsi,
            lsi,
            ..self.oscillators
        };
        self.changes.clocks = true;
    }

    /// Returns RCC after power-on, on a board with these oscillators, with a working crystal or without one. `enables`
    /// are the bits that AHBENR, APB2ENR and APB1ENR keep.
    #[must_use]
    pub fn new(crystal: bool, oscillators: Oscillators, enables: [u32; 3]) -> Self {
        Self {
            crystal,
            oscillators,
            enables,
            cr: CR_RESET,
            cfgr: 0,
            sws: 0,
            rstr: (0, 0),
            ahbenr: AHBENR_RESET,
            enr: (0, 0),
            csr_flags: Cause::PowerOn.flags(),
            hsi: Some(Time::ZERO),
            hse: None,
            pll: None,
            pll_stops: Time::ZERO,
            lsi: None,
            iwdg_needs_lsi: false,
            failed: false,
            now: Time::ZERO,
            changes: Changes::default(),
        }
    }

    /// Records why the part was reset; a power-on clears the earlier flags.
    pub fn note_reset(&mut self, cause: Cause) {
        if cause == Cause::PowerOn {
            self.csr_flags = 0;
        }
        self.csr_flags |= cause.flags();
    }

    /// Keeps the LSI on for the watchdog, which has started (RM0008 7.2.9).
    pub fn hold_lsi(&mut self, now: Time) {
        self.iwdg_needs_lsi = true;
        self.lsi.get_or_insert(now + LSI_START);
    }

    /// Returns the instant from which the LSI runs, which may be in the future; `None` while it is off.
    #[must_use]
    pub const fn lsi(&self) -> Option<Time> {
        self.lsi
    }

    /// Returns whether the HSI runs: flash is programmed and erased by its clock (PM0075 2.3).
    #[must_use]
    pub fn hsi_on(&self) -> bool {
        self.hsi.is_some()
    }

    /// Returns the clock enables of APB2, APB1 and AHB.
    #[must_use]
    pub fn enabled(&self) -> [u32; 3] {
        [self.enr.0, self.enr.1, self.ahbenr]
    }

    /// Returns the resets that RSTR holds, of APB2 and APB1.
    #[must_use]
    pub fn held_in_reset(&self) -> (u32, u32) {
        self.rstr
    }

    /// Returns the changes since the last call.
    pub fn take_changes(&mut self) -> Changes {
        core::mem::take(&mut self.changes)
    }

    /// Returns the frequencies of every clock.
    #[must_use]
    pub fn clocks(&self) -> Clocks {
        if self.stopped() {
            return Clocks::STOPPED;
        }
        Clocks::of(self.cfgr, self.sws, &self.oscillators)
    }

    fn is_ready(&self, source: Ready) -> bool {
        source.is_some_and(|at| at <= self.now)
    }

    /// Returns the source that SW selects.
    fn wanted(&self) -> Ready {
        self.source(self.cfgr & CFGR_SW)
    }

    fn source(&self, number: u32) -> Ready {
        match number {
            0 => self.hsi,
            1 => self.hse,
            _ => self.pll,
        }
    }

    /// Switches SYSCLK to the selected source once that source is ready (RM0008 7.2.6).
    fn switch(&mut self) {
        let wanted = self.cfgr & CFGR_SW;
        if wanted != self.sws && self.is_ready(self.wanted()) {
            self.sws = wanted;
            self.changes.clocks = true;
        }
    }

    /// Returns whether the system clock runs from the HSE, directly or through the PLL.
    fn hse_in_use(&self) -> bool {
        self.sws == 1 || (self.sws == 2 && self.pll_from_hse())
    }

    fn pll_from_hse(&self) -> bool {
        self.cfgr & 1 << 16 != 0
    }

    fn read_cr(&self) -> u32 {
        let flag = |source, bit| if self.is_ready(source) { bit } else { 0 };
        self.cr
            | CR_HSICAL
            | flag(self.hsi, CR_HSIRDY)
            | flag(self.hse, CR_HSERDY)
            | if self.pll_is_ready() { CR_PLLRDY } else { 0 }
    }

    /// Returns PLLRDY.
    fn pll_is_ready(&self) -> bool {
        self.is_ready(self.pll) || self.pll.is_none() && self.now < self.pll_stops
    }

    fn write_cr(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        let mut cr = value & (CR_HSION | CR_HSITRIM | CR_HSEON | CR_HSEBYP | CR_CSSON | CR_PLLON);
        // An oscillator that feeds the system clock cannot be stopped (RM0008 7.3.1).
        if self.sws == 0 || (self.sws == 2 && !self.pll_from_hse()) {
            cr |= CR_HSION;
        }
        if self.hse_in_use() {
            cr |= CR_HSEON;
        }
        if self.sws == 2 {
            cr |= CR_PLLON;
        }
        let start = |was: Ready, on: bool, ready: Time| match (on, was) {
            (true, None) => Some(ready),
            (true, running) => running,
            (false, _) => None,
        };
        self.hsi = start(self.hsi, cr & CR_HSION != 0, now + HSI_START);
        self.hse = start(self.hse, cr & CR_HSEON != 0, self.hse_start(now));
        if cr & CR_PLLON == 0 && self.is_ready(self.pll) {
            self.pll_stops = now + PLL_STOP;
        }
        let was_off = self.pll.is_none();
        self.pll = start(self.pll, cr & CR_PLLON != 0, self.pll_lock(now));
        // The detector acts when the HSE is ready (RM0008 7.3.1).
        self.cr = cr;
        if was_off && self.pll.is_some() && self.pll_source().is_none() {
            return Err(Unmodelled(
                "the PLL was switched on while its source, the HSE, is off: PLLRDY is never set",
            ));
        }
        Ok(())
    }

    /// Returns the instant at which a PLL that is switched on now locks; its source has to run first.
    fn pll_lock(&self, now: Time) -> Time {
        self.pll_source()
            .map_or(Time::MAX, |ready| ready.max(now) + PLL_LOCK)
    }

    fn pll_source(&self) -> Ready {
        if self.pll_from_hse() {
            self.hse
        } else {
            self.hsi
        }
    }

    fn write_cfgr(&mut self, value: u32) -> Result<(), Unmodelled> {
        let mut value = value & CFGR_WRITABLE;
        let sets_pll = (value ^ self.cfgr) & CFGR_PLL != 0;
        if self.cr & CR_PLLON != 0 {
            value = value & !CFGR_PLL | self.cfgr & CFGR_PLL;
        }
        if value & CFGR_SW == 3 {
            // "Not allowed" (RM0008 7.3.2): SW keeps its value.
            value = value & !CFGR_SW | self.cfgr & CFGR_SW;
        }
        self.cfgr = value;
        self.changes.clocks = true;
        if value & CFGR_MCO != 0 {
            return Err(Unmodelled("RCC_CFGR.MCO, the clock output"));
        }
        // RM0008 7.3.2: these bits may be written only while the PLL is off.
        if sets_pll && self.pll_is_ready() {
            return Err(Unmodelled(
                "RCC_CFGR's PLL bits written while PLLRDY is set",
            ));
        }
        if value & CFGR_SW != self.sws && self.wanted().is_none() {
            return Err(Unmodelled(
                "RCC_CFGR.SW selects a clock that is off: SWS does not follow",
            ));
        }
        Ok(())
    }

    fn read_csr(&self) -> u32 {
        let mut csr = self.csr_flags;
        if self.lsi.is_some() {
            csr |= CSR_LSION;
        }
        if self.is_ready(self.lsi) {
            csr |= CSR_LSIRDY;
        }
        csr
    }

    fn write_csr(&mut self, value: u32, now: Time) {
        if value & CSR_RMVF != 0 {
            self.csr_flags = 0;
        }
        if value & CSR_LSION != 0 {
            self.lsi.get_or_insert(now + LSI_START);
        } else if !self.iwdg_needs_lsi {
            self.lsi = None;
        }
    }
}

#[cfg(test)]
mod tests;
