//! The session with a debugger. Connecting halts the core. When the debugger detaches or disconnects, the core runs on.

use std::net::TcpStream;

use gdbstub::common::Signal;
use gdbstub::stub::state_machine::GdbStubStateMachine;
use gdbstub::stub::{GdbStub, SingleThreadStopReason};
use sim::Time;

use super::super::bench::Bench;
use super::Message;
use super::wire::Wire;

/// Longest packet of a debugger in bytes. The server asks for packets of at most 4096 bytes; crate gdbstub would keep a
/// packet of any length.
const LONGEST_PACKET: usize = 16 * 1024;

type Machine = GdbStubStateMachine<'static, Bench, Wire>;

/// The session with the debugger, if one is connected.
#[derive(Default)]
pub struct Session {
    machine: Option<Machine>,
    /// Length of the packet that the debugger has begun, so far; `None` between two packets.
    packet: Option<usize>,
}

impl Session {
    /// Returns whether the debugger has halted the core. Virtual time stands still then.
    pub fn halted(&self) -> bool {
        !matches!(self.machine, None | Some(GdbStubStateMachine::Running(_)))
    }

    /// Handles a message from the debugger's thread.
    pub fn take(&mut self, message: Message, bench: &mut Bench) {
        match message {
            Message::Connected(stream) => self.start(stream, bench),
            // The next bytes are read when the hold is dropped, after these are handled.
            Message::Bytes(bytes, _hold) => {
                for byte in bytes {
                    if self.is_too_long(byte) {
                        self.machine = None;
                    }
                    self.drive(bench, |machine, bench| incoming(machine, byte, bench));
                    self.step_if_wanted(bench);
                }
            }
            Message::Gone => self.machine = None,
        }
        if self.machine.is_none() {
            bench.remove_breakpoints();
        }
    }

    /// Runs the board until `until` or to a breakpoint. Does nothing while the core is halted.
    pub fn run_until(&mut self, until: Time, bench: &mut Bench) {
        if self.machine.is_none() {
            bench.run_until(until);
        } else if !self.halted() && bench.run_debugged(until) {
            self.stopped(bench, SingleThreadStopReason::SwBreak(()));
        }
    }

    /// Counts the bytes of a packet. Returns whether this byte makes it too long.
    fn is_too_long(&mut self, byte: u8) -> bool {
        self.packet = match (self.packet, byte) {
            (_, b'#') => None,
            (None, b'$') => Some(1),
            (length, _) => length.map(|length| length + 1),
        };
        self.packet.is_some_and(|length| length > LONGEST_PACKET)
    }

    fn start(&mut self, stream: TcpStream, bench: &mut Bench) {
        self.packet = None;
        // A debugger that has already disconnected, or that cannot be answered, gets no session.
        self.machine = Wire::new(stream)
            .ok()
            .and_then(|wire| GdbStub::new(wire).run_state_machine(bench).ok());
    }

    fn step_if_wanted(&mut self, bench: &mut Bench) {
        if bench.debug.step && self.machine.is_some() && !self.halted() {
            bench.debug.step = false;
            bench.first().step_instruction();
            self.stopped(bench, SingleThreadStopReason::DoneStep);
        }
    }

    /// Reports to the debugger that the core has halted.
    fn stopped(&mut self, bench: &mut Bench, reason: SingleThreadStopReason<u32>) {
        self.drive(bench, |machine, bench| match machine {
            GdbStubStateMachine::Running(running) => running.report_stop(bench, reason).ok(),
            other => Some(other),
        });
    }

    /// Carries out a step of the protocol. Ends the session if the protocol has failed.
    fn drive(
        &mut self,
        bench: &mut Bench,
        step: impl FnOnce(Machine, &mut Bench) -> Option<Machine>,
    ) {
        self.machine = self.machine.take().and_then(|machine| step(machine, bench));
    }
}

/// Passes a byte from the debugger to the protocol. Returns `None` when the session has ended.
fn incoming(machine: Machine, byte: u8, bench: &mut Bench) -> Option<Machine> {
    let next = match machine {
        GdbStubStateMachine::Idle(idle) => idle.incoming_data(bench, byte),
        GdbStubStateMachine::Running(running) => running.incoming_data(bench, byte),
        other => Ok(other),
    };
    match next.ok()? {
        GdbStubStateMachine::CtrlCInterrupt(interrupt) => {
            let reason = SingleThreadStopReason::Signal(Signal::SIGINT);
            interrupt.interrupt_handled(bench, Some(reason)).ok()
        }
        // The debugger detaches or wants to kill the program. Either ends the session, and the unit runs on.
        GdbStubStateMachine::Disconnected(_) => None,
        other => Some(other),
    }
}
