//! I2C1 as a bus master in 7-bit addressing, without DMA, SMBus, PEC and slave mode (RM0008 26).
//!
//! [`I2c::exchange`] runs the bus. One bit lasts 2, 3 or 25 times CCR cycles of PCLK1 (26.6.8); the rise time of
//! the wires is not counted. A start or stop condition takes one bit. Unless both pins are in alternate open drain
//! (RM0008 9.1.11), the block drives nothing, so no requested transfer begins or ends.
//!
//! Two failures of the block are modelled. Its analog filters may stay low while the wires are high
//! (errata sheet of the STM32F10xx8 and STM32F10xxB, 2.13.7 "I2C analog filter may provide wrong value,
//! locking BUSY flag and preventing master mode entry"): [`I2c::lock_filters`]. BUSY is then set after every
//! reset, until each wire has had an edge and the block a software reset. A start or stop condition of
//! someone else in the middle of a byte is a bus error (26.3.4): [`I2c::disturb`].
//!
//! Misuse that makes a real block misbehave is reported: CR1 written while START or STOP is pending, CCR written
//! while PE = 1, FREQ that differs from PCLK1.

mod bits;
mod bus;
mod master;
mod registers;

#[cfg(test)]
mod tests;

use crate::peripheral::Unmodelled;
use crate::time::Time;
use bits::{ccr, cr1, cr2, sr1};
pub use bus::{Bus, NoDevice, Wires};
use master::Phase;

/// TRISE out of reset, 26.6.9.
const TRISE_RESET: u32 = 2;

/// The I2C block.
#[derive(Clone, Debug)]
pub struct I2c {
    hz: u32,
    cr1: u32,
    cr2: u32,
    oar: [u32; 2],
    ccr: u32,
    trise: u32,
    sr1: u32,
    /// MSL and TRA; BUSY is `busy`.
    sr2: u32,
    busy: bool,
    /// The flags that the last read of SR1 returned: the first half of a clearing sequence.
    shown: u32,
    /// The received byte in DR.
    data: u8,
    /// A received byte in the shift register that waits until DR is read.
    behind: Option<u8>,
    /// The byte written to DR, which waits for the shift register.
    pending: Option<u8>,
    phase: Phase,
    /// When the current state ends.
    due: Option<Time>,
    /// The current state can end only when the wires are released and both pins are connected.
    stalled: bool,
    /// The levels of the wires without this block, after the analog filters.
    wires: Wires,
    /// The levels of the wires without this block, before the filters.
    lines: Wires,
    /// The analog filters: `false` for a filter that is locked low.
    filters: Wires,
    /// BUSY stays set until a software reset finds both filters free.
    latched: bool,
    /// Both pins are in alternate open drain.
    connected: bool,
}

impl Default for I2c {
    /// Returns a block after reset, without a clock.
    fn default() -> Self {
        Self {
            hz: 0,
            cr1: 0,
            cr2: 0,
            oar: [0; 2],
            ccr: 0,
            trise: TRISE_RESET,
            sr1: 0,
            sr2: 0,
            busy: false,
            shown: 0,
            data: 0,
            behind: None,
            pending: None,
            phase: Phase::Idle,
            due: None,
            stalled: false,
            wires: Wires::FREE,
            lines: Wires::FREE,
            filters: Wires::FREE,
            latched: false,
            connected: false,
        }
    }
}

impl I2c {
    /// Sets whether both pins are in alternate open drain from `now` on.
    pub fn set_connected(&mut self, connected: bool, now: Time) {
        self.connected = connected;
        self.look(self.lines, now);
    }

    /// Locks both analog filters low, as the rise of the supply or a discharge may. No reset frees them.
    pub fn lock_filters(&mut self, now: Time) {
        self.filters = Wires {
            scl: false,
            sda: false,
        };
        self.latched = true;
        self.look(self.lines, now);
    }

    /// Makes a start condition of another master. In the middle of a byte that is a bus error, which leaves the
    /// master's state unchanged (26.3.4); on a free bus it makes the bus busy.
    /// Returns whether it was a bus error.
    pub fn disturb(&mut self) -> bool {
        let in_byte = matches!(
            self.phase,
            Phase::Address(_) | Phase::Send(_) | Phase::Receive { .. }
        );
        if in_byte {
            self.sr1 |= sr1::BERR;
        } else if self.phase == Phase::Idle {
            self.busy = true;
        }
        in_byte
    }

    /// Returns the event interrupt, I2C1_EV (26.4, table 189).
    #[must_use]
    pub const fn irq_event(&self) -> bool {
        self.cr2 & cr2::ITEVTEN != 0
            && (self.sr1 & sr1::EVENTS != 0
                || self.cr2 & cr2::ITBUFEN != 0 && self.sr1 & sr1::BUFFER != 0)
    }

    /// Returns the error interrupt, I2C1_ER.
    #[must_use]
    pub const fn irq_error(&self) -> bool {
        self.cr2 & cr2::ITERREN != 0 && self.sr1 & sr1::ERRORS != 0
    }

    /// Returns the PCLK1 cycles of one SCL period (26.6.8).
    fn bit_cycles(&self) -> u64 {
        let factor = match self.ccr & (ccr::FAST | ccr::DUTY) {
            0 | ccr::DUTY => 2,
            ccr::FAST => 3,
            _ => 25,
        };
        u64::from(self.ccr & ccr::CCR) * factor
    }

    /// Returns the duration of `n` bits.
    fn bits(&self, n: u64) -> Time {
        Time::cycles(n * self.bit_cycles(), self.hz)
    }

