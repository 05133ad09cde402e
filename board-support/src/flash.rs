//! The flash, which holds the program and the two pages that keep data without power (RM0008 3.3, PM0075 2.3).
//!
//! An operation stalls every read of flash: 40 to 70 us for a half-word, 20 to 40 ms for a page. Code in RAM
//! continues. The operation is therefore started and polled from RAM, and only interrupts whose handlers are in RAM
//! are enabled during it. Every operation unlocks the controller, checks the result, and locks the controller again
//! even when it fails.
//!
//! Programming needs a supply of at least 2.0 V (DS5319 table 28). Every operation first reads the voltage
//! detector, and does not begin while the supply is below its threshold ([`PVD_LEVEL`]).

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
/// Bytes of each page.
const PAGE_BYTES: u32 = BOARD.page_bytes;
/// Key sequence that unlocks the controller (PM0075 2.3.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

const ERASED: u16 = 0xFFFF;

/// Error of a flash operation. The address is the requested one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// The address is not on the store's pages, or not at the start of a half-word or page. This is an error of the
    /// caller.
    Address(u32),
    /// The half-word is not erased, and over a written half-word only 0 can be programmed. Erase the page first.
    NotErased(u32),
    /// The page is write-protected by the option bytes. Only a programmer can change that.
    Protected(u32),
    /// The controller cannot be unlocked before the next reset.
    Locked,
    /// This operation, or the one before it, did not end in time. It may or may not have taken effect.
    Timeout(u32),
    /// The controller did not report the end of the operation (EOP, PM0075 3.5). The operation may or may not have
    /// taken effect.
    NotEnded(u32),
    /// The supply is too low. Nothing was done; try again when the supply has recovered.
    LowSupply,
    /// The flash does not read back as programmed or erased: the page is worn out.
    Worn(u32),
}

/// The store's pages and the flash controller.
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

impl Operation {
    /// Returns the address and the time limit in microseconds.
    fn bounds(self) -> (u32, u32) {
        match self {
            Self::Program { place, .. } => (place as u32, FLASH_PROGRAM_US),
            Self::Erase { page } => (page, FLASH_ERASE_US),
        }
    }
}

/// Starts an operation of the controller, which must be set up for it, and polls for its end from RAM, with BASEPRI
/// set to `masked`. Returns false when the operation has not ended after `looks` polls.
///
/// # Safety
///
/// `place` must be a half-word of the store to which no reference is alive; `page` must be a page of the store.
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
    // SAFETY: restores the previous value.
    unsafe { basepri::write(before) };
    ended
}

impl Flash {
    /// Turns the voltage detector on; the clock of PWR must be on. `masked` is the value of BASEPRI during an
    /// operation: interrupts that it does not mask must run from RAM.
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

    /// Returns whether the supply is high enough for an operation.
    #[must_use]
    pub fn has_supply(&self) -> bool {
        self.power.csr().read().pvdo().bit_is_clear()
    }

    /// Returns the bytes of the store's pages, in the order of the [descriptor](crate::boards::Descriptor::store).
    #[must_use]
    pub fn pages(&self) -> [&[u8]; 2] {
        // SAFETY: a page of flash is always readable, as bytes. Only the `&mut` methods of this value change it,
        // and the borrow prevents calls of those. They end with a barrier that the compiler treats as a write to
        // all memory.
        STORE_PAGES.map(|address| unsafe {
            slice::from_raw_parts(address as *const u8, PAGE_BYTES as usize)
        })
    }

    /// Programs an erased half-word, or any half-word with 0.
    ///
    /// # Errors
    ///
    /// Every variant of [`FlashError`].
    pub fn program_half_word(&mut self, address: u32, half: u16) -> Result<(), FlashError> {
        let [first, last] = STORE_PAGES;
        if !(first..last + PAGE_BYTES).contains(&address) || !address.is_multiple_of(2) {
            return Err(FlashError::Address(address));
        }
        let place = address as *mut u16;
        // SAFETY: the address was just checked: it is that of a half-word of flash.
        let read = || unsafe { ptr::read_volatile(place) };
        if read() != ERASED && half != 0 {
            return Err(FlashError::NotErased(address));
        }
        // SAFETY: the half-word belongs to the store, and no reference to it is alive (`&mut self`).
        unsafe { self.operate(Operation::Program { place, half }) }?;
        if read() == half {
            Ok(())
        } else {
            Err(FlashError::Worn(address))
        }
    }

    /// Erases a page of the store.
    ///
    /// # Errors
    ///
    /// Every variant of [`FlashError`] except `NotErased`.
    pub fn erase_page(&mut self, address: u32) -> Result<(), FlashError> {
        if !STORE_PAGES.contains(&address) {
            return Err(FlashError::Address(address));
        }
        // SAFETY: the page belongs to the store and contains no code.
        unsafe { self.operate(Operation::Erase { page: address }) }?;
        let erased = (address..address + PAGE_BYTES)
            .step_by(4)
            // SAFETY: these are the words of the page, which is readable and aligned.
            .all(|word| unsafe { ptr::read_volatile(word as *const u32) } == u32::MAX);
        if erased {
            Ok(())
        } else {
            Err(FlashError::Worn(address))
        }
    }

    /// Runs an operation: unlocks the controller, sets it up, waits for the end within a time limit, and locks it
    /// again.
    ///
    /// # Safety
    ///
    /// As for [`run`].
    unsafe fn operate(&mut self, operation: Operation) -> Result<(), FlashError> {
        /// Cycles of one poll of the controller, at least: a load of a register, a test and a branch.
        const CYCLES_OF_A_LOOK: u32 = 5;
        let (address, bound_us) = operation.bounds();
        if !self.has_supply() {
            return Err(FlashError::LowSupply);
        }
        let flash = &self.flash;
        // The manual asks for this check first (PM0075 2.3.3): an operation that did not end in time may still run.
        if flash.sr().read().bsy().bit_is_set() {
            return Err(FlashError::Timeout(address));
        }
        self.unlock()?;
        // Clear the flags of an earlier operation by writing 1; otherwise its EOP would count for this operation.
        flash.sr().write(|w| {
            w.eop().set_bit();
            w.pgerr().set_bit().wrprterr().set_bit()
        });
        flash.cr().modify(|_, w| match operation {
            Operation::Program { .. } => w.pg().set_bit(),
            Operation::Erase { .. } => w.per().set_bit(),
        });
        let looks = bound_us * (SYSCLK_ON_HSE_HZ / 1_000_000) / CYCLES_OF_A_LOOK;
        // SAFETY: by the caller's promise.
        let done = unsafe { run(flash, operation, self.masked, looks) };
        let status = flash.sr().read();
        // Clear every mode bit and lock the controller.
        flash.cr().write(|w| w.lock().set_bit());
        // Pages borrowed from now on may hold other bytes.
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
        // Writing the keys to an unlocked controller would lock it until the next reset.
        if locked() {
            for key in KEYS {
                // SAFETY: the register takes these two keys in this order.
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
