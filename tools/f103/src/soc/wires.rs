//! The wires between the blocks, and from the part's pins to the circuit. All blocks but the USARTs
//! ([`serial`](super::serial)) are on their default pins (DS5319 table 5).

use super::Soc;
use super::circuit::{Circuit, Pin};
use super::map::Block;
use crate::finding::What;
use crate::periph::clocks::Clocks;
use crate::periph::gpio::DebugPins;
use crate::periph::i2c::NoDevice;
use crate::periph::iwdg;
use crate::periph::rcc::Cause;
use crate::periph::usart::TxPin;
use crate::peripheral::Peripheral;
use crate::time::Time;

/// The outputs of the DAC, on one port.
const DAC_OUTPUTS: [Pin; 2] = [Pin::new('A', 4), Pin::new('A', 5)];

/// I2C1's pins.
const SCL: Pin = Pin::new('B', 6);
const SDA: Pin = Pin::new('B', 7);

impl<C: Circuit> Soc<C> {
    /// Passes the outputs of `block` on at `now`.
    pub(super) fn wire(&mut self, block: Block, now: Time) {
        match block {
            Block::GpioA => self.wire_gpio(0, now),
            Block::GpioB => self.wire_gpio(1, now),
            Block::GpioC => self.wire_gpio(2, now),
            Block::GpioD => self.wire_gpio(3, now),
            Block::GpioE => self.wire_gpio(4, now),
            Block::Afio => {
                self.wire_debug(now);
                self.place_usarts(now);
            }
            Block::Dac => self.wire_dac(now),
            Block::Dma1 => self.wire_dma(0, now),
            Block::Dma2 => self.wire_dma(1, now),
            Block::Rcc => self.wire_rcc(now),
            Block::Flash => self.wire_flash(),
            Block::Iwdg => self.wire_watchdog(now),
            _ => {
                let mut serials = self.places.0.into_iter();
                if let Some(serial) = serials.find(|serial| serial.usart == block) {
                    self.wire_usart(&serial, now);
                }
            }
        }
    }

    /// Passes the outputs of a port on to the wires and to the circuit.
    pub(super) fn wire_gpio(&mut self, port: usize, now: Time) {
        let gpio = &self.gpio[port];
        let serials = self.places.0.into_iter();
        let serials = serials.filter(|serial| serial.tx.port_index() == port && !serial.displaced);
        for serial in serials.clone() {
            let tx = serial.tx.number();
            let pin = if gpio.alternate_outputs() >> tx & 1 != 0 {
                TxPin::Usart
            } else {
                TxPin::Level(gpio.held(tx).unwrap_or(true))
            };
            if let Some(wire) = self.circuit.wire(serial.tx) {
                wire.set_tx_pin(pin, now);
            }
        }
        if port == SCL.port_index() {
            self.wire_i2c_pins(now);
        }
        let name = char::from(b'A' + port as u8);
        if self.circuit.port_changed(name, &self.gpio[port], now) {
            self.refresh(now);
        }
        for serial in serials {
            self.note_due(serial.usart);
        }
        self.wire_port(port, now);
    }

