//! The wires between the blocks, and from the part's pins to the circuit. All blocks are on their default pins (DS5319
//! table 5).

use super::Soc;
use super::circuit::{Circuit, PORTS, Pin};
use super::map::Block;
use crate::finding::What;
use crate::periph::clocks::Clocks;
use crate::periph::i2c::NoDevice;
use crate::periph::rcc::Cause;
use crate::periph::usart::{TxPin, Usart, Wire};
use crate::peripheral::Peripheral;
use crate::time::Time;

/// A USART and its pins, both on one port.
#[derive(Debug)]
pub(super) struct Serial {
    pub(super) usart: Block,
    pub(super) tx: Pin,
    rx: Pin,
    /// Finding when the receiver is on but the RX pin is not an input.
    no_input: &'static str,
}

impl Serial {
    /// Returns the port of the USART's pins.
    pub(super) const fn port(&self) -> Block {
        GPIO[self.tx.port_index()]
    }
}

/// The blocks of the ports, from A on.
const GPIO: [Block; PORTS] = [Block::GpioA, Block::GpioB, Block::GpioC, Block::GpioD];

/// The USARTs that are modelled.
pub(super) const SERIALS: [Serial; 2] = [
    Serial {
        usart: Block::Usart1,
        tx: Pin::new('A', 9),
        rx: Pin::new('A', 10),
        no_input: "USART1 receives, but its RX pin is not a digital input",
    },
    Serial {
        usart: Block::Usart3,
        tx: Pin::new('B', 10),
        rx: Pin::new('B', 11),
        no_input: "USART3 receives, but its RX pin is not a digital input",
    },
];

/// The USART whose RX pin is also a channel of TIM1.
pub(super) const CAPTURED: &Serial = &SERIALS[0];
/// The channel of TIM1 at this pin.
pub(super) const RX_CAPTURE: usize = 3;

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
            Block::Rcc => self.wire_rcc(now),
            Block::Flash => self.wire_flash(),
            Block::Iwdg => self.wire_watchdog(now),
            Block::Usart1 => self.wire_usart(&SERIALS[0], now),
            Block::Usart3 => self.wire_usart(&SERIALS[1], now),
            _ => {}
        }
    }

    /// Returns a USART and the device that is connected to it.
    fn usart(&mut self, serial: &Serial) -> (&mut Usart, Option<&mut dyn Wire>) {
        let usart = match serial.usart {
            Block::Usart3 => &mut self.usart3,
            _ => &mut self.usart1,
        };
        (usart, self.circuit.wire(serial.tx))
    }

    /// Computes a USART and its wire up to `now`.
    pub(super) fn sync_wire(&mut self, serial: &Serial, now: Time) {
        match self.usart(serial) {
            (usart, Some(wire)) => usart.exchange(wire, now),
            (usart, None) => {
                usart.advance(now);
                usart.take_sent();
            }
        }
        for (at, text) in self.circuit.take_findings() {
            self.notes.push((at, What::Other(text)));
        }
        if self.circuit.pins_changed() {
            self.refresh(now);
        }
        self.note_requests(serial.usart);
        self.note_due(serial.usart);
    }

    /// Returns the instant of the next event in a USART or at its RX pin.
    pub(super) fn next_exchange(&mut self, serial: &Serial) -> Option<Time> {
        match self.usart(serial) {
            (usart, Some(wire)) => usart.next_exchange(wire),
            (usart, None) => usart.next_event(),
        }
    }

    /// Passes a character that has begun on to the wire, and reports a USART whose receiver is on while its RX pin is
    /// not an input.
    fn wire_usart(&mut self, serial: &Serial, now: Time) {
        let port = &self.gpio[serial.rx.port_index()];
        let closed = (port.outputs() | port.analog()) >> serial.rx.number() & 1 != 0;
        let (usart, wire) = self.usart(serial);
        let connected = wire.is_some();
        if let Some(wire) = wire {
            usart.pass_sent(wire);
        }
        if closed && connected && usart.awaits_start() {
            self.notes.push((now, What::Other(serial.no_input)));
        }
    }

    /// Drives the RX pin, for firmware that reads its level.
    pub(super) fn drive_rx(&mut self, serial: &Serial, now: Time) {
        let Some(wire) = self.circuit.wire(serial.tx) else {
            return;
        };
        let drive = wire.rx_drive();
        self.gpio[serial.rx.port_index()].drive(serial.rx.number(), drive, now);
        self.wire_port(serial.rx.port_index(), now);
    }

    /// Passes the outputs of a port on to the wires and to the circuit.
    fn wire_gpio(&mut self, port: usize, now: Time) {
        let gpio = &self.gpio[port];
        for serial in SERIALS
            .iter()
            .filter(|serial| serial.tx.port_index() == port)
        {
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
        for serial in SERIALS
            .iter()
            .filter(|serial| serial.tx.port_index() == port)
        {
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
