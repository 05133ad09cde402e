//! The receiving side of a module: decides which packets of the air it receives.

use fastrand::Rng;

use super::{Mode, Packet, Parameters, Sender, timing};
use f103::time::Time;

/// Seed of the losses.
const SEED: u64 = 0x6C6F_7261;

/// A packet of another transmitter.
#[derive(Clone, Debug)]
struct Signal {
    packet: Packet,
    /// Probability that this receiver loses the packet.
    loss: f64,
    /// Whether the transmitter lost its power before the end of the packet.
    cut: bool,
    /// Whether the module has decided whether it receives the packet.
    decided: bool,
}

impl Signal {
    /// Returns when the receiver has checked the packet.
    fn checked(&self) -> Time {
        self.packet.end + timing::CHECK
    }
}

/// The packets at the place of a module, and whether its radio receives.
#[derive(Clone, Debug)]
pub(super) struct Antenna {
    /// Packets that can still be received, or overlap one that can.
    signals: Vec<Signal>,
    /// The radio receives since this instant; `None` while it is off or sends.
    listening_since: Option<Time>,
}

impl Antenna {
    /// Returns an antenna of a radio that is off.
    pub(super) const fn off() -> Self {
        Self {
            signals: Vec::new(),
            listening_since: None,
        }
    }

    /// Notes that the radio receives from `at` on, which may be in the future.
    pub(super) fn listen(&mut self, at: Time) {
        self.listening_since = Some(at);
    }

    /// Notes that the radio is off or sends.
    pub(super) fn stop(&mut self) {
        self.listening_since = None;
    }

    /// Adds a packet, with the probability that this receiver loses it. `now` is the time of the module; a packet that
    /// it should have checked before only disturbs others.
    pub(super) fn add(&mut self, packet: &Packet, loss: f64, now: Time) {
        let mut signal = Signal {
            packet: packet.clone(),
            loss,
            cut: false,
            decided: false,
        };
        signal.decided = signal.checked() <= now;
        self.signals.push(signal);
    }

    /// Notes that a packet has ended at `at` because its transmitter has lost its power.
    pub(super) fn cut(&mut self, sender: Sender, number: u64, at: Time) {
        for signal in &mut self.signals {
            if signal.packet.is(sender, number) {
                signal.cut = true;
                signal.packet.end = signal.packet.end.min(at);
            }
        }
    }

    /// Returns the instant at which the next packet is checked.
    pub(super) fn next_event(&self) -> Option<Time> {
        let open = self.signals.iter().filter(|signal| !signal.decided);
        open.map(Signal::checked).min()
    }

    /// Returns the next packet that `receiver`, in this mode and with these parameters, has received by `now`. Call
    /// this again until it returns `None`.
    pub(super) fn receive(
        &mut self,
        receiver: Sender,
        mode: Option<Mode>,
        parameters: Parameters,
        now: Time,
    ) -> Option<Packet> {
        loop {
            let due = |signal: &Signal| !signal.decided && signal.checked() <= now;
            let Some(n) = self.signals.iter().position(due) else {
                self.forget(now);
                return None;
            };
            self.signals[n].decided = true;
            let signal = &self.signals[n];
            if self.is_received(signal, receiver, mode, parameters) {
                return Some(signal.packet.clone());
            }
        }
    }

    fn is_received(
        &self,
        signal: &Signal,
        receiver: Sender,
        mode: Option<Mode>,
        parameters: Parameters,
    ) -> bool {
        let Signal { packet, loss, .. } = signal;
        let woken = match mode {
            Some(Mode::Normal | Mode::WakeUp) => true,
            Some(Mode::PowerSaving) => packet.wake_up >= parameters.wake_up(),
            Some(Mode::Sleep) | None => false,
        };
        let listened = self
            .listening_since
            .is_some_and(|since| since <= packet.start);
        let mut others = self.signals.iter().map(|other| &other.packet);
        woken
            && listened
            && !signal.cut
            && parameters.receive(packet.parameters)
            && !others.any(|other| packet.collides_with(other))
            && !(*loss > 0.0 && lot(packet, receiver) < *loss)
    }

    /// Receives none of the packets that have begun by `now`.
    pub(super) fn ignore(&mut self, now: Time) {
        for signal in &mut self.signals {
            signal.decided |= signal.packet.start <= now;
        }
        self.forget(now);
    }

    /// Drops the packets that overlap nothing that can still be received.
    fn forget(&mut self, now: Time) {
        let open = self.signals.iter().filter(|signal| !signal.decided);
        let needed = open.map(|signal| signal.packet.start).fold(now, Time::min);
        // A packet that begins now may become known later.
        let needed = needed.saturating_sub(timing::CHECK);
        self.signals
            .retain(|signal| !signal.decided || signal.packet.end > needed);
    }
}

/// Returns a random number from 0 to 1 that depends only on the packet and its receiver, so that the order of the
/// packets does not matter.
fn lot(packet: &Packet, receiver: Sender) -> f64 {
    let who = packet.sender.code() << 20 | receiver.code();
    Rng::with_seed(SEED ^ who << 24 ^ packet.number).f64()
}
