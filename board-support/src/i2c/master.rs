//! The bus master (RM0008 26.3.3), polled.

use embedded_hal::i2c::{
    ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation, SevenBitAddress,
};
use stm32f1xx_hal::pac;

use super::{freeing::free, pins::BusPins};
use crate::{
    ClockSource,
    design::{I2C_HZ, I2C_STEP_US},
    wait::within_us,
};

/// Flags in SR1 (RM0008 26.6.6).
mod flag {
    pub const SB: u16 = 1 << 0;
    pub const ADDR: u16 = 1 << 1;
    pub const BTF: u16 = 1 << 2;
    pub const TXE: u16 = 1 << 7;
    pub const BERR: u16 = 1 << 8;
    pub const ARLO: u16 = 1 << 9;
    pub const AF: u16 = 1 << 10;
}

/// Clock settings of the peripheral.
#[derive(Clone, Copy)]
struct Timing {
    mhz: u8,
    /// A third of the SCL period in clock cycles, rounded up: in fast mode SCL is low for two thirds and high for
    /// one (RM0008 26.6.8).
    third: u8,
    /// The longest rise time, 0.3 us, in clock cycles plus 1 (RM0008 26.6.9).
    rise: u8,
}

impl Timing {
    const fn on(clock: ClockSource) -> Self {
        let hz = clock.apb1_hz();
        let mhz = (hz / 1_000_000) as u8;
        Self {
            mhz,
            third: hz.div_ceil(3 * I2C_HZ) as u8,
            rise: mhz * 3 / 10 + 1,
        }
    }
}

/// The DACs' bus. Its pins float until the first transfer.
pub struct DacBus {
    i2c: pac::I2C1,
    timing: Timing,
    /// The peripheral is enabled on the bus and no error is known.
    ready: bool,
}

impl DacBus {
    /// The peripheral's clock must be on.
    pub(crate) const fn new(i2c: pac::I2C1, clock: ClockSource) -> Self {
        Self {
            i2c,
            timing: match clock {
                ClockSource::Crystal => const { Timing::on(ClockSource::Crystal) },
                ClockSource::Internal => const { Timing::on(ClockSource::Internal) },
            },
            ready: false,
        }
    }

    /// Recovers the bus and enables the peripheral on it, unless that is already so.
    fn make_ready(&mut self) -> Result<(), ErrorKind> {
        // BUSY without a transfer under way means that a wire is or was held low. The flag may also stick without a
        // cause; toggling the pins and resetting the peripheral clears it (errata sheet, I2C analog filter).
        if self.ready && self.i2c.sr2().read().busy().bit_is_clear() {
            return Ok(());
        }
        self.leave();
        BusPins.by_hand();
        if !free(&mut BusPins) {
            return Err(ErrorKind::Bus);
        }
        BusPins.by_peripheral();
        // End the reset that `leave` has begun.
        self.i2c.cr1().write(|w| w.swrst().clear_bit());
        let Timing { mhz, third, rise } = self.timing;
        // SAFETY: FREQ allows 2 to 36, and the clock is 30 or 36 MHz.
        self.i2c.cr2().write(|w| unsafe { w.freq().bits(mhz) });
        // SAFETY: the value is at most 40; the field has twelve bits and a minimum of 1.
        self.i2c
            .ccr()
            .write(|w| unsafe { w.f_s().fast().ccr().bits(third.into()) });
        self.i2c.trise().write(|w| w.trise().set(rise));
        self.i2c.cr1().write(|w| w.pe().enabled());
        self.ready = true;
        Ok(())
    }

    /// Takes the peripheral off the bus in any state and keeps it in reset.
    fn leave(&mut self) {
        self.i2c.cr1().write(|w| w.swrst().set_bit());
        self.ready = false;
    }

    /// Runs a transfer on a bus that is ready. After an error that leaves the peripheral in an unknown state, takes
    /// it off the bus.
    fn on_bus(
        &mut self,
        transfer: impl FnOnce(&mut Self) -> Result<(), ErrorKind>,
    ) -> Result<(), ErrorKind> {
        self.make_ready()?;
        let result = transfer(self);
        let clean = match result {
            Ok(()) => true,
            Err(ErrorKind::NoAcknowledge(source)) => {
                // When a data byte was not acknowledged, the next byte may still be in DR and would begin the next
                // transfer.
                self.stop_after_no_acknowledge().is_ok() && source == NoAcknowledgeSource::Address
            }
            Err(_) => false,
        };
        if !clean {
            self.leave();
        }
        result
    }

