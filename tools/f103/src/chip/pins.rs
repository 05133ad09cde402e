//! The part's pins, its crystal and its supply.

use super::{Chip, Error};
use crate::periph::gpio::Gpio;
use crate::soc::{Circuit, Pin};
use crate::time::Time;

impl<C: Circuit> Chip<C> {
    /// Returns whether the 8 MHz crystal works.
    #[must_use]
    pub fn crystal(&self) -> bool {
        self.bus.soc.rcc.crystal()
    }

    /// Lets the crystal fail at this instant, or work again. A crystal that works again starts if RCC has it on.
    pub fn set_crystal(&mut self, works: bool) {
        self.sync();
        let now = self.now();
        self.bus.soc.set_crystal(works, now);
    }

    /// Returns the frequencies of HSI and LSI in Hz.
    #[must_use]
    pub fn rc_oscillators(&self) -> (u32, u32) {
        let oscillators = self.bus.soc.rcc.oscillators();
        (oscillators.hsi, oscillators.lsi)
    }

    /// Sets the frequencies of the part's RC oscillators in Hz. On real parts they depend on temperature, supply and
    /// the single part (DS5319 tables 24 and 25). They stay the same in a power cycle. The IWDG finishes its present
    /// count at the old rate of the LSI, and counts at the new rate after the next reload.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] outside 6.4 to 9.6 MHz for the HSI, or outside 15 to 90 kHz for the LSI. Every real part is
    /// inside these ranges.
    pub fn set_rc_oscillators(&mut self, hsi: u32, lsi: u32) -> Result<(), Error> {
        if !(6_400_000..=9_600_000).contains(&hsi) {
            return Err(Error::Range("the HSI must be 6.4 to 9.6 MHz"));
        }
        if !(15_000..=90_000).contains(&lsi) {
            return Err(Error::Range("the LSI must be 15 to 90 kHz"));
        }
        self.sync();
        let now = self.now();
        self.bus.soc.set_rc_oscillators(hsi, lsi, now);
        Ok(())
    }

    /// Returns the supply voltage of the part, in mV.
    #[must_use]
    pub fn supply_mv(&self) -> u16 {
        self.bus.soc.pwr.supply_mv()
    }

    /// Sets the supply voltage of the part, in mV. It stays the same in a power cycle.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] outside the part's 2000 to 3600 mV (DS5319 table 9). For a lower supply, at which the part is
    /// in reset, use [`Chip::power_off`].
    pub fn set_supply_mv(&mut self, millivolts: u16) -> Result<(), Error> {
        if !(2000..=3600).contains(&millivolts) {
            return Err(Error::Range("the supply must be 2000 to 3600 mV"));
        }
        self.sync();
        self.bus.soc.pwr.set_supply_mv(millivolts);
        Ok(())
    }

    /// Locks the analog filters of I2C1 low, as the rise of the supply can do. The part then sees a busy bus until both
    /// wires have had an edge. Can also be called while the power is off.
    pub fn lock_i2c_filters(&mut self) {
        self.sync();
        let now = self.now();
        self.bus.soc.lock_i2c_filters(now);
    }

    /// Disturbs the wires of I2C1 at this instant with a pulse that looks like a start condition. Returns whether this
    /// was a bus error, because a byte was being transferred.
    pub fn disturb_i2c(&mut self) -> bool {
        self.sync();
        let now = self.now();
        self.bus.soc.disturb_i2c(now)
    }

    /// Returns the level of a pin, as a logic probe shows it: port `'A'` to `'E'`, pin 0 to 15. Low for a pin that does
    /// not exist.
    #[must_use]
    pub fn pin(&self, port: char, pin: u8) -> bool {
        self.look(port, pin)
            .is_some_and(|(gpio, pin)| gpio.level() >> pin & 1 != 0)
    }

    /// Returns whether a pin is an output; false for a pin that does not exist.
    #[must_use]
    pub fn is_output(&self, port: char, pin: u8) -> bool {
        self.look(port, pin)
            .is_some_and(|(gpio, pin)| gpio.outputs() >> pin & 1 != 0)
    }

    /// Records the edges of a pin from now on.
    pub fn watch_pin(&mut self, port: char, pin: u8) {
        if let Some(pin) = Pin::find(port, pin.into()) {
            self.bus.soc.gpio[pin.port_index()].watch(pin.number());
        }
    }

    /// Returns the recorded edges of a watched pin: each with its instant and the level after it.
    #[must_use]
    pub fn pin_edges(&self, port: char, pin: u8) -> &[(Time, bool)] {
        self.look(port, pin)
            .map_or(&[], |(gpio, pin)| gpio.edges(pin))
    }

    /// Returns the port of a pin, and the number of the pin in the port.
    fn look(&self, port: char, pin: u8) -> Option<(&Gpio, usize)> {
        let pin = Pin::find(port, pin.into())?;
        Some((&self.bus.soc.gpio[pin.port_index()], pin.number()))
    }
}
