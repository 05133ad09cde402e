//! The flash: what the program is in, and the two pages that keep what survives a power
//! cycle (RM0008 3.3, PM0075 2.3).
//!
//! An operation stalls every read of flash: 40 to 70 us for a half-word, 20 to 40 ms for a page. Code in RAM goes on:
//! the operation is started and waited for there, and of the interrupts only those come through whose handlers are in
//! RAM. Every operation unlocks the controller, checks, and locks it again, whatever comes of it.
//!
//! Programming needs a supply of 2.0 V (DS5319 table 28). The voltage detector is looked at before every
//! operation, and no operation begins while the supply is below its threshold ([`PVD_LEVEL`]).

use core::{ptr, slice};

use cortex_m::{
    asm,
    register::{basepri, basepri_max},
};
use stm32f1xx_hal::pac;

use crate::{
    boards::BOARD,
    design::{FLASH_ERASE_US, FLASH_PROGRAM_US, PVD_LEVEL, SYSCLK_ON_HSE_HZ},
};

/// The addresses of the store's pages.
const STORE_PAGES: [u32; 2] = BOARD.store;
/// Bytes of each.
const PAGE_BYTES: u32 = BOARD.page_bytes;
/// What unlocks the controller (PM0075 2.3.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

const ERASED: u16 = 0xFFFF;

/// Why an operation was refused or failed. The address is the one that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Not on the store's pages, or not at the start of a half-word or page. A mistake
    /// of the caller's.
    Address(u32),
    /// The half-word is not erased, and only 0 can be programmed over what it holds. Erase first.
    NotErased(u32),
    /// The page is write-protected by the option bytes. Only a programmer can change that.
    Protected(u32),
    /// The controller cannot be unlocked before the next reset.
    Locked,
    /// The operation did not end in time; it may have been done or not.
    Timeout(u32),
    /// The controller did not report the end of the operation (EOP, PM0075 3.5); it may have been done or
    /// not.
    NotEnded(u32),
    /// The supply is too low. Nothing was done; try again when it is back.
    LowSupply,
    /// What was programmed or erased does not read back: the page is worn out.
    Worn(u32),
}

/// The store's pages, and the controller that changes them.
pub struct Flash {
    flash: pac::FLASH,
    power: pac::PWR,
    masked: u8,
}

/// What the controller is to do.
#[derive(Clone, Copy)]
enum Operation {
    Program { place: *mut u16, half: u16 },
    Erase { page: u32 },
}

impl Operation {
    /// Where, and for how many microseconds at most.
    fn bounds(self) -> (u32, u32) {
        match self {
            Self::Program { place, .. } => (place as u32, FLASH_PROGRAM_US),
            Self::Erase { page } => (page, FLASH_ERASE_US),
        }
    }
}

/// Starts an operation of the controller, which is set up for it, and waits in RAM for its end, with BASEPRI at
/// `masked`. Returns false when it has not ended after `looks` looks at the controller.
///
/// # Safety
///
/// `place` is a half-word of the store of which no reference is alive; `page` is one of the store's.
#[inline(never)]
#[unsafe(link_section = ".ram_code")]
unsafe fn run(
    flash: &pac::flash::RegisterBlock,
    operation: Operation,
    masked: u8,
    looks: u32,
) -> bool {
    let before = basepri::read();
    basepri_max::write(masked);
    match operation {
        // SAFETY: the caller's promise; with PG set a store of 16 bits is how flash is programmed (PM0075 2.3.3).
        Operation::Program { place, half } => unsafe { ptr::write_volatile(place, half) },
        Operation::Erase { page } => {
            // SAFETY: the caller's promise: no code is there.
            flash.ar().write(|w| unsafe { w.far().bits(page) });
            flash.cr().modify(|_, w| w.strt().set_bit());
        }
    }
    // BSY rises one cycle after the operation was started (errata sheet of the STM32F10xx4 and STM32F10xx6, 2.11
    // "Flash memory BSY bit delay versus STRT bit setting"; taken to hold for this part). Without this read the first
    // look would find it clear, and the controller would be locked in the middle of the operation.
    let _ = flash.sr().read();
    let mut left = looks;
    let ended = loop {
        if flash.sr().read().bsy().bit_is_clear() {
            break true;
        }
        if left == 0 {
            break false;
        }
        left -= 1;
    };
    // SAFETY: what it was.
    unsafe { basepri::write(before) };
    ended
}

impl Flash {
    /// Turns the voltage detector on. PWR has its clock. `masked` is BASEPRI during an operation: what it lets through
    /// must run from RAM.
    pub(crate) fn new(flash: pac::FLASH, power: pac::PWR, masked: u8) -> Self {
        power
            .cr()
            // SAFETY: each of the field's eight values is a threshold.
            .modify(|_, w| unsafe { w.pls().bits(PVD_LEVEL).pvde().set_bit() });
        Self {
            flash,
            power,
            masked,
        }
    }

