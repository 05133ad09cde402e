//! A debugger's session: from its connection, which halts the core, until it goes and the core runs on.

use std::net::TcpStream;

use gdbstub::common::Signal;
use gdbstub::stub::state_machine::GdbStubStateMachine;
use gdbstub::stub::{GdbStub, SingleThreadStopReason};
use sim::Time;

use super::super::bench::Bench;
use super::Message;
use super::wire::Wire;

type Machine = GdbStubStateMachine<'static, Bench, Wire>;

/// The debugger, if one is there.
#[derive(Default)]
pub struct Session {
    machine: Option<Machine>,
}

impl Session {
    /// Whether the debugger has the core halted: then time stands still.
    pub fn halted(&self) -> bool {
        !matches!(self.machine, None | Some(GdbStubStateMachine::Running(_)))
    }

    /// Takes up what came from the debugger.
    pub fn take(&mut self, message: Message, bench: &mut Bench) {
        match message {
            Message::Connected(stream) => self.start(stream, bench),
            Message::Bytes(bytes) => {
                for byte in bytes {
                    self.drive(bench, |machine, bench| incoming(machine, byte, bench));
                    self.step_if_wanted(bench);
                }
            }
            Message::Gone => self.machine = None,
        }
        if self.machine.is_none() {
            bench.forget_breakpoints();
        }
    }

    /// Runs the board to `until`, or to a breakpoint; not at all while it is halted.
    pub fn run_until(&mut self, until: Time, bench: &mut Bench) {
        if self.machine.is_none() {
            bench.run_until(until);
        } else if !self.halted() && bench.run_debugged(until) {
            self.stopped(bench, SingleThreadStopReason::SwBreak(()));
        }
    }

    fn start(&mut self, stream: TcpStream, bench: &mut Bench) {
        // A debugger that has gone already gets no session, nor does one that cannot be answered.
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

    /// Moves the protocol on. A debugger that cannot be understood or answered has gone.
    fn drive(
        &mut self,
        bench: &mut Bench,
        step: impl FnOnce(Machine, &mut Bench) -> Option<Machine>,
    ) {
        self.machine = self.machine.take().and_then(|machine| step(machine, bench));
    }
}

/// One byte from the debugger.
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
        // It detaches, or would kill the program, which a unit does not let happen.
        GdbStubStateMachine::Disconnected(_) => None,
        other => Some(other),
    }
}