    fn read_data(&mut self, now: Time) -> u32 {
        let data = u32::from(self.data);
        match self.behind.take() {
            // The byte in the shift register moves to DR and RXNE stays set (26.3.3, master receiver).
            Some(next) => {
                self.data = next;
                self.sr1 &= !sr1::BTF;
                if self.phase == Phase::ReceiveWait {
                    self.receive_next(now);
                }
            }
            None => self.sr1 &= !(sr1::RXNE | self.shown & sr1::BTF),
        }
        data
    }

    fn write_data(&mut self, byte: u8, now: Time) -> Result<(), Unmodelled> {
        match self.phase {
            Phase::Started if self.sr1 & sr1::SB != 0 => {
                if self.shown & sr1::SB == 0 {
                    return Err(Unmodelled(
                        "I2C address written without reading SR1: SB stays set",
                    ));
                }
                self.sr1 &= !sr1::SB;
                self.shown &= !sr1::SB;
                self.phase = Phase::Address(byte);
                self.due = Some(now + self.bits(9));
            }
            Phase::Addressed(false) | Phase::Send(_) => {
                let overwritten = self.pending.replace(byte).is_some();
                self.sr1 &= !sr1::TXE;
                if overwritten {
                    return Err(Unmodelled("I2C DR written while TXE = 0"));
                }
            }
            Phase::SendWait => {
                self.pending = Some(byte);
                self.send_next(now);
            }
            _ => return Err(Unmodelled("I2C DR written outside a transfer")),
        }
        Ok(())
    }

    /// Handles the read of SR2 after SR1: clears ADDR, so that the transfer continues.
    fn clear_addr(&mut self, now: Time) {
        if self.shown & self.sr1 & sr1::ADDR == 0 {
            return;
        }
        self.sr1 &= !sr1::ADDR;
        self.shown &= !sr1::ADDR;
        if let Phase::Addressed(receiver) = self.phase {
            if receiver {
                self.receive_next(now);
            } else {
                self.phase = Phase::SendWait;
                self.send_next(now);
            }
            self.begin(now);
        }
    }

    fn write_cr1(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        if value & cr1::SWRST != 0 {
            self.software_reset();
            self.cr1 = cr1::SWRST;
            self.look(self.lines, now);
            return Ok(());
        }
        if self.cr1 & cr1::SWRST != 0 {
            // After reset, BUSY follows the filters.
            self.latched = self.filters != Wires::FREE;
            self.busy = self.wires != Wires::FREE;
        }
        let asked = cr1::START | cr1::STOP;
        let value = value & cr1::MASK;
        let mut finding = Ok(());
        if self.cr1 & asked != 0 && value & cr1::PE != 0 {
            finding = Err(Unmodelled("I2C CR1 written while START or STOP is pending"));
        }
        let enabled = value & cr1::PE != 0 && self.cr1 & cr1::PE == 0;
        self.cr1 = value;
        if value & cr1::PE == 0 {
            return self.disable();
        }
        if enabled {
            finding = finding.and_then(|()| self.check_timing());
        }
        if value & cr1::STOP != 0 && self.phase == Phase::Idle && value & cr1::START == 0 {
            self.cr1 &= !cr1::STOP;
            finding = Err(Unmodelled("I2C STOP outside a transfer"));
        }
        self.begin(now);
        if value & cr1::START != 0 && !self.connected {
            return Err(Unmodelled(
                "I2C START without both pins in alternate open drain",
            ));
        }
        if value & !cr1::MODELLED != 0 {
            return Err(Unmodelled(
                "I2C SMBus, PEC, general call or slave mode (CR1)",
            ));
        }
        finding
    }

    /// Handles PE = 0: clears the flags and requests.
    fn disable(&mut self) -> Result<(), Unmodelled> {
        let idle = self.phase == Phase::Idle;
        self.cr1 &= !(cr1::START | cr1::STOP | cr1::ACK);
        self.sr1 = 0;
        self.sr2 = 0;
        self.phase = Phase::Idle;
        self.due = None;
        self.stalled = false;
        self.pending = None;
        self.behind = None;
        if idle {
            Ok(())
        } else {
            // 26.6.1: in master mode PE must not be reset before the end of the transfer.
            Err(Unmodelled("I2C PE cleared in the middle of a transfer"))
        }
    }

    /// Checks the clock settings before a transfer (26.6.2, 26.6.8).
    fn check_timing(&self) -> Result<(), Unmodelled> {
        let fast = self.ccr & ccr::FAST != 0;
        let count = self.ccr & ccr::CCR;
        let limit = if fast { 400_000 } else { 100_000 };
        // The firmware cannot know the error of the oscillator.
        let set = (self.cr2 & cr2::FREQ) * 1_000_000;
        if self.hz.abs_diff(set) > self.hz / 33 || !(2..=36).contains(&(self.cr2 & cr2::FREQ)) {
            return Err(Unmodelled(
                "I2C CR2.FREQ that is not PCLK1 in MHz, 2 to 36,",
            ));
        }
        if count < if fast { 1 } else { 4 } {
            return Err(Unmodelled("I2C CCR below its minimum"));
        }
        if u64::from(set) > limit * self.bit_cycles() {
            return Err(Unmodelled(
                "I2C clock above 100 kHz, or 400 kHz in fast mode,",
            ));
        }
        Ok(())
    }

    fn software_reset(&mut self) {
        *self = Self {
            hz: self.hz,
            wires: self.wires,
            lines: self.lines,
            filters: self.filters,
            latched: self.filters != Wires::FREE,
            connected: self.connected,
            ..Self::default()
        };
    }
}
