//! The I2C master's sequence: start, address, bytes, stop, one SCL bit time at a time (RM0008 26.3.3).
//!
//! The block stretches the clock where the manual says so: the transfer waits for the program.

use super::I2c;
use super::bits::{cr1, sr1, sr2};
use super::bus::{Bus, Wires};
use crate::time::Time;

/// State of the sequence. A state with an end takes time; every other state waits for the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Not the bus's master.
    Idle,
    /// A start or repeated start condition is being made.
    Start,
    /// SB: the address byte is awaited.
    Started,
    /// An address byte is being sent.
    Address(u8),
    /// ADDR: stretched until it is cleared; `true` = as a receiver.
    Addressed(bool),
    /// A data byte is being sent.
    Send(u8),
    /// Stretched: the next byte to send is awaited.
    SendWait,
    /// A byte is being received. `ack` is the acknowledge when POS selects it.
    Receive {
        /// Value of ACK when the byte began.
        ack: bool,
    },
    /// Stretched: a received byte waits in the shift register until DR is read.
    ReceiveWait,
    /// A byte was not acknowledged, by either side: a stop or start is awaited.
    Over,
    /// A stop condition is being made.
    Stop,
}

impl I2c {
    /// Runs the block and the bus up to `now`, in order; this replaces `advance(now)`. Call it before each access,
    /// at each event, and when a wire of the bus changes.
    pub fn exchange(&mut self, bus: &mut dyn Bus, now: Time) {
        self.look(bus.wires(), now);
        while let Some(due) = self.due.filter(|&due| due <= now) {
            self.due = None;
            if self.stretched_by_others() {
                // 26.3.3: a slave may stretch the clock; the bit continues when the slave releases it.
                self.stalled = true;
                break;
            }
            self.step(bus, due);
            self.look(bus.wires(), due);
        }
        self.begin(now);
    }

    /// Returns whether a held wire delays the end of the current state, or pins that are not in alternate open drain.
    fn stretched_by_others(&self) -> bool {
        !self.connected
            || !self.wires.scl
            || (matches!(self.phase, Phase::Stop | Phase::Start) && !self.wires.sda)
    }

    /// Samples the wires: BUSY is set by any low level and cleared by a stop condition (26.6.7).
    pub(super) fn look(&mut self, lines: Wires, now: Time) {
        // An edge on a wire unlocks its filter (errata sheet, 2.13.7).
        self.filters.scl |= lines.scl != self.lines.scl;
        self.filters.sda |= lines.sda != self.lines.sda;
        self.lines = lines;
        let wires = Wires {
            scl: lines.scl && self.filters.scl,
            sda: lines.sda && self.filters.sda,
        };
        if wires != Wires::FREE {
            self.busy = true;
        }
        let stop = !self.latched && self.wires.scl && wires.scl && !self.wires.sda && wires.sda;
        if stop && self.phase == Phase::Idle {
            self.busy = false;
        }
        self.wires = wires;
        if self.stalled && !self.stretched_by_others() {
            self.stalled = false;
            self.due = Some(now + self.bits(1));
        }
    }

    /// Starts what the program has requested, if that can start now.
    pub(super) fn begin(&mut self, now: Time) {
        if self.due.is_some() || self.stalled || self.cr1 & cr1::PE == 0 || !self.connected {
            return;
        }
        let stop = self.cr1 & cr1::STOP != 0;
        let start = self.cr1 & cr1::START != 0;
        match self.phase {
            Phase::Idle if start && !self.busy => self.enter(Phase::Start, 1, now),
            Phase::Started | Phase::SendWait | Phase::ReceiveWait | Phase::Over if stop => {
                self.enter(Phase::Stop, 1, now);
            }
            Phase::SendWait | Phase::ReceiveWait | Phase::Over if start => {
                self.enter(Phase::Start, 1, now);
            }
            _ => {}
        }
    }

    /// Enters `phase`, which takes `bits` bit times from `now`.
    fn enter(&mut self, phase: Phase, bits: u64, now: Time) {
        self.phase = phase;
        self.due = Some(now + self.bits(bits));
    }