    /// Whether the supply is high enough for an operation.
    #[must_use]
    pub fn has_supply(&self) -> bool {
        self.power.csr().read().pvdo().bit_is_clear()
    }

    /// The bytes of the store's pages, in the order of the [descriptor](crate::boards::Descriptor::store).
    #[must_use]
    pub fn pages(&self) -> [&[u8]; 2] {
        // SAFETY: a page of flash is readable at any time, of bytes, and changed by nothing but this
        // value's `&mut` methods, which the borrow keeps from being called. Those end in a barrier
        // that the compiler takes as a change of any memory.
        STORE_PAGES.map(|address| unsafe {
            slice::from_raw_parts(address as *const u8, PAGE_BYTES as usize)
        })
    }

    /// Programs an erased half-word, or any with 0.
    ///
    /// # Errors
    ///
    /// All of [`FlashError`].
    pub fn program_half_word(&mut self, address: u32, half: u16) -> Result<(), FlashError> {
        let [first, last] = STORE_PAGES;
        if !(first..last + PAGE_BYTES).contains(&address) || !address.is_multiple_of(2) {
            return Err(FlashError::Address(address));
        }
        let place = address as *mut u16;
        // SAFETY: the address was just checked to be that of a half-word of flash.
        let read = || unsafe { ptr::read_volatile(place) };
        if read() != ERASED && half != 0 {
            return Err(FlashError::NotErased(address));
        }
        // SAFETY: a half-word of the store, of which no reference is alive (`&mut self`).
        unsafe { self.operate(Operation::Program { place, half }) }?;
        if read() == half {
            Ok(())
        } else {
            Err(FlashError::Worn(address))
        }
    }

    /// Erases a page.
    ///
    /// # Errors
    ///
    /// All of [`FlashError`] but `NotErased`.
    pub fn erase_page(&mut self, address: u32) -> Result<(), FlashError> {
        if !STORE_PAGES.contains(&address) {
            return Err(FlashError::Address(address));
        }
        // SAFETY: one of the store's pages, which no code is on.
        unsafe { self.operate(Operation::Erase { page: address }) }?;
        let erased = (address..address + PAGE_BYTES)
            .step_by(4)
            // SAFETY: words of the page, which is readable and aligned.
            .all(|word| unsafe { ptr::read_volatile(word as *const u32) } == u32::MAX);
        if erased {
            Ok(())
        } else {
            Err(FlashError::Worn(address))
        }
    }

    /// Does an operation with the controller unlocked and set up for it, within a bounded time, and
    /// locks it again.
    ///
    /// # Safety
    ///
    /// As for [`run`].
    unsafe fn operate(&mut self, operation: Operation) -> Result<(), FlashError> {
        /// Of one look at the controller, at least: a load of a register, a test and a branch.
        const CYCLES_OF_A_LOOK: u32 = 5;
        let (address, bound_us) = operation.bounds();
        if !self.has_supply() {
            return Err(FlashError::LowSupply);
        }
        let flash = &self.flash;
        self.unlock()?;
        // Clear what an earlier operation left, by writing 1; otherwise its EOP would count for this one.
        flash.sr().write(|w| {
            w.eop().set_bit();
            w.pgerr().set_bit().wrprterr().set_bit()
        });
        flash.cr().modify(|_, w| match operation {
            Operation::Program { .. } => w.pg().set_bit(),
            Operation::Erase { .. } => w.per().set_bit(),
        });
        let looks = bound_us * (SYSCLK_ON_HSE_HZ / 1_000_000) / CYCLES_OF_A_LOOK;
        // SAFETY: the caller's promise.
        let done = unsafe { run(flash, operation, self.masked, looks) };
        let status = flash.sr().read();
        // Every mode bit off, and locked.
        flash.cr().write(|w| w.lock().set_bit());
        // The bytes behind references taken from now on may be others.
        asm::dsb();
        if status.wrprterr().bit_is_set() {
            Err(FlashError::Protected(address))
        } else if !done {
            Err(FlashError::Timeout(address))
        } else if status.pgerr().bit_is_set() {
            Err(FlashError::NotErased(address))
        } else if status.eop().bit_is_clear() {
            Err(FlashError::NotEnded(address))
        } else {
            Ok(())
        }
    }

    fn unlock(&self) -> Result<(), FlashError> {
        let locked = || self.flash.cr().read().lock().bit_is_set();
        // The keys of an open controller would jam it.
        if locked() {
            for key in KEYS {
                // SAFETY: the two keys in their order are what the register takes.
                self.flash.keyr().write(|w| unsafe { w.key().bits(key) });
            }
        }
        if locked() {
            Err(FlashError::Locked)
        } else {
            Ok(())
        }
    }
}
