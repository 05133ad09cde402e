//! A module with a host at its pins, as the part on a board is.

use crate::board::Radio;
use crate::radio::{Air, Mode, Module, Parameters, timing};
use f103::corner::Corner;
use f103::periph::usart::{Sent, TxPin, Wire};
use f103::serial::{Character, Format, Framing, Receiver, Settings, Wave};
use f103::time::Time;

/// A board's module, alone on the air with the gateway, and a host that drives its pins.
pub struct Host {
    pub radio: Radio,
    pub settings: Settings,
    txd: Wave,
    receiver: Receiver,
    queued_until: Time,
    /// Levels of AUX with the instants of their edges.
    pub aux: Vec<(Time, bool)>,
}

/// A byte at TXD: the byte, its start and its end.
pub type Received = (u8, Time, Time);

impl Host {
    /// Returns a module with the factory parameters and its power on, in sleep.
    pub fn in_sleep() -> Self {
        let mut host = Self::off(Parameters::FACTORY);
        host.radio.module.set_power(true);
        host.run_for(timing::START_UP + Time::from_ms(1));
        assert_eq!(host.module().mode(), Some(Mode::Sleep));
        host
    }

    /// Returns a module with these parameters and its power on, in normal mode.
    pub fn in_normal_mode(parameters: Parameters) -> Self {
        let mut host = Self::off(parameters);
        host.radio.module.set_pins(false, false);
        host.radio.module.set_power(true);
        host.run_for(timing::START_UP + Time::from_ms(10));
        assert_eq!(host.module().mode(), Some(Mode::Normal));
        host.settings = parameters.uart();
        host
    }

    /// Returns a module without power.
    pub fn off(stored: Parameters) -> Self {
        let mut radio = Radio::new(stored, Corner::Nominal);
        radio.set_tx_pin(TxPin::Usart, Time::ZERO);
        Self {
            radio,
            settings: Settings {
                baud: 9600,
                format: Format::N1,
            },
            txd: Wave::default(),
            receiver: Receiver::default(),
            queued_until: Time::ZERO,
            aux: Vec::new(),
        }
    }

    pub fn module(&self) -> &Module {
        &self.radio.module
    }

    pub fn air(&mut self) -> &mut Air {
        self.radio.air.as_mut().expect("the module is alone")
    }

    pub fn now(&self) -> Time {
        self.radio.now()
    }

    /// Sets M0 and M1 now.
    pub fn set_pins(&mut self, m0: bool, m1: bool) {
        self.radio.module.set_pins(m0, m1);
    }

    /// Sends bytes without gaps, from now on or after those that are still queued. Returns the end of the last stop
    /// bit.
    pub fn send(&mut self, bytes: &[u8]) -> Time {
        let first = self.queued_until.max(self.now());
        for (&byte, n) in bytes.iter().zip(0..) {
            let start = first + self.settings.characters(n);
            let character = Character::new(self.settings, byte).at(start);
            self.radio.sent(Sent::Character(character));
        }
        self.queued_until = first + self.settings.characters(bytes.len() as u64);
        self.queued_until
    }

    /// Runs until `to`, event by event.
    pub fn run_until(&mut self, to: Time) {
        loop {
            let next = self.radio.next_event().filter(|&at| at < to);
            let at = next.unwrap_or(to);
            self.radio.advance(at);
            for (at, level) in self.radio.take_edges() {
                self.txd.push(at, level);
            }
            let aux = self.module().aux();
            if self.aux.last().is_none_or(|&(_, last)| last != aux) {
                self.aux.push((at, aux));
            }
            if next.is_none() {
                return;
            }
        }
    }

    pub fn run_for(&mut self, span: Time) {
        self.run_until(self.now() + span);
    }

    /// Returns the bytes that were received since the last call.
    pub fn received(&mut self) -> Vec<Received> {
        let framing = Framing::of(self.settings);
        let now = self.now();
        let (receiver, txd) = (&mut self.receiver, &self.txd);
        std::iter::from_fn(|| receiver.next_word(txd, &framing, now))
            .map(|word| {
                assert!(!word.framing_error && !word.parity_error, "{word:?}");
                (framing.payload(word.data) as u8, word.start, word.end)
            })
            .collect()
    }

    /// Sends a command and returns its answer.
    pub fn command(&mut self, command: &[u8]) -> Vec<u8> {
        let end = self.send(command);
        self.run_until(end + Time::from_ms(150));
        bytes(&self.received())
    }

    /// Returns the instants of the edges of AUX from `from` on.
    pub fn aux_since(&self, from: Time) -> Vec<(Time, bool)> {
        let edges = self.aux.iter().copied();
        edges.filter(|&(at, _)| at >= from).collect()
    }
}

/// Returns the bytes without their times.
pub fn bytes(received: &[Received]) -> Vec<u8> {
    received.iter().map(|&(byte, ..)| byte).collect()
}

/// Returns whether two instants differ by rounding only.
pub fn near(a: Time, b: Time) -> bool {
    a.max(b) - a.min(b) < Time::from_ns(1)
}

pub fn ms(n: u64) -> Time {
    Time::from_ms(n)
}
