//! The bus's master: RM0008 26.3.3, polled.

use core::mem;

use cortex_m::interrupt;
use embedded_hal::i2c::{ErrorType, I2c, NoAcknowledgeSource, Operation, SevenBitAddress};
use stm32f1xx_hal::pac;

use super::{error::DacBusError, freeing::free, pins::BusPins};
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
    pub const RXNE: u16 = 1 << 6;
    pub const TXE: u16 = 1 << 7;
    pub const BERR: u16 = 1 << 8;
    pub const ARLO: u16 = 1 << 9;
    pub const AF: u16 = 1 << 10;
}

/// How a group of bytes in one direction ends.
#[derive(Clone, Copy)]
enum End {
    Stop,
    Restart,
}

/// What the peripheral is to be told of its clock.
#[derive(Clone, Copy)]
struct Timing {
    mhz: u8,
    /// A third of a period of SCL, rounded up: fast mode is low for two and high for one (26.6.8).
    third: u8,
    /// The longest rise, 0.3 us, and one (26.6.9).
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

/// The DAC's bus. Its pins stay floating until the first transfer.
pub struct DacBus {
    i2c: pac::I2C1,
    pins: BusPins,
    timing: Timing,
    /// The peripheral is on the bus and nothing is known to be wrong.
    ready: bool,
}

impl DacBus {
    /// The peripheral has its clock.
    pub(crate) const fn new(i2c: pac::I2C1, pins: BusPins, clock: ClockSource) -> Self {
        Self {
            i2c,
            pins,
            timing: match clock {
                ClockSource::Crystal => const { Timing::on(ClockSource::Crystal) },
                ClockSource::Internal => const { Timing::on(ClockSource::Internal) },
            },
            ready: false,
        }
    }

    /// Puts the peripheral on a free bus, unless it is there already.
    fn make_ready(&mut self) -> Result<(), DacBusError> {
        // Busy with no transfer under way: a wire is or was held. The flag may also stick by itself,
        // which the toggling of the pins and the reset cure (errata sheet, I2C analog filter).
        if self.ready && self.i2c.sr2().read().busy().bit_is_clear() {
            return Ok(());
        }
        self.leave();
        self.pins.by_hand();
        free(&mut self.pins).map_err(DacBusError::Held)?;
        self.pins.by_peripheral();
        // Out of the reset that `leave` put it into.
        self.i2c.cr1().write(|w| w.swrst().clear_bit());
        let Timing { mhz, third, rise } = self.timing;
        // SAFETY: FREQ takes 2 to 36, and the clock is 30 or 36 MHz.
        self.i2c.cr2().write(|w| unsafe { w.freq().bits(mhz) });
        // SAFETY: at most 40 in a field of twelve bits whose least is 1.
        self.i2c
            .ccr()
            .write(|w| unsafe { w.f_s().fast().ccr().bits(third.into()) });
        self.i2c.trise().write(|w| w.trise().set(rise));
        self.i2c.cr1().write(|w| w.pe().enabled());
        self.ready = true;
        Ok(())
    }

    /// Takes the peripheral off the bus, whatever it is doing, and keeps it in reset.
    fn leave(&mut self) {
        self.i2c.cr1().write(|w| w.swrst().set_bit());
        self.ready = false;
    }

    /// Does a transfer on a bus that is ready, and leaves one that is clean, whatever comes of it.
    fn on_bus(
        &mut self,
        transfer: impl FnOnce(&mut Self) -> Result<(), DacBusError>,
    ) -> Result<(), DacBusError> {
        self.make_ready()?;
        let result = transfer(self);
        let clean = match result {
            Ok(()) => true,
            Err(DacBusError::NoAcknowledge(source)) => {
                // After a data byte the next may wait in DR, and would begin the next transfer.
                self.stop_after_no_acknowledge().is_ok() && source == NoAcknowledgeSource::Address
            }
            Err(_) => false,
        };
        if !clean {
            self.leave();
        }
        result
    }

    fn transfer(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), DacBusError> {
        self.i2c.cr1().modify(|_, w| w.start().set_bit());
        let mut rest = operations;
        // Operations in one direction make one run of bytes (embedded-hal's contract).
        while let Some(first) = rest.first() {
            let reads = is_read(first);
            let count = rest.iter().take_while(|it| is_read(it) == reads).count();
            let Some((group, after)) = mem::take(&mut rest).split_at_mut_checked(count) else {
                break;
            };
            let end = if after.is_empty() {
                End::Stop
            } else {
                End::Restart
            };
            self.call(address, reads)?;
            if reads {
                self.read_group(group, end)?;
            } else {
                self.write_bytes(group.iter().flat_map(written), end)?;
            }
            rest = after;
        }
        self.wait_for_stop()
    }

    /// Once the start condition is made, calls a slave, which is to acknowledge.
    fn call(&self, address: SevenBitAddress, reads: bool) -> Result<(), DacBusError> {
        self.wait_for(flag::SB, NoAcknowledgeSource::Unknown)?;
        self.put(address << 1 | u8::from(reads));
        self.wait_for(flag::ADDR, NoAcknowledgeSource::Address)
    }

    fn write_bytes<'a>(
        &self,
        bytes: impl Iterator<Item = &'a u8>,
        end: End,
    ) -> Result<(), DacBusError> {
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
        self.end(end);
        Ok(())
    }