    /// Ends the current state at `at`.
    fn step(&mut self, bus: &mut dyn Bus, at: Time) {
        match self.phase {
            Phase::Start => {
                self.cr1 &= !cr1::START;
                self.sr1 = self.sr1 & !(sr1::TXE | sr1::BTF) | sr1::SB;
                self.sr2 = sr2::MSL;
                self.busy = true;
                self.phase = Phase::Started;
            }
            Phase::Address(byte) => self.addressed(byte, bus, at),
            Phase::Send(byte) => self.sent(byte, bus, at),
            Phase::Receive { ack } => self.received(ack, bus, at),
            Phase::Stop => {
                bus.stop(at);
                self.cr1 &= !cr1::STOP;
                self.sr1 &= !(sr1::TXE | sr1::BTF | sr1::SB | sr1::ADDR);
                self.sr2 = 0;
                self.phase = Phase::Idle;
                self.busy = self.latched || self.wires != Wires::FREE;
            }
            // The other states wait for the program and have no end.
            _ => {}
        }
        self.begin(at);
    }

    /// Handles the loss of arbitration: `byte` contains a one while the data wire is held low (26.3.4). Returns
    /// whether the master has lost.
    fn loses(&mut self, byte: u8) -> bool {
        let lost = !self.wires.sda && byte != 0;
        if lost {
            self.sr1 |= sr1::ARLO;
            self.sr2 = 0;
            self.phase = Phase::Idle;
        }
        lost
    }

    fn addressed(&mut self, byte: u8, bus: &mut dyn Bus, at: Time) {
        if self.loses(byte) {
            return;
        }
        // A wire held low reads as an acknowledge.
        if bus.address(byte, at) || !self.wires.sda {
            self.sr1 |= sr1::ADDR;
            let receiver = byte & 1 == 1;
            if !receiver {
                self.sr2 |= sr2::TRA;
                self.sr1 |= sr1::TXE;
            }
            self.phase = Phase::Addressed(receiver);
        } else {
            self.sr1 |= sr1::AF;
            self.phase = Phase::Over;
        }
    }

    fn sent(&mut self, byte: u8, bus: &mut dyn Bus, at: Time) {
        if self.loses(byte) {
            return;
        }
        if !bus.write(byte, at) && self.wires.sda {
            self.sr1 |= sr1::AF;
            self.phase = Phase::Over;
            return;
        }
        self.phase = Phase::SendWait;
        if self.cr1 & cr1::STOP == 0 && self.cr1 & cr1::START == 0 {
            self.send_next(at);
        }
        if self.phase == Phase::SendWait && self.pending.is_none() {
            self.sr1 |= sr1::BTF;
        }
    }

    /// Moves the byte in DR, if any, to the shift register.
    pub(super) fn send_next(&mut self, now: Time) {
        if let Some(byte) = self.pending.take() {
            self.sr1 = self.sr1 & !sr1::BTF | sr1::TXE;
            self.enter(Phase::Send(byte), 9, now);
        }
    }

    fn received(&mut self, began_with_ack: bool, bus: &mut dyn Bus, at: Time) {
        let byte = if self.wires.sda { bus.read(at) } else { 0 };
        // 26.6.1, POS: ACK applies to the byte under way, or to the byte after it.
        let ack = if self.cr1 & cr1::POS == 0 {
            self.cr1 & cr1::ACK != 0
        } else {
            began_with_ack
        };
        let full = self.sr1 & sr1::RXNE != 0;
        if full {
            self.behind = Some(byte);
            self.sr1 |= sr1::BTF;
        } else {
            self.data = byte;
            self.sr1 |= sr1::RXNE;
        }
        let leaves = self.cr1 & (cr1::STOP | cr1::START) != 0;
        if !ack {
            self.phase = Phase::Over;
        } else if full || leaves {
            self.phase = Phase::ReceiveWait;
        } else {
            self.receive_next(at);
        }
    }

    /// Starts the reception of the next byte.
    pub(super) fn receive_next(&mut self, now: Time) {
        let ack = self.cr1 & cr1::ACK != 0;
        self.enter(Phase::Receive { ack }, 9, now);
    }
}
