//! The USARTs, their pins, and the devices that are connected to them.

use super::Soc;
use super::circuit::{Circuit, Pin};
use super::map::Block;
use crate::finding::What;
use crate::part::PORTS;
use crate::periph::usart::{TxPin, Usart, Wire};
use crate::peripheral::Peripheral;
use crate::time::Time;

/// The blocks of the ports, from A on.
const GPIO: [Block; PORTS] = [
    Block::GpioA,
    Block::GpioB,
    Block::GpioC,
    Block::GpioD,
    Block::GpioE,
];

/// A USART and its pins, both on one port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Serial {
    pub(super) usart: Block,
    pub(super) tx: Pin,
    rx: Pin,
    /// Finding when the receiver is on but the RX pin is not an input.
    no_input: &'static str,
    /// Another USART was remapped to these pins: this one is connected to nothing.
    pub(super) displaced: bool,
}

impl Serial {
    const fn new(usart: Block, tx: Pin, rx: Pin, no_input: &'static str) -> Self {
        Self {
            usart,
            tx,
            rx,
            no_input,
            displaced: false,
        }
    }

    /// Returns the port of the USART's pins.
    pub(super) const fn port(&self) -> Block {
        GPIO[self.tx.port_index()]
    }
}

/// Number of USARTs that are modelled.
pub(super) const USARTS: usize = 4;

/// The USARTs on the pins that they have after a reset (DS5319 table 5).
const HOMES: [Serial; USARTS] = [
    Serial::new(
        Block::Usart1,
        Pin::new('A', 9),
        Pin::new('A', 10),
        "USART1 receives, but its RX pin is not a digital input",
    ),
    Serial::new(
        Block::Usart2,
        Pin::new('A', 2),
        Pin::new('A', 3),
        "USART2 receives, but its RX pin is not a digital input",
    ),
    Serial::new(
        Block::Usart3,
        Pin::new('B', 10),
        Pin::new('B', 11),
        "USART3 receives, but its RX pin is not a digital input",
    ),
    Serial::new(
        Block::Uart4,
        Pin::new('C', 10),
        Pin::new('C', 11),
        "UART4 receives, but its RX pin is not a digital input",
    ),
];

/// The remaps of USARTs (RM0008 9.3.8 and 9.4.2): number of the USART from 0, its field in AFIO_MAPR, the value of the
/// field, TX and RX.
const REMAPS: [(usize, u32, u32, Pin, Pin); 4] = [
    (0, 1 << 2, 1 << 2, Pin::new('B', 6), Pin::new('B', 7)),
    (1, 1 << 3, 1 << 3, Pin::new('D', 5), Pin::new('D', 6)),
    (2, 3 << 4, 1 << 4, Pin::new('C', 10), Pin::new('C', 11)),
    (2, 3 << 4, 3 << 4, Pin::new('D', 8), Pin::new('D', 9)),
];

/// On which pins each USART is now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Places(pub(super) [Serial; USARTS]);

impl Default for Places {
    fn default() -> Self {
        Self::of(0)
    }
}

impl Places {
    /// Returns the places for this value of AFIO_MAPR.
    fn of(mapr: u32) -> Self {
        let mut all = HOMES;
        for (n, field, value, tx, rx) in REMAPS {
            if mapr & field == value {
                (all[n].tx, all[n].rx) = (tx, rx);
            }
        }
        let [.., usart3, uart4] = &mut all;
        uart4.displaced = usart3.tx == uart4.tx;
        Self(all)
    }

    /// Returns the USART whose transmitter is at pin `tx`, and its number from 0.
    fn at(&self, tx: Pin) -> Option<(usize, &Serial)> {
        let mut all = self.0.iter().enumerate();
        all.find(|(_, serial)| serial.tx == tx && !serial.displaced)
    }

    /// Returns USART1 while its RX pin is also a channel of TIM1.
    pub(super) fn captured(&self) -> Option<Serial> {
        Some(self.0[0]).filter(|serial| serial.rx == HOMES[0].rx)
    }
}

/// Finding when a USART is remapped to pins that the part's package does not have.
const NO_PINS: &str = "AFIO_MAPR puts a USART on pins that this part does not have";
/// Finding when UART4 is on while it has no pins.
const DISPLACED: &str = "UART4 is on, but USART3 is remapped to its pins";

/// The channel of TIM1 at the RX pin of USART1.
pub(super) const RX_CAPTURE: usize = 3;

impl<C: Circuit> Soc<C> {
    /// Returns the USART whose transmitter is at pin `tx`; one that is off if there is none.
    #[must_use]
    pub fn usart(&self, tx: Pin) -> &Usart {
        match self.places.at(tx) {
            Some((n, _)) => &self.usarts[n],
            None => &self.absent,
        }
    }

