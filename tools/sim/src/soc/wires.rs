//! The wires between the blocks, and from the part's pins to the board (hardware page of the modio-02).
//!
//! ```text
//! PA0-3  slot lines 1-4, ADC1 IN0-3     PA9    USART1 TX -> RS-485 driver
//! PA4-7  SW01 positions 1-4             PA10   RS-485 receiver -> USART1 RX, TIM1 CH3
//! PA8    driver enable                  PB6-7  I2C1 -> the slot's DAC
//! PB8-9  LEDs, PC13 LED                 PB12-15 SW01 positions 5-8
//! ```

use super::Soc;
use super::map::Block;
use crate::finding::What;
use crate::line::TxPin;
use crate::periph::clocks::Clocks;
use crate::periph::gpio::Drive;
use crate::periph::i2c::Wires;
use crate::periph::rcc::Cause;
use crate::peripheral::Peripheral;
use crate::time::Time;

/// The driver enable on port A.
pub(super) const DRIVER_ENABLE: usize = 8;
const TX: usize = 9;
const RX: usize = 10;
/// TIM1's channel at the RX pin.
pub(super) const RX_CAPTURE: usize = 3;
const SCL: usize = 6;
const SDA: usize = 7;
/// Lines from the slot, on PA0 and up.
const LINES: usize = 4;
/// SW01: position n + 1 is on this port and pin.
const SWITCH: [(usize, usize); 8] = [
    (0, 4),
    (0, 5),
    (0, 6),
    (0, 7),
    (1, 12),
    (1, 13),
    (1, 14),
    (1, 15),
];

impl Soc {
    /// Passes on what `block` has done at `now`.
    pub(super) fn wire(&mut self, block: Block, now: Time) {
        match block {
            Block::GpioA => {
                self.wire_driver(now);
                self.wire_outputs();
                self.wire_port(0, now);
            }
            Block::GpioB => {
                self.wire_i2c_pins(now);
                self.wire_port(1, now);
            }
            Block::GpioC => self.wire_port(2, now),
            Block::GpioD => self.wire_port(3, now),
            Block::Rcc => self.wire_rcc(now),
            Block::Flash => self.wire_flash(),
            Block::Iwdg => self.wire_watchdog(now),
            Block::Usart1 => self.check_receiver(now),
            // The radio is not on this board: nobody hears it.
            Block::Usart3 => drop(self.usart3.take_sent()),
            _ => {}
        }
    }

    /// Brings the line, USART1 and what TIM1 captures up to `now`.
    pub(super) fn sync_line(&mut self, now: Time) {
        self.line.exchange(&mut self.usart1, now);
        for (at, text) in self.line.take_findings() {
            self.notes.push((at, What::Other(text)));
        }
        self.note_requests(Block::Usart1);
        self.note_due(Block::Usart1);
    }

    /// The driver enable and the TX pin, as port A has them now.
    fn wire_driver(&mut self, now: Time) {
        let port = &self.gpio[0];
        let on = port.level() >> DRIVER_ENABLE & 1 != 0;
        let tx = if port.alternate_outputs() >> TX & 1 != 0 {
            TxPin::Usart
        } else {
            TxPin::Level(port.held(TX).unwrap_or(true))
        };
        if on != self.line.driver() || tx != self.tx_pin {
            self.tx_pin = tx;
            self.sync_line(now);
            self.line.set_tx_pin(tx, now);
            self.line.set_driver(on, now);
            self.note_due(Block::Usart1);
        }
    }

    /// USART1 hears nothing through a pin that is no input.
    fn check_receiver(&mut self, now: Time) {
        let port = &self.gpio[0];
        if self.usart1.awaits_start() && (port.outputs() | port.analog()) >> RX & 1 != 0 {
            let text = "USART1 receives, but its RX pin is no digital input";
            self.notes.push((now, What::Other(text)));
        }
    }

    /// Edges of a port to EXTI.
    fn wire_port(&mut self, port: usize, now: Time) {
        let level = self.gpio[port].level();
        let changed = level ^ self.seen[port];
        self.seen[port] = level;
        if self.gpio[port].take_contention() != 0 {
            let text = "the part and the board drive a pin against each other";
            self.notes.push((now, What::Other(text)));
        }
        if changed != 0 && self.exti.listens() {
            let mine = (0..16)
                .filter(|&line| changed >> line & 1 != 0 && self.afio.exti_port(line) == port)
                .fold(0, |mask, line| mask | 1 << line);
            self.exti.pins(mine, level);
            self.note_requests(Block::Exti);
        }
    }

    /// The part's outputs to the slot's lines.
    fn wire_outputs(&mut self) {
        let port = &self.gpio[0];
        let high = port.outputs() & port.level();
        for line in 0..LINES {
            self.slot.set_line(line + 1, high >> line & 1 != 0);
        }
    }

    /// What the module does to its lines, and to the wires of I2C1.
    pub(super) fn wire_slot(&mut self, now: Time) {
        for line in 0..LINES {
            self.gpio[0].drive(line, self.slot.drive(line + 1), now);
            let millivolts = self.gpio[0].millivolts(line);
            self.adc1.set_millivolts(line, millivolts, now);
            self.adc1
                .set_source_ohms(line, self.slot.source_ohms(line + 1), now);
        }
        self.wire_port(0, now);
        let held = self.slot.held();
        for (pin, free) in [(SCL, held.scl), (SDA, held.sda)] {
            let drive = if free { Drive::PullUp } else { Drive::Low };
            self.gpio[1].drive(pin, drive, now);
        }
        self.wire_port(1, now);
        self.i2c1.exchange(&mut self.slot, now);
        self.note_requests(Block::I2c1);
        self.note_due(Block::I2c1);
    }