    /// Writes bytes to a slave, from the start condition to the stop condition.
    fn write_all<'a>(
        &mut self,
        address: SevenBitAddress,
        bytes: impl Iterator<Item = &'a u8>,
    ) -> Result<(), ErrorKind> {
        self.i2c.cr1().modify(|_, w| w.start().set_bit());
        self.call(address)?;
        self.write_bytes(bytes)?;
        self.wait_for_stop()
    }

    /// Waits for the start condition, sends the slave's address for a write, and waits for the acknowledge.
    fn call(&self, address: SevenBitAddress) -> Result<(), ErrorKind> {
        self.wait_for(flag::SB, NoAcknowledgeSource::Unknown)?;
        self.put(address << 1);
        self.wait_for(flag::ADDR, NoAcknowledgeSource::Address)
    }

    fn write_bytes<'a>(&self, bytes: impl Iterator<Item = &'a u8>) -> Result<(), ErrorKind> {
        self.clear_addr();
        let mut sent = false;
        for byte in bytes {
            self.wait_for(flag::TXE, NoAcknowledgeSource::Data)?;
            self.put(*byte);
            sent = true;
        }
        if sent {
            self.wait_for(flag::BTF, NoAcknowledgeSource::Data)?;
        }
        self.stop();
        Ok(())
    }

    /// Requests a stop condition.
    fn stop(&self) {
        self.i2c.cr1().modify(|_, w| w.stop().set_bit());
    }

    fn put(&self, byte: u8) {
        self.i2c.dr().write(|w| w.dr().set(byte));
    }

    /// Clears ADDR by reading SR1, which showed it, and then SR2.
    fn clear_addr(&self) {
        let _ = self.i2c.sr2().read();
    }

    /// Waits for a flag. `source` is reported when no acknowledge is received instead.
    fn wait_for(&self, wanted: u16, source: NoAcknowledgeSource) -> Result<(), ErrorKind> {
        let mut seen = 0;
        within_us(I2C_STEP_US, || {
            seen = self.i2c.sr1().read().bits();
            seen & (wanted | flag::BERR | flag::ARLO | flag::AF) != 0
        });
        if seen & flag::ARLO != 0 {
            Err(ErrorKind::ArbitrationLoss)
        } else if seen & flag::BERR != 0 {
            Err(ErrorKind::Bus)
        } else if seen & flag::AF != 0 {
            Err(ErrorKind::NoAcknowledge(source))
        } else if seen & wanted != 0 {
            Ok(())
        } else {
            // A device stretches or holds the clock.
            Err(ErrorKind::Other)
        }
    }

    /// Waits until the stop condition has been sent.
    fn wait_for_stop(&self) -> Result<(), ErrorKind> {
        if within_us(I2C_STEP_US, || self.i2c.cr1().read().stop().bit_is_clear()) {
            Ok(())
        } else {
            Err(ErrorKind::Other)
        }
    }

    /// Ends a transfer that was not acknowledged with a stop condition, like any other.
    fn stop_after_no_acknowledge(&mut self) -> Result<(), ErrorKind> {
        self.i2c.sr1().modify(|_, w| w.af().clear_bit());
        self.stop();
        self.wait_for_stop()
    }
}

impl ErrorType for DacBus {
    type Error = ErrorKind;
}

/// Writes only, because the DACs are never read. A transaction with a read fails.
impl I2c for DacBus {
    fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), ErrorKind> {
        let reads = |operation: &Operation<'_>| matches!(operation, Operation::Read(_));
        if operations.iter().any(reads) {
            return Err(ErrorKind::Other);
        }
        if operations.is_empty() {
            return Ok(());
        }
        // Consecutive operations in the same direction form one run of bytes (embedded-hal's contract).
        let bytes = operations.iter().flat_map(|operation| match operation {
            Operation::Write(bytes) => *bytes,
            Operation::Read(_) => &[],
        });
        self.on_bus(|bus| bus.write_all(address, bytes))
    }

    fn write(&mut self, address: SevenBitAddress, bytes: &[u8]) -> Result<(), ErrorKind> {
        self.on_bus(|bus| bus.write_all(address, bytes.iter()))
    }
}
