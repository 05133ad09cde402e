//! The board as a target of gdbstub: a core with registers, memory and breakpoints.

use core::convert::Infallible;

use gdbstub::arch::{Arch, Registers};
use gdbstub::common::Signal;
use gdbstub::outputln;
use gdbstub::target::ext::base::BaseOps;
use gdbstub::target::ext::base::singlethread::{
    SingleThreadBase, SingleThreadResume, SingleThreadResumeOps, SingleThreadSingleStep,
    SingleThreadSingleStepOps,
};
use gdbstub::target::ext::breakpoints::{
    Breakpoints, BreakpointsOps, HwBreakpoint, HwBreakpointOps, SwBreakpoint, SwBreakpointOps,
};
use gdbstub::target::ext::monitor_cmd::{ConsoleOutput, MonitorCmd, MonitorCmdOps};
use gdbstub::target::{Target, TargetError, TargetResult};

use super::super::scene::Scene;

/// Number of registers that GDB gets, in the order of [`CortexM::target_description_xml`] and of
/// [`sim::Chip::register`].
const REGISTERS: usize = 23;
/// Most breakpoints that are in force at the same time.
const BREAKPOINTS: usize = 1000;
/// Number of the program counter.
const PC: usize = 15;

/// The orders of the debugger.
#[derive(Debug, Default)]
pub struct Debug {
    /// Whether the core must execute one instruction and halt.
    pub step: bool,
    /// Addresses of the breakpoints in force.
    breakpoints: Vec<u32>,
}

/// The architecture of the Cortex-M3. The crate gdbstub_arch has none with an M profile.
#[derive(Debug)]
pub enum CortexM {}

impl Arch for CortexM {
    type Usize = u32;
    type Registers = CoreRegisters;
    type BreakpointKind = usize;
    type RegId = ();

    fn target_description_xml() -> Option<&'static str> {
        Some(concat!(
            r#"<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd"><target version="1.0">"#,
            r#"<architecture>arm</architecture><feature name="org.gnu.gdb.arm.m-profile">"#,
            r#"<reg name="r0" bitsize="32"/><reg name="r1" bitsize="32"/><reg name="r2" bitsize="32"/>"#,
            r#"<reg name="r3" bitsize="32"/><reg name="r4" bitsize="32"/><reg name="r5" bitsize="32"/>"#,
            r#"<reg name="r6" bitsize="32"/><reg name="r7" bitsize="32"/><reg name="r8" bitsize="32"/>"#,
            r#"<reg name="r9" bitsize="32"/><reg name="r10" bitsize="32"/><reg name="r11" bitsize="32"/>"#,
            r#"<reg name="r12" bitsize="32"/><reg name="sp" bitsize="32" type="data_ptr"/>"#,
            r#"<reg name="lr" bitsize="32"/><reg name="pc" bitsize="32" type="code_ptr"/>"#,
            r#"<reg name="xpsr" bitsize="32"/></feature><feature name="org.gnu.gdb.arm.m-system">"#,
            r#"<reg name="msp" bitsize="32" type="data_ptr"/><reg name="psp" bitsize="32" type="data_ptr"/>"#,
            r#"<reg name="primask" bitsize="32"/><reg name="basepri" bitsize="32"/>"#,
            r#"<reg name="faultmask" bitsize="32"/><reg name="control" bitsize="32"/></feature></target>"#,
        ))
    }
}

/// The values of the core's registers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoreRegisters([u32; REGISTERS]);

impl Registers for CoreRegisters {
    type ProgramCounter = u32;

    fn pc(&self) -> u32 {
        self.0[PC]
    }

    fn gdb_serialize(&self, mut write_byte: impl FnMut(Option<u8>)) {
        for byte in self.0.iter().flat_map(|register| register.to_le_bytes()) {
            write_byte(Some(byte));
        }
    }

    fn gdb_deserialize(&mut self, bytes: &[u8]) -> Result<(), ()> {
        let (words, rest) = bytes.as_chunks::<4>();
        if words.len() != REGISTERS || !rest.is_empty() {
            return Err(());
        }
        for (register, word) in self.0.iter_mut().zip(words) {
            *register = u32::from_le_bytes(*word);
        }
        Ok(())
    }
}