    /// Passes the edges of a port on to EXTI.
    pub(super) fn wire_port(&mut self, port: usize, now: Time) {
        let level = self.gpio[port].level();
        let changed = level ^ self.seen[port];
        self.seen[port] = level;
        if self.gpio[port].take_contention() != 0 {
            let text = "the part and the board drive a pin to opposite levels";
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

    /// Passes the pins of the debug port on to their ports.
    fn wire_debug(&mut self, now: Time) {
        // RM0008 9.3.5: JTMS, JTDI and NJTRST are pulled up, JTCK is pulled down, JTDO floats.
        const PULLED_UP: [u16; 2] = [0b101 << 13, 1 << 4];
        const PULLED_DOWN: [u16; 2] = [1 << 14, 0];
        for (port, owned) in self.afio.debug_pins().into_iter().enumerate() {
            let pins = DebugPins {
                owned,
                up: owned & PULLED_UP[port],
                down: owned & PULLED_DOWN[port],
            };
            self.gpio[port].set_debug(pins, now);
            self.wire_gpio(port, now);
        }
    }

    /// Passes the outputs of the DAC on to their pins, and to the circuit.
    fn wire_dac(&mut self, now: Time) {
        let port = DAC_OUTPUTS[0].port_index();
        for (n, pin) in DAC_OUTPUTS.into_iter().enumerate() {
            let millivolts = self.dac.millivolts(n);
            self.gpio[port].set_dac(pin.number(), millivolts);
            if millivolts.is_some() && self.gpio[port].analog() >> pin.number() & 1 == 0 {
                let text = "an output of the DAC is on, but its pin is not analog";
                self.notes.push((now, What::Other(text)));
            }
        }
        self.wire_gpio(port, now);
    }

    /// Passes on the use of PB6 and PB7: as pins of I2C1, or as GPIO outputs, with which the firmware frees a stuck
    /// bus.
    fn wire_i2c_pins(&mut self, now: Time) {
        const PINS: u16 = 1 << SCL.number() | 1 << SDA.number();
        let port = &self.gpio[SCL.port_index()];
        let connected = port.alternate_open_drains() & PINS == PINS;
        self.i2c1.set_connected(connected, now);
        let by_hand = port.pulled_low() & PINS;
        if by_hand != self.i2c_by_hand {
            self.i2c_by_hand = by_hand;
            self.exchange_i2c(now);
        }
    }

    /// Computes I2C1 and the devices on its bus up to `now`.
    pub(super) fn exchange_i2c(&mut self, now: Time) {
        match self.circuit.i2c(SCL) {
            Some(bus) => self.i2c1.exchange(bus, now),
            None => self.i2c1.exchange(&mut NoDevice, now),
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

    /// Passes the clocks on to the blocks, if one has changed.
    pub(super) fn spread_clocks(&mut self, now: Time) {
        if self.rcc.clocks() != self.clocks {
            self.set_clocks(now);
        }
    }

    /// Passes the frequency of its clock on to each block.
    pub(super) fn set_clocks(&mut self, now: Time) {
        let clocks = self.rcc.clocks();
        self.clocks = clocks;
        self.signals.rate = true;
        if clocks == Clocks::STOPPED {
            let text = "the source of SYSCLK has failed with the clock security system off: the core is stopped";
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
                Block::Usart2 | Block::Usart3 | Block::Uart4 | Block::I2c1 | Block::Can => {
                    clocks.pclk1
                }
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

    /// Reports a flash with fewer wait states than SYSCLK needs (RM0008 3.3.3).
    fn check_wait_states(&mut self, now: Time) {
        let (wait_states, _) = self.flash.access_control();
        if self.clocks.sysclk > crate::periph::clocks::highest_sysclk(wait_states) {
            let text = "SYSCLK is too fast for the wait states of the flash";
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

    /// Passes the clock of the watchdog on to it.
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
        if self.iwdg.take_stuck() {
            self.notes.push((now, What::Other(iwdg::STUCK)));
        }
        if self.iwdg.take_reset_request() {
            self.signals.reset = Some(Cause::Iwdg);
        }
    }

    /// Locks the analog filters of I2C1 low.
    pub fn lock_i2c_filters(&mut self, now: Time) {
        self.i2c1.lock_filters(now);
    }

    /// Disturbs the I2C wires with a pulse that looks like a start condition. Returns whether this was a bus error.
    pub fn disturb_i2c(&mut self, now: Time) -> bool {
        self.catch_up(Block::I2c1, now);
        let bus_error = self.i2c1.disturb();
        self.settle(Block::I2c1, now);
        self.find_next();
        bus_error
    }

    /// Sets the frequencies of the RC oscillators in Hz, from `now` on.
    pub fn set_rc_oscillators(&mut self, hsi: u32, lsi: u32, now: Time) {
        self.catch_up(Block::Rcc, now);
        self.rcc.set_rc_oscillators(hsi, lsi);
        self.catch_up(Block::Iwdg, now);
        self.iwdg.set_rate(lsi);
        self.settle(Block::Rcc, now);
        self.find_next();
    }

    /// Sets whether the crystal works, from `now` on.
    pub fn set_crystal(&mut self, works: bool, now: Time) {
        self.catch_up(Block::Rcc, now);
        self.rcc.set_crystal(works, now);
        self.settle(Block::Rcc, now);
        self.find_next();
    }
}
