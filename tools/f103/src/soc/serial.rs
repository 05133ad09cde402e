//! The USARTs, their pins, and the devices that are connected to them.

use super::Soc;
use super::circuit::{Circuit, PORTS, Pin};
use super::map::Block;
use crate::finding::What;
use crate::periph::usart::{Usart, Wire};
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

/// The USARTs that are modelled.
pub(super) const SERIALS: [Serial; 4] = [
    Serial {
        usart: Block::Usart1,
        tx: Pin::new('A', 9),
        rx: Pin::new('A', 10),
        no_input: "USART1 receives, but its RX pin is not a digital input",
    },
    Serial {
        usart: Block::Usart2,
        tx: Pin::new('A', 2),
        rx: Pin::new('A', 3),
        no_input: "USART2 receives, but its RX pin is not a digital input",
    },
    Serial {
        usart: Block::Usart3,
        tx: Pin::new('B', 10),
        rx: Pin::new('B', 11),
        no_input: "USART3 receives, but its RX pin is not a digital input",
    },
    Serial {
        usart: Block::Uart4,
        tx: Pin::new('C', 10),
        rx: Pin::new('C', 11),
        no_input: "UART4 receives, but its RX pin is not a digital input",
    },
];

/// The USART whose RX pin is also a channel of TIM1.
pub(super) const CAPTURED: &Serial = &SERIALS[0];
/// The channel of TIM1 at this pin.
pub(super) const RX_CAPTURE: usize = 3;

impl<C: Circuit> Soc<C> {
    /// Returns the USART whose transmitter is at pin `tx`.
    ///
    /// # Panics
    ///
    /// If there is no such USART.
    #[must_use]
    pub fn usart(&self, tx: Pin) -> &Usart {
        let n = SERIALS.iter().position(|serial| serial.tx == tx);
        &self.usarts[n.expect("a USART has its transmitter at this pin")]
    }

    /// Returns a USART and the device that is connected to it.
    fn connection(&mut self, serial: &Serial) -> (&mut Usart, Option<&mut dyn Wire>) {
        let usart = match serial.usart {
            Block::Usart1 => 0,
            Block::Usart2 => 1,
            Block::Usart3 => 2,
            _ => 3,
        };
        (&mut self.usarts[usart], self.circuit.wire(serial.tx))
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
}