    /// PB6 and PB7: the I2C block's, or moved by hand, to free a stuck bus.
    fn wire_i2c_pins(&mut self, now: Time) {
        const PINS: u16 = 1 << SCL | 1 << SDA;
        let connected = self.gpio[1].alternate_open_drains() & PINS == PINS;
        self.i2c1.set_connected(connected, now);
        let low = self.gpio[1].pulled_low();
        let pins = Wires {
            scl: low >> SCL & 1 == 0,
            sda: low >> SDA & 1 == 0,
        };
        if pins != self.i2c_pins {
            self.i2c_pins = pins;
            self.i2c1.exchange(&mut self.slot, now);
            self.slot.set_pins(pins);
            self.wire_slot(now);
        }
    }

    fn wire_rcc(&mut self, now: Time) {
        let changes = self.rcc.take_changes();
        for (bus, bits) in [changes.resets.0, changes.resets.1].into_iter().enumerate() {
            let mut bits = bits;
            while bits != 0 {
                let bit = bits.trailing_zeros();
                bits &= bits - 1;
                if let Some(block) = Block::of_bit(bus, bit) {
                    self.reset_block(block, now);
                }
            }
        }
        self.flash.hsi_on = self.rcc.hsi_on();
        self.wire_lsi(now);
        if changes.clocks {
            self.spread_clocks(now);
        }
    }

    /// Hands every block the frequency of its clock.
    pub(super) fn spread_clocks(&mut self, now: Time) {
        if self.rcc.clocks() != self.clocks {
            self.set_clocks(now);
        }
    }

    /// The same, whether or not any has changed.
    pub(super) fn set_clocks(&mut self, now: Time) {
        let clocks = self.rcc.clocks();
        self.clocks = clocks;
        self.signals.rate = true;
        if clocks == Clocks::STOPPED {
            let text = "SYSCLK's source has died with the clock security system off: the core stands still";
            self.notes.push((now, What::Other(text)));
        }
        if let Some(text) = clocks.over_limit() {
            self.notes.push((now, What::Other(text)));
        }
        self.check_wait_states(now);
        for block in Block::ALL {
            let hz = match block {
                Block::Tim1 => clocks.apb2_timers,
                Block::Tim2 | Block::Tim3 | Block::Tim4 => clocks.apb1_timers,
                Block::Usart1 => clocks.pclk2,
                Block::Usart3 | Block::I2c1 => clocks.pclk1,
                Block::Adc1 => clocks.adc,
                _ => continue,
            };
            self.catch_up(block, now);
            self.block(block).set_clock(hz, now);
            self.note_requests(block);
            self.note_due(block);
        }
        self.find_next();
    }

    /// Fetches fail when the flash has fewer wait states than SYSCLK needs (RM0008 3.3.3).
    fn check_wait_states(&mut self, now: Time) {
        let (wait_states, _) = self.flash.access_control();
        if self.clocks.sysclk > crate::machine::timing::highest_sysclk(wait_states) {
            let text = "SYSCLK is too fast for the flash's wait states";
            self.notes.push((now, What::Other(text)));
        }
    }

    fn wire_flash(&mut self) {
        let access = self.flash.access_control();
        if access != self.flash_access {
            self.flash_access = access;
            self.signals.rate = true;
        }
        if let Some(changed) = self.flash.take_changed() {
            self.signals.flash = Some(changed);
        }
    }

    /// The watchdog's clock.
    fn wire_lsi(&mut self, now: Time) {
        self.iwdg.advance(now);
        self.iwdg.set_lsi(self.rcc.lsi());
        self.note_due(Block::Iwdg);
    }

    fn wire_watchdog(&mut self, now: Time) {
        if self.iwdg.running() {
            self.rcc.hold_lsi(now);
            self.wire_lsi(now);
        }
        if self.iwdg.take_bite() {
            self.signals.reset = Some(Cause::Iwdg);
        }
    }

    /// The receiver's output at PA10, for a firmware that reads the pin.
    pub(super) fn drive_rx(&mut self, now: Time) {
        let drive = if self.line.rx_level() {
            Drive::High
        } else {
            Drive::Low
        };
        self.gpio[0].drive(RX, drive, now);
        self.wire_port(0, now);
    }

    /// Locks the analog filters of I2C1 low.
    pub fn lock_i2c_filters(&mut self, now: Time) {
        self.i2c1.lock_filters(now);
    }

    /// A disturbance that looks like a start condition on the I2C wires. Returns whether it was a bus error.
    pub fn disturb_i2c(&mut self, now: Time) -> bool {
        self.catch_up(Block::I2c1, now);
        let bus_error = self.i2c1.disturb();
        self.settle(Block::I2c1, now);
        self.find_next();
        bus_error
    }

    /// The crystal works or does not from `now` on.
    pub fn set_crystal(&mut self, works: bool, now: Time) {
        self.catch_up(Block::Rcc, now);
        self.rcc.set_crystal(works, now);
        self.settle(Block::Rcc, now);
        self.find_next();
    }

    /// SW01 stands at `positions`: bit 0 = position 1, a set bit = ON = connected to ground.
    pub fn set_switch(&mut self, positions: u8, now: Time) {
        for (n, (port, pin)) in SWITCH.into_iter().enumerate() {
            let drive = if positions >> n & 1 != 0 {
                Drive::Low
            } else {
                Drive::Floating
            };
            self.gpio[port].drive(pin, drive, now);
        }
        self.wire_port(0, now);
        self.wire_port(1, now);
    }
}
