//! The LoRa module of a board, at the pins of USART3.
//!
//! The module of a single board has the air with the gateway beside it, and both are computed together. On a bus with
//! several boards the air belongs to the [bus](crate::bus), which passes the packets on.

use crate::radio::{Air, Module, Parameters, Sender, tell};
use f103::corner::Corner;
use f103::periph::gpio::{Drive, Gpio};
use f103::periph::usart::{Sent, TxPin, Wire};
use f103::soc::{Pin, Pins};
use f103::time::Time;

/// Pins of the LoRa module, besides those of USART3.
#[derive(Clone, Copy, Debug)]
pub struct RadioPins {
    /// M0, an output of the part.
    pub m0: Pin,
    /// M1, an output of the part.
    pub m1: Pin,
    /// AUX, an input of the part.
    pub aux: Pin,
}

/// The module of a board, and the air while the board is alone.
#[derive(Clone, Debug)]
pub struct Radio {
    /// The module.
    pub module: Module,
    pub(crate) air: Option<Air>,
    /// How the module drove AUX when the part has last taken it over.
    aux: Drive,
}

impl Radio {
    /// Returns a module without power, which keeps `stored`, and the air.
    #[must_use]
    pub fn new(stored: Parameters, corner: Corner) -> Self {
        Self {
            module: Module::new(Sender::Board(0), stored, corner),
            air: Some(Air::new(0, Time::ZERO, corner)),
            aux: Drive::Floating,
        }
    }

    /// Makes the module that of board `n` on a bus with several boards. The air belongs to the bus from now on.
    pub(crate) fn join(&mut self, n: u16) {
        self.module.sender = Sender::Board(n);
        self.air = None;
        self.module.take_news();
    }

    /// Drives the pins of the module, except RXD and TXD.
    pub(super) fn drive(&self, at: &RadioPins, pins: &mut Pins) {
        // The module has weak pull-ups at its inputs.
        let input = match self.module.is_there() {
            true => Drive::PullUp,
            false => Drive::Floating,
        };
        pins.drive(at.m0, input);
        pins.drive(at.m1, input);
        pins.drive(at.aux, self.module.drive_aux());
    }

    /// Takes over the levels of M0 and M1 after an access to `port`. Returns whether the mode of the pins has changed.
    pub(super) fn port_changed(
        &mut self,
        at: &RadioPins,
        port: char,
        gpio: &Gpio,
        now: Time,
    ) -> bool {
        if port != at.m0.port() {
            return false;
        }
        self.advance(now);
        let level = |pin: Pin| gpio.level() >> pin.number() & 1 != 0;
        self.module.set_pins(level(at.m0), level(at.m1))
    }

    /// Switches the supply of the module.
    pub(super) fn set_power(&mut self, on: bool, now: Time) {
        self.advance(now);
        self.module.set_power(on);
    }

    /// Returns whether the module drives AUX in another way than at the last call.
    pub(super) fn aux_changed(&mut self) -> bool {
        let aux = self.module.drive_aux();
        core::mem::replace(&mut self.aux, aux) != aux
    }

    /// Returns whether the module or the air has news for the other.
    fn has_news(&self) -> bool {
        self.module.has_news() || self.air.as_ref().is_some_and(Air::has_news)
    }

    /// Passes packets on between the module and the air of a single board.
    fn exchange(&mut self) {
        let Some(air) = &mut self.air else {
            return;
        };
        for news in self.module.take_news() {
            air.take_of_board(0, &news);
        }
        for (news, loss) in air.take_news() {
            tell(&mut self.module, &news, loss);
        }
    }
}

impl Wire for Radio {
    fn sent(&mut self, sent: Sent) {
        self.module.uart_mut().put_in(sent);
        // The start bit may begin now.
        self.advance(self.module.now());
    }

    fn set_tx_pin(&mut self, pin: TxPin, now: Time) {
        let now = now.max(self.module.now());
        self.module.uart_mut().set_pin(pin, now);
    }

    fn advance(&mut self, to: Time) {
        if self.has_news() {
            self.exchange();
        }
        while let Some(at) = self.next_event().filter(|&at| at <= to) {
            self.module.advance(at);
            if let Some(air) = &mut self.air {
                air.advance(at);
            }
            self.exchange();
        }
        self.module.advance(to);
        if let Some(air) = &mut self.air {
            air.advance(to);
        }
    }

    fn now(&self) -> Time {
        self.module.now()
    }

    fn next_event(&self) -> Option<Time> {
        let air = self.air.as_ref().and_then(Air::next_event);
        [self.module.next_event(), air].into_iter().flatten().min()
    }

    fn take_edges(&mut self) -> Vec<(Time, bool)> {
        let now = self.module.now();
        self.module.uart_mut().take_edges(now)
    }

    fn next_edge(&self) -> Option<Time> {
        let edge = self.module.uart().next_edge();
        edge.map(|at| at.max(self.module.now()))
    }

    fn has_edges(&self) -> bool {
        self.next_edge().is_some_and(|at| at <= self.module.now())
    }

    fn rx_level(&self) -> bool {
        self.module.uart().txd(self.module.now())
    }

    fn rx_drive(&self) -> Drive {
        match (self.module.is_there(), self.rx_level()) {
            (false, _) => Drive::Floating,
            (true, true) => Drive::High,
            (true, false) => Drive::Low,
        }
    }
}