    /// The last bytes take care (26.3.3, "closing the communication"): what is to follow the last must
    /// be said before the one before it is taken. Where the peripheral does not wait for that by itself,
    /// no interrupt may come between; those stretches are a few instructions long.
    fn read_group(&mut self, group: &mut [Operation<'_>], end: End) -> Result<(), DacBusError> {
        let mut left: usize = group.iter().map(length).sum();
        let mut places = group.iter_mut().flat_map(filled);
        let mut take = |bus: &Self| {
            let byte = bus.i2c.dr().read().dr().bits();
            if let Some(place) = places.next() {
                *place = byte;
            }
        };
        match left {
            0 => return Err(DacBusError::NothingToRead),
            1 => {
                self.i2c
                    .cr1()
                    .modify(|_, w| w.ack().clear_bit().pos().clear_bit());
                interrupt::free(|_| {
                    self.clear_addr();
                    self.end(end);
                });
                self.wait_for(flag::RXNE, NoAcknowledgeSource::Unknown)?;
                take(self);
            }
            2 => {
                // POS: ACK rules the second byte instead of the first.
                self.i2c
                    .cr1()
                    .modify(|_, w| w.ack().set_bit().pos().set_bit());
                interrupt::free(|_| {
                    self.clear_addr();
                    self.i2c.cr1().modify(|_, w| w.ack().clear_bit());
                });
                self.wait_for(flag::BTF, NoAcknowledgeSource::Unknown)?;
                interrupt::free(|_| {
                    self.end(end);
                    take(self);
                });
                take(self);
            }
            _ => {
                self.i2c
                    .cr1()
                    .modify(|_, w| w.ack().set_bit().pos().clear_bit());
                self.clear_addr();
                while left > 3 {
                    self.wait_for(flag::RXNE, NoAcknowledgeSource::Unknown)?;
                    take(self);
                    left -= 1;
                }
                // Two bytes are there and the clock is stretched: the third is to come.
                self.wait_for(flag::BTF, NoAcknowledgeSource::Unknown)?;
                self.i2c.cr1().modify(|_, w| w.ack().clear_bit());
                interrupt::free(|_| {
                    take(self);
                    self.end(end);
                    take(self);
                });
                self.wait_for(flag::RXNE, NoAcknowledgeSource::Unknown)?;
                take(self);
            }
        }
        Ok(())
    }

    /// Asks for a stop condition, or for a start that goes on.
    fn end(&self, end: End) {
        self.i2c.cr1().modify(|_, w| match end {
            End::Stop => w.stop().set_bit(),
            End::Restart => w.start().set_bit(),
        });
    }

    fn put(&self, byte: u8) {
        self.i2c.dr().write(|w| w.dr().set(byte));
    }

    /// ADDR is taken back by reading SR1, which showed it, and then SR2.
    fn clear_addr(&self) {
        let _ = self.i2c.sr2().read();
    }

    /// Waits for a flag. `source` is who did not acknowledge, if that is what comes.
    fn wait_for(&self, wanted: u16, source: NoAcknowledgeSource) -> Result<(), DacBusError> {
        let mut seen = 0;
        within_us(I2C_STEP_US, || {
            seen = self.i2c.sr1().read().bits();
            seen & (wanted | flag::BERR | flag::ARLO | flag::AF) != 0
        });
        if seen & flag::ARLO != 0 {
            Err(DacBusError::ArbitrationLost)
        } else if seen & flag::BERR != 0 {
            Err(DacBusError::Misplaced)
        } else if seen & flag::AF != 0 {
            Err(DacBusError::NoAcknowledge(source))
        } else if seen & wanted != 0 {
            Ok(())
        } else {
            Err(DacBusError::Timeout)
        }
    }

    /// Waits until the stop condition is made.
    fn wait_for_stop(&self) -> Result<(), DacBusError> {
        if within_us(I2C_STEP_US, || self.i2c.cr1().read().stop().bit_is_clear()) {
            Ok(())
        } else {
            Err(DacBusError::Timeout)
        }
    }

    /// Ends a transfer that was not acknowledged, as any other is ended.
    fn stop_after_no_acknowledge(&mut self) -> Result<(), DacBusError> {
        self.i2c.sr1().modify(|_, w| w.af().clear_bit());
        self.end(End::Stop);
        self.wait_for_stop()
    }
}

impl ErrorType for DacBus {
    type Error = DacBusError;
}

impl I2c for DacBus {
    fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), DacBusError> {
        if operations.is_empty() {
            return Ok(());
        }
        self.on_bus(|bus| bus.transfer(address, operations))
    }

    /// As a transaction of this one write, by a shorter way: it is all that the DAC's driver needs, and
    /// whoever never reads is to have no code for that.
    fn write(&mut self, address: SevenBitAddress, bytes: &[u8]) -> Result<(), DacBusError> {
        self.on_bus(|bus| {
            bus.i2c.cr1().modify(|_, w| w.start().set_bit());
            bus.call(address, false)?;
            bus.write_bytes(bytes.iter(), End::Stop)?;
            bus.wait_for_stop()
        })
    }
}

fn is_read(operation: &Operation<'_>) -> bool {
    matches!(operation, Operation::Read(_))
}

fn length(operation: &Operation<'_>) -> usize {
    match operation {
        Operation::Read(bytes) => bytes.len(),
        Operation::Write(bytes) => bytes.len(),
    }
}

fn written<'a>(operation: &'a Operation<'_>) -> &'a [u8] {
    match operation {
        Operation::Write(bytes) => bytes,
        Operation::Read(_) => &[],
    }
}

fn filled<'a>(operation: &'a mut Operation<'_>) -> &'a mut [u8] {
    match operation {
        Operation::Read(bytes) => bytes,
        Operation::Write(_) => &mut [],
    }
}
