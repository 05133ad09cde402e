//! The flash, which holds the program and the pages that keep data without power (RM0008 3.3, PM0075 2.3).
//!
//! An operation stalls every read of flash: 40 to 70 us for a half-word, 20 to 40 ms for a page, up to 400 ms on clones of
//! the part. Code in RAM continues. The operation is therefore started and polled from RAM, and only interrupts whose
//! handlers are in RAM are enabled during it. Every operation unlocks the controller, checks what it reports, and locks it
//! again even when the operation failed. The store checks that the flash reads back as written.
//!
//! Programming needs a supply of at least 2.0 V (DS5319 table 28). Every operation first reads the voltage
//! detector, and does not begin while the supply is below its threshold ([`PVD_LEVEL`]).

use core::{
    ptr, slice,
    sync::atomic::{AtomicU8, Ordering},
};

use cortex_m::{
    asm,
    register::{basepri, basepri_max},
};
use stm32f1xx_hal::pac;

use crate::design::{FLASH_ERASE_US, FLASH_PROGRAM_US, PVD_LEVEL, SYSCLK_ON_HSE_HZ};
use ports::pages::{Page, Pages, Slot};

/// Key sequence that unlocks the controller (PM0075 2.3.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Error of a flash operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// The supply is too low, or the watchdog was not refreshed since the last erase. Nothing was done; try again later.
    NotNow,
    /// The controller refused the operation, reported an error or did not end in time. The operation may or may not have
    /// taken effect.
    Failed,
}

/// Whether a page may be erased: always before [`watch_erases`], and then once for each [`allow_erase`].
static ERASES: AtomicU8 = AtomicU8::new(UNWATCHED);
const UNWATCHED: u8 = 0;
const ALLOWED: u8 = 1;
const ERASED: u8 = 2;

/// From now on a page is erased only if the watchdog was refreshed since the last one: two erases and the tasks' proofs
/// that they run may take longer than its period.
pub(crate) fn watch_erases() {
    ERASES.store(ALLOWED, Ordering::Relaxed);
}

/// The watchdog was refreshed.
#[inline(always)]
pub(crate) fn allow_erase() {
    if ERASES.load(Ordering::Relaxed) == ERASED {
        watch_erases();
    }
}

/// The flash controller, and as [`Pages`] the pages of the store.
pub struct Flash {
    flash: pac::FLASH,
    power: pac::PWR,
    masked: u8,
}

/// An operation of the controller.
#[derive(Clone, Copy)]
enum Operation {
    Program { place: *mut u16, half: u16 },
    Erase { page: u32 },
}

/// Starts an operation of the controller, which must be set up for it, and polls for its end from RAM, with BASEPRI
/// set to `masked`. Returns false when the operation has not ended after `polls` polls.
///
/// # Safety
///
/// `place` must be a half-word without code of this program, to which no reference is alive; `page` must be a page
/// without such code, to which none is alive.
#[inline(never)]
#[unsafe(link_section = ".ram_code")]
unsafe fn run(
    flash: &pac::flash::RegisterBlock,
    operation: Operation,
    masked: u8,
    polls: u32,
) -> bool {
    let before = basepri::read();
    basepri_max::write(masked);
    match operation {
        // SAFETY: by the caller's promise. With PG set, a store of 16 bits programs flash (PM0075 2.3.3).
        Operation::Program { place, half } => unsafe { ptr::write_volatile(place, half) },
        Operation::Erase { page } => {
            // SAFETY: by the caller's promise, no code is on that page.
            flash.ar().write(|w| unsafe { w.far().bits(page) });
            flash.cr().modify(|_, w| w.strt().set_bit());
        }
    }
    // BSY rises one cycle after the start of the operation (errata sheet of the STM32F10xx4 and STM32F10xx6, 2.11
    // "Flash memory BSY bit delay versus STRT bit setting"; assumed to apply to this part, too). Without this extra
    // read the first poll would find BSY clear, and the controller would be locked during the operation.
    let _ = flash.sr().read();
    let mut left = polls;
    let ended = loop {
        if flash.sr().read().bsy().bit_is_clear() {
            break true;
        }
        if left == 0 {
            break false;
        }
        left -= 1;
    };
    // SAFETY: restores the previous value.
    unsafe { basepri::write(before) };
    ended
}

impl Flash {
    /// Turns the voltage detector on; the clock of PWR must be on. `masked` is the value of BASEPRI during an
    /// operation: interrupts that it does not mask must run from RAM.
    pub(crate) fn new(flash: pac::FLASH, power: pac::PWR, masked: u8) -> Self {
        let flash = Self {
            flash,
            power,
            masked,
        };
        flash.set_up_detector();
        flash
    }

    /// Returns the controller, to set the wait states.
    #[cfg(feature = "loader")]
    pub(crate) fn controller(&self) -> &pac::FLASH {
        &self.flash
    }

    fn set_up_detector(&self) {
        self.power
            .cr()
            // SAFETY: each of the field's eight values is a threshold.
            .modify(|_, w| unsafe { w.pls().bits(PVD_LEVEL).pvde().set_bit() });
    }