    /// Moves the USARTs to the pins that AFIO_MAPR gives them. Their wires have been computed up to `now`.
    pub(super) fn place_usarts(&mut self, now: Time) {
        let places = Places::of(self.afio.mapr());
        let before = core::mem::replace(&mut self.places, places);
        if before == places {
            return;
        }
        for left in before.0 {
            if places.at(left.tx).is_none()
                && let Some(wire) = self.circuit.wire(left.tx)
            {
                wire.set_tx_pin(TxPin::Level(true), now);
            }
        }
        for (serial, before) in places.0.iter().zip(before.0) {
            if *serial == before {
                continue;
            }
            let pins = self.part.ports[serial.tx.port_index()];
            if [serial.tx, serial.rx].map(|pin| pins >> pin.number() & 1) != [1, 1] {
                self.notes.push((now, What::Other(NO_PINS)));
            }
            let (usart, wire) = self.connection(serial);
            let level = wire.is_none_or(|wire| {
                wire.advance(now);
                wire.take_edges();
                wire.rx_level()
            });
            usart.receive_edge(now, level);
            // No edge for a timer that captures the pin.
            usart.take_edges();
            self.drive_rx(serial, now);
            self.note_due(serial.usart);
        }
        for port in 0..PORTS {
            self.wire_gpio(port, now);
        }
    }

    /// Computes the devices at pins that a USART has left up to `now`.
    pub(super) fn sync_left_wires(&mut self, now: Time) {
        for home in HOMES {
            if self.places.at(home.tx).is_none()
                && let Some(wire) = self.circuit.wire(home.tx)
            {
                self.absent.exchange(wire, now);
            }
        }
    }

    /// Returns a USART and the device that is connected to it.
    fn connection(&mut self, serial: &Serial) -> (&mut Usart, Option<&mut dyn Wire>) {
        let usart = match serial.usart {
            Block::Usart1 => 0,
            Block::Usart2 => 1,
            Block::Usart3 => 2,
            _ => 3,
        };
        let wire = if serial.displaced {
            None
        } else {
            self.circuit.wire(serial.tx)
        };
        (&mut self.usarts[usart], wire)
    }

    /// Computes a USART and its wire up to `now`.
    pub(super) fn sync_wire(&mut self, serial: &Serial, now: Time) {
        match self.connection(serial) {
            (usart, Some(wire)) => usart.exchange(wire, now),
            (usart, None) => {
                usart.advance(now);
                usart.take_sent();
            }
        }
        if self.serve_dma(serial.usart, now)
            && let (usart, Some(wire)) = self.connection(serial)
        {
            usart.pass_sent(wire);
        }
        for (at, text) in self.circuit.take_findings() {
            self.notes.push((at, What::Other(text)));
        }
        if self.circuit.pins_changed() {
            self.refresh(now);
        }
        if self.has_interrupt(serial) {
            self.drive_rx(serial, now);
        }
        self.note_requests(serial.usart);
        self.note_due(serial.usart);
    }

    /// Returns whether edges of the RX pin reach EXTI.
    fn has_interrupt(&self, serial: &Serial) -> bool {
        let line = serial.rx.number();
        self.exti.detects(line) && self.afio.exti_port(line) == serial.rx.port_index()
    }

    /// Returns the instant of the next event in a USART or at its RX pin.
    pub(super) fn next_exchange(&mut self, serial: &Serial) -> Option<Time> {
        let has_interrupt = self.has_interrupt(serial);
        match self.connection(serial) {
            (usart, Some(wire)) => {
                let edge = wire.next_edge().filter(|_| has_interrupt);
                [usart.next_exchange(wire), edge]
                    .into_iter()
                    .flatten()
                    .min()
            }
            (usart, None) => usart.next_event(),
        }
    }

    /// Passes a character that has begun on to the wire, and reports a USART whose receiver is on while its RX pin is
    /// not an input.
    pub(super) fn wire_usart(&mut self, serial: &Serial, now: Time) {
        let port = &self.gpio[serial.rx.port_index()];
        let closed = (port.outputs() | port.analog()) >> serial.rx.number() & 1 != 0;
        let (usart, wire) = self.connection(serial);
        let connected = wire.is_some();
        if serial.displaced && (usart.bit().is_some() || usart.awaits_start()) {
            self.notes.push((now, What::Other(DISPLACED)));
            return;
        }
        if let Some(wire) = wire {
            usart.pass_sent(wire);
        }
        if closed && connected && usart.awaits_start() {
            self.notes.push((now, What::Other(serial.no_input)));
        }
    }

    /// Drives the RX pin, for firmware that reads its level.
    pub(super) fn drive_rx(&mut self, serial: &Serial, now: Time) {
        let (_, Some(wire)) = self.connection(serial) else {
            return;
        };
        let drive = wire.rx_drive();
        self.gpio[serial.rx.port_index()].drive(serial.rx.number(), drive, now);
        self.wire_port(serial.rx.port_index(), now);
    }
}
