//! The session with a debugger. Connecting halts the core. When the debugger detaches or disconnects, the core runs on.

use std::net::TcpStream;

use gdbstub::common::Signal;
use gdbstub::stub::state_machine::GdbStubStateMachine;
use gdbstub::stub::{GdbStub, SingleThreadStopReason};
use sim::Time;

use super::super::scene::Scene;
use super::Message;
use super::wire::Wire;

/// Longest packet of a debugger in bytes. The server asks for packets of at most 4096 bytes; crate gdbstub would keep a
/// packet of any length.
const LONGEST_PACKET: usize = 16 * 1024;

type Machine = GdbStubStateMachine<'static, Scene, Wire>;

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
    pub fn take(&mut self, message: Message, scene: &mut Scene) {
        match message {
            Message::Connected(stream) => self.start(stream, scene),
            // The next bytes are read when the hold is dropped, after these are handled.
            Message::Bytes(bytes, _hold) => {
                for byte in bytes {
                    if self.is_too_long(byte) {
                        self.machine = None;
                    }
                    self.drive(scene, |machine, scene| incoming(machine, byte, scene));
                    self.step_if_wanted(scene);
                }
            }
            Message::Gone => self.machine = None,
        }
        if self.machine.is_none() {
            scene.remove_breakpoints();
        }
    }

    /// Runs the board until `until` or to a breakpoint. Does nothing while the core is halted.
    pub fn run_until(&mut self, until: Time, scene: &mut Scene) {
        if self.machine.is_none() {
            scene.run_until(until);
        } else if !self.halted() && scene.run_debugged(until) {
            self.stopped(scene, SingleThreadStopReason::SwBreak(()));
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

    fn start(&mut self, stream: TcpStream, scene: &mut Scene) {
        self.packet = None;
        // A debugger that has already disconnected, or that cannot be answered, gets no session.
        self.machine = Wire::new(stream)
            .ok()
            .and_then(|wire| GdbStub::new(wire).run_state_machine(scene).ok());
    }

    fn step_if_wanted(&mut self, scene: &mut Scene) {
        if scene.debug.step && self.machine.is_some() && !self.halted() {
            scene.debug.step = false;
            scene.first().step_instruction();
            self.stopped(scene, SingleThreadStopReason::DoneStep);
        }
    }

    /// Reports to the debugger that the core has halted.
    fn stopped(&mut self, scene: &mut Scene, reason: SingleThreadStopReason<u32>) {
        self.drive(scene, |machine, scene| match machine {
            GdbStubStateMachine::Running(running) => running.report_stop(scene, reason).ok(),
            other => Some(other),
        });
    }

    /// Carries out a step of the protocol. Ends the session if the protocol has failed.
    fn drive(
        &mut self,
        scene: &mut Scene,
        step: impl FnOnce(Machine, &mut Scene) -> Option<Machine>,
    ) {
        self.machine = self.machine.take().and_then(|machine| step(machine, scene));
    }
}

/// Passes a byte from the debugger to the protocol. Returns `None` when the session has ended.
fn incoming(machine: Machine, byte: u8, scene: &mut Scene) -> Option<Machine> {
    let next = match machine {
        GdbStubStateMachine::Idle(idle) => idle.incoming_data(scene, byte),
        GdbStubStateMachine::Running(running) => running.incoming_data(scene, byte),
        other => Ok(other),
    };
    match next.ok()? {
        GdbStubStateMachine::CtrlCInterrupt(interrupt) => {
            let reason = SingleThreadStopReason::Signal(Signal::SIGINT);
            interrupt.interrupt_handled(scene, Some(reason)).ok()
        }
        // The debugger detaches or wants to kill the program. Either ends the session, and the unit runs on.
        GdbStubStateMachine::Disconnected(_) => None,
        other => Some(other),
    }
}