    /// Returns whether the supply is high enough for an operation. A detector that is off, because of a disturbance,
    /// says nothing: it is turned on again, and the caller asks later. On an emulator whose detector cannot be turned on
    /// the supply is never low.
    #[must_use]
    pub fn has_supply(&self) -> bool {
        if !self.detector_is_set() {
            self.set_up_detector();
            if self.detector_is_set() {
                return false;
            }
        }
        self.power.csr().read().pvdo().bit_is_clear()
    }

    /// Returns whether the watchdog was refreshed since the last erase, or since [`has_worked`](Self::has_worked).
    #[must_use]
    pub fn may_erase() -> bool {
        ERASES.load(Ordering::Relaxed) != ERASED
    }

    /// Ends a row of operations that took long: the next erase comes after a refresh of the watchdog.
    pub fn has_worked() {
        if ERASES.load(Ordering::Relaxed) == ALLOWED {
            ERASES.store(ERASED, Ordering::Relaxed);
        }
    }

    fn detector_is_set(&self) -> bool {
        let settings = self.power.cr().read();
        settings.pvde().bit_is_set() && settings.pls().bits() == PVD_LEVEL
    }

    /// Runs an operation: unlocks the controller, sets it up, waits for the end within a time limit, and locks it
    /// again.
    ///
    /// # Safety
    ///
    /// As for [`run`].
    unsafe fn operate(&mut self, operation: Operation) -> Result<(), FlashError> {
        /// Cycles of one poll of the controller, at least: a load of a register, two comparisons and two branches.
        const CYCLES_OF_A_POLL: u32 = 9;
        let bound_us = match operation {
            Operation::Program { .. } => FLASH_PROGRAM_US,
            Operation::Erase { .. } => FLASH_ERASE_US,
        };
        let erases = matches!(operation, Operation::Erase { .. });
        if !self.has_supply() || erases && !Self::may_erase() {
            return Err(FlashError::NotNow);
        }
        let flash = &self.flash;
        // The manual asks for this check first (PM0075 2.3.3): an operation that did not end in time may still run.
        if flash.sr().read().bsy().bit_is_set() {
            return Err(FlashError::Failed);
        }
        self.unlock()?;
        if erases {
            Self::has_worked();
        }
        // Clear the flags of an earlier operation by writing 1; otherwise its EOP would count for this operation.
        flash.sr().write(|w| {
            w.eop().set_bit();
            w.pgerr().set_bit().wrprterr().set_bit()
        });
        flash.cr().modify(|_, w| match operation {
            Operation::Program { .. } => w.pg().set_bit(),
            Operation::Erase { .. } => w.per().set_bit(),
        });
        let polls = bound_us * (SYSCLK_ON_HSE_HZ / 1_000_000) / CYCLES_OF_A_POLL;
        // SAFETY: by the caller's promise.
        let done = unsafe { run(flash, operation, self.masked, polls) };
        let status = flash.sr().read();
        // Clear every mode bit and lock the controller.
        flash.cr().write(|w| w.lock().set_bit());
        // Pages borrowed from now on may hold other bytes.
        asm::dsb();
        // WRPRTERR: the page is write-protected by the option bytes. PGERR: the half-word is not erased, and over a
        // written half-word only 0 can be programmed.
        let failed = status.wrprterr().bit_is_set() || status.pgerr().bit_is_set();
        if done && !failed && status.eop().bit_is_set() {
            Ok(())
        } else {
            Err(FlashError::Failed)
        }
    }

    fn unlock(&self) -> Result<(), FlashError> {
        // Writing the keys to an unlocked controller would lock it until the next reset. A clone of the part is reported to
        // read LOCK as 0 while it is locked.
        self.flash.cr().write(|w| w.lock().set_bit());
        for key in KEYS {
            // SAFETY: the register takes these two keys in this order.
            self.flash.keyr().write(|w| unsafe { w.key().bits(key) });
        }
        if self.flash.cr().read().lock().bit_is_set() {
            Err(FlashError::Failed)
        } else {
            Ok(())
        }
    }
}

// From the linker script.
unsafe extern "C" {
    /// The first page of the store. The second one follows.
    static _store: u8;
    /// The first page of the boot state. The second one follows.
    static _boot: u8;
    /// The numbers of the loader's keys, its last bytes.
    static _loader_keys: [u8; 16];
    /// Its address is the number of bytes of a page.
    static _page_bytes: u8;
    static _slot_a: u8;
    static _slot_b: u8;
    /// Its address is the number of bytes of a slot.
    static _slot_bytes: u8;
}

fn page_bytes() -> u32 {
    &raw const _page_bytes as u32
}

/// Returns the address of a page of the two that begin at `first`.
fn address(first: u32, page: Page) -> u32 {
    match page {
        Page::First => first,
        Page::Second => first + page_bytes(),
    }
}