impl Scene {
    /// Removes every breakpoint.
    pub fn remove_breakpoints(&mut self) {
        for address in core::mem::take(&mut self.debug.breakpoints) {
            self.first().remove_breakpoint(address);
        }
    }

    fn add_breakpoint(&mut self, address: u32) -> bool {
        if self.debug.breakpoints.len() >= BREAKPOINTS {
            return false;
        }
        self.first().add_breakpoint(address);
        self.debug.breakpoints.push(address);
        true
    }

    fn remove_breakpoint(&mut self, address: u32) -> bool {
        let breakpoints = &mut self.debug.breakpoints;
        let Some(at) = breakpoints.iter().position(|set| *set == address) else {
            return false;
        };
        breakpoints.swap_remove(at);
        self.first().remove_breakpoint(address);
        true
    }
}

impl Target for Scene {
    type Arch = CortexM;
    type Error = Infallible;

    fn base_ops(&mut self) -> BaseOps<'_, CortexM, Infallible> {
        BaseOps::SingleThread(self)
    }

    fn support_breakpoints(&mut self) -> Option<BreakpointsOps<'_, Self>> {
        Some(self)
    }

    fn support_monitor_cmd(&mut self) -> Option<MonitorCmdOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadBase for Scene {
    fn read_registers(&mut self, registers: &mut CoreRegisters) -> TargetResult<(), Self> {
        for (number, register) in registers.0.iter_mut().enumerate() {
            *register = self
                .bus
                .board(0)
                .register(number)
                .ok_or(TargetError::NonFatal)?;
        }
        Ok(())
    }

    fn write_registers(&mut self, registers: &CoreRegisters) -> TargetResult<(), Self> {
        for (number, value) in registers.0.into_iter().enumerate() {
            // Write only registers that change: SP is another name of MSP or PSP, and would overwrite a change of it.
            if self.bus.board(0).register(number) != Some(value) {
                self.first()
                    .set_register(number, value)
                    .map_err(|_| TargetError::NonFatal)?;
            }
        }
        Ok(())
    }

    fn read_addrs(&mut self, address: u32, bytes: &mut [u8]) -> TargetResult<usize, Self> {
        match self.first().read_memory(address, bytes) {
            0 if !bytes.is_empty() => Err(TargetError::NonFatal),
            read => Ok(read),
        }
    }

    fn write_addrs(&mut self, address: u32, bytes: &[u8]) -> TargetResult<(), Self> {
        self.first()
            .write_memory(address, bytes)
            .map_err(|_| TargetError::NonFatal)
    }

    fn support_resume(&mut self) -> Option<SingleThreadResumeOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadResume for Scene {
    fn resume(&mut self, _signal: Option<Signal>) -> Result<(), Infallible> {
        self.debug.step = false;
        self.first().pass_breakpoint();
        Ok(())
    }

    fn support_single_step(&mut self) -> Option<SingleThreadSingleStepOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadSingleStep for Scene {
    fn step(&mut self, _signal: Option<Signal>) -> Result<(), Infallible> {
        self.debug.step = true;
        Ok(())
    }
}

impl Breakpoints for Scene {
    fn support_sw_breakpoint(&mut self) -> Option<SwBreakpointOps<'_, Self>> {
        Some(self)
    }

    fn support_hw_breakpoint(&mut self) -> Option<HwBreakpointOps<'_, Self>> {
        Some(self)
    }
}

impl SwBreakpoint for Scene {
    fn add_sw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        Ok(self.add_breakpoint(address))
    }

    fn remove_sw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        Ok(self.remove_breakpoint(address))
    }
}

impl HwBreakpoint for Scene {
    fn add_hw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        Ok(self.add_breakpoint(address))
    }

    fn remove_hw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        Ok(self.remove_breakpoint(address))
    }
}

impl MonitorCmd for Scene {
    fn handle_monitor_cmd(
        &mut self,
        command: &[u8],
        mut out: ConsoleOutput<'_>,
    ) -> Result<(), Infallible> {
        match command.trim_ascii() {
            b"reset" => {
                self.first().reset();
                outputln!(out, "reset; halted before the first instruction");
            }
            b"time" => outputln!(out, "{}", self.now()),
            _ => outputln!(out, "reset: pulls the reset pin\ntime: the virtual time"),
        }
        Ok(())
    }
}
