//! What the loader does with the part. Slots are numbered: 0 is A, 1 is B.

use cortex_m::{asm, peripheral::SCB};
use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    Flash, IoPin, Watchdog,
    board::{set_up_ports, switch, take_reset_cause},
    boards::BOARD,
    clock,
    crc_unit::CrcUnit,
    design::LOADER_MHZ,
    early,
    flash::{self, BootPages, slot_address},
    kept,
    pin::Mode,
    wait::wait_us,
};

/// The part as the loader finds it: on the internal oscillator, as after a reset.
pub struct Loading {
    rcc: pac::RCC,
    crc: CrcUnit,
    flash: Flash,
    watchdog: Watchdog,
    /// The crystal has not failed since power-on.
    crystal: bool,
}

/// What was kept over the reset, and SW01.
pub struct Found {
    /// COMMAND 2 asked for this restart.
    pub asked: bool,
    /// SW01 was read as 254 at power-on, and no application has been started since.
    pub switched: bool,
    /// The slot that SW01 = 254 chose at power-on.
    pub chosen: Option<usize>,
}

/// The position of SW01 that starts the slot that is not preferred.
const OTHER_SLOT: u8 = 254;

impl Loading {
    /// Starts the watchdog, reads what was kept over the reset, and reads SW01 after a power-on.
    ///
    /// `development`: the loader trusts the development key, which the application reports.
    #[must_use]
    pub fn start(device: pac::Peripherals, development: bool) -> (Self, Found) {
        let mut rcc = device.RCC;
        let watchdog = Watchdog::start_loader(device.IWDG, &device.DBGMCU);
        let kept = kept::at_loading(take_reset_cause(&rcc), development);
        let dip = kept.dip.unwrap_or_else(|| {
            set_up_ports(&mut rcc);
            switch(LOADER_MHZ)
        });
        let found = Found {
            asked: kept.asked,
            switched: dip == OTHER_SLOT && !kept.used,
            chosen: usize::from(kept.chosen).checked_sub(1),
        };
        pac::PWR::enable(&mut rcc);
        let loading = Self {
            crc: CrcUnit::new(device.CRC, &mut rcc),
            flash: Flash::new(device.FLASH, device.PWR, 0),
            watchdog,
            crystal: kept.crystal,
            rcc,
        };
        (loading, found)
    }

    /// Returns the pages of the boot state. Before the first write, [`Self::wait_for_supply`].
    pub fn boot_pages(&mut self) -> BootPages<'_> {
        BootPages(&mut self.flash)
    }

    /// Waits until the supply is high enough to write flash. The watchdog ends a wait that is too long.
    pub fn wait_for_supply(&self) {
        while !self.flash.has_supply() {}
    }

    /// Returns the CRC-32 of parts whose bytes are multiples of 4, one after the other, as the part's unit computes it.
    pub fn crc32(&mut self, parts: [&[u8]; 2]) -> u32 {
        self.crc.of(parts)
    }

    /// Runs the core at full speed, for the check of a signature, and refreshes the watchdog. Uses the crystal unless it
    /// has failed since power-on.
    pub fn run_fast(&mut self) {
        self.watchdog.refresh();
        clock::start(&self.rcc, self.flash.controller(), self.crystal);
    }

    /// Starts the application in a slot at this offset, where its vector table is. Keeps the slot as the choice of
    /// SW01 = 254 if it is `chosen`. Clocks, pins and the voltage detector are as after a reset; the watchdog runs.
    ///
    /// # Safety
    ///
    /// There must be a whole application, linked for this address.
    pub unsafe fn run(mut self, slot: usize, offset: u32, chosen: bool, scb: &SCB) -> ! {
        kept::keep_chosen(if chosen { slot as u8 + 1 } else { 0 });
        early::float_pins(&mut self.rcc);
        pac::PWR::reset(&mut self.rcc);
        clock::as_after_reset(&self.rcc, self.flash.controller());
        self.rcc.ahbenr().reset();
        self.rcc.apb2enr().reset();
        self.rcc.apb1enr().reset();
        self.watchdog.refresh();
        let vectors = (slot_address(slot) + offset) as *const u32;
        // SAFETY: by the caller's promise. The address is aligned for the table, as the layout of every board is. No
        // interrupt is enabled.
        unsafe {
            scb.vtor.write(vectors as u32);
            asm::bootload(vectors)
        }
    }

    /// Shows that no image can be started: the fault LED, if there is one, is lit, and the running LED blinks five times a
    /// second.
    pub fn show_nothing(mut self) -> ! {
        clock::as_after_reset(&self.rcc, self.flash.controller());
        set_up_ports(&mut self.rcc);
        let [others @ .., running] = BOARD.leds else {
            unreachable!("every board has an LED")
        };
        if let [_, fault] = *others {
            IoPin::high(fault);
        }
        running.configure(Mode::Output);
        loop {
            for high in [true, false] {
                running.set(high);
                wait_us(100_000, LOADER_MHZ);
                self.watchdog.refresh();
            }
        }
    }
}

/// Returns the bytes of a slot.
#[must_use]
pub fn slot_bytes(slot: usize) -> &'static [u8] {
    // SAFETY: the loader never changes a slot.
    unsafe { flash::slot_bytes(slot) }
}