impl Flash {
    fn page_of(&self, first: u32, page: Page) -> &[u8] {
        let address = address(first, page) as *const u8;
        // SAFETY: a page of flash is always readable, as bytes. Only the `&mut` methods of this value change it,
        // and the borrow prevents calls of those. They end with a barrier that the compiler treats as a write to
        // all memory.
        unsafe { slice::from_raw_parts(address, page_bytes() as usize) }
    }

    /// Programs a half-word. `first` must be the first page of the store or of the boot state.
    fn program_in(
        &mut self,
        first: u32,
        page: Page,
        offset: usize,
        half: u16,
    ) -> Result<(), FlashError> {
        let offset = offset as u32;
        if offset >= page_bytes() || !offset.is_multiple_of(2) {
            return Err(FlashError::Failed);
        }
        let place = (address(first, page) + offset) as *mut u16;
        // SAFETY: the half-word belongs to these pages, and no reference to it is alive (`&mut self`).
        unsafe { self.operate(Operation::Program { place, half }) }
    }

    /// Erases a page. `first` as for [`Self::program_in`].
    fn erase_of(&mut self, first: u32, page: Page) -> Result<(), FlashError> {
        let page = address(first, page);
        // SAFETY: the page contains no code.
        unsafe { self.operate(Operation::Erase { page }) }
    }
}

fn store() -> u32 {
    &raw const _store as u32
}

/// The pages of the store.
impl Pages for Flash {
    type Error = FlashError;

    fn page(&self, page: Page) -> &[u8] {
        self.page_of(store(), page)
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), FlashError> {
        self.program_in(store(), page, offset, half)
    }

    fn erase(&mut self, page: Page) -> Result<(), FlashError> {
        self.erase_of(store(), page)
    }
}

/// The pages of the boot state.
pub struct BootPages<'a>(pub &'a mut Flash);

fn boot() -> u32 {
    &raw const _boot as u32
}

impl Pages for BootPages<'_> {
    type Error = FlashError;

    fn page(&self, page: Page) -> &[u8] {
        self.0.page_of(boot(), page)
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), FlashError> {
        self.0.program_in(boot(), page, offset, half)
    }

    fn erase(&mut self, page: Page) -> Result<(), FlashError> {
        self.0.erase_of(boot(), page)
    }
}

/// Returns the address of a slot: 0 is A, 1 is B.
#[must_use]
pub fn slot_address(slot: usize) -> u32 {
    (if slot == 0 {
        &raw const _slot_a
    } else {
        &raw const _slot_b
    }) as u32
}

fn slot_len() -> usize {
    &raw const _slot_bytes as usize
}

/// A slot of flash that does not run.
pub struct OtherSlot<'a> {
    flash: &'a mut Flash,
    address: u32,
}

impl Flash {
    /// Returns the slot that does not run, or `None` without a loader.
    pub fn other_slot(&mut self) -> Option<OtherSlot<'_>> {
        let address = slot_address(1 - crate::SLOT?);
        Some(OtherSlot {
            flash: self,
            address,
        })
    }

    /// Returns the slot that runs, or `None` without a loader.
    #[must_use]
    pub fn running_slot() -> Option<&'static [u8]> {
        // SAFETY: the program never changes the slot that it runs from.
        crate::SLOT.map(|slot| unsafe { slot_bytes(slot) })
    }

    /// Returns the last bytes of the loader, which have the numbers of its keys.
    #[must_use]
    pub fn loader_keys() -> &'static [u8; 16] {
        // SAFETY: the linker's script has this symbol at 16 bytes of the flash, which the program never changes.
        unsafe { &_loader_keys }
    }
}

/// Returns the bytes of a slot.
///
/// # Safety
///
/// The slot must never change.
pub(crate) unsafe fn slot_bytes(slot: usize) -> &'static [u8] {
    let first = ptr::with_exposed_provenance(slot_address(slot) as usize);
    // SAFETY: a slot of flash is always readable, and by the caller's promise it never changes.
    unsafe { slice::from_raw_parts(first, slot_len()) }
}

impl Slot for OtherSlot<'_> {
    type Error = FlashError;

    fn bytes(&self) -> &[u8] {
        let first = ptr::with_exposed_provenance(self.address as usize);
        // SAFETY: as in `Flash::page_of`.
        unsafe { slice::from_raw_parts(first, slot_len()) }
    }

    fn page_bytes(&self) -> usize {
        page_bytes() as usize
    }

    fn program(&mut self, offset: usize, half: u16) -> Result<(), FlashError> {
        if offset >= slot_len() || !offset.is_multiple_of(2) {
            return Err(FlashError::Failed);
        }
        let place = (self.address + offset as u32) as *mut u16;
        // SAFETY: the half-word belongs to the slot that does not run, and no reference to it is alive (`&mut self`).
        unsafe { self.flash.operate(Operation::Program { place, half }) }
    }

    fn erase(&mut self, page: usize) -> Result<(), FlashError> {
        if page >= slot_len() / self.page_bytes() {
            return Err(FlashError::Failed);
        }
        let page = self.address + page as u32 * page_bytes();
        // SAFETY: the page belongs to the slot that does not run.
        unsafe { self.flash.operate(Operation::Erase { page }) }
    }
}
