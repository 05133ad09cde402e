//! The machine: the Cortex-M3 core with its memories, on the bus with everything else.
//!
//! The core is crate rigless's: it translates the firmware's instructions to host code and counts them. Its
//! time is [`timing`]'s, by the [`costs`] of the [`segment`]s of code that [`execute`] lets it run; its bus is
//! [`bus`], and [`run`] takes it from event to event.

mod answer;
pub mod bus;
mod cortex;
pub mod costs;
mod debug;
pub mod decode;
pub mod dwt;
mod execute;
mod flash_reads;
mod kit;
pub mod memory;
mod ram_code;
mod request;
mod run;
pub mod segment;
pub mod timing;
pub mod usage;
pub mod waits;

use rigless::emulator::Queued;
use rigless::soc::Width;

use crate::finding::Findings;
use crate::part::Part;
use crate::periph::dbgmcu::Dbgmcu;
use crate::periph::ident::Ident;
use crate::periph::rcc::Cause;
use crate::rtt::{Log, POLL};
use crate::soc::{Circuit, Soc};
use crate::time::Time;
use bus::Bus;
use costs::{Costs, Pace};
use dwt::Dwt;
use execute::Active;
use kit::{Core, Parts};
use memory::{FLASH_BASE, RAM_BASE, ROUTED_PAGE};
use ram_code::RamCode;
pub use run::{Limit, Stop};
use segment::Segments;
use timing::InstructionClock;
use usage::{CoreTime, Resting};
use waits::{Wait, Waits};

/// From the supply's rise to the end of reset: DS5319 table 11, tRSTTEMPO, typical.
const POWER_ON_RESET: Time = Time::from_us(2_500);
/// The shortest reset pulse (RM0008 7.1.1).
const RESET_PULSE: Time = Time::from_us(20);

/// A power cut in the middle of a flash operation to come.
#[derive(Clone, Copy, Debug)]
struct Cut {
    /// The operation: how many the flash will have started by then.
    operation: u64,
    /// How much of it is done by then, 0 to 1.
    fraction: f64,
}

/// The core, its memories and its bus.
#[derive(Debug)]
pub struct Machine<C> {
    /// Dropped before the memories mapped into it.
    core: Core,
    /// Everything else.
    pub bus: Bus<C>,
    /// The core's state out of reset, as it saved it. Loading it keeps the translated code.
    fresh: Vec<u8>,
    /// Instructions executed before the core's last reset.
    counted: u64,
    powered: bool,
    /// The core is held in reset until then.
    held_until: Time,
    locked_up: bool,
    resets: u32,
    power_ons: u64,
    cut: Option<Cut>,
    cut_at: Option<Time>,
    resting: Resting,
    log: Log,
    /// When the log is read next.
    poll_at: Time,
    /// The exception being handled.
    active: Active,
    /// Address at which the code continues after a segment without a branch at its end.
    sequential: Option<u32>,
    /// An exception may be entered before the next instruction.
    unsettled: bool,
    /// The core's SysTick has expired, or the core was reset, since it last executed an instruction.
    stirred: bool,
    ram_code: RamCode,
    /// Another machine used the core before.
    core_is_used: bool,
    /// A debugger has set something in the core.
    debugged: bool,
}

impl<C: Circuit> Machine<C> {
    /// Returns the machine of `part` around `soc`, without power, at time 0, whose core has these costs and whose
    /// firmware keeps its RTT control block at `rtt_block`. It goes on with what a core of an earlier machine has
    /// translated unless it is to have a new one.
    ///
    /// # Panics
    ///
    /// On a host that the core cannot generate code for.
    #[must_use]
    pub fn new(
        part: &'static Part,
        mut soc: Soc<C>,
        ident: Ident,
        costs: Costs,
        rtt_block: Option<u32>,
        new_core: bool,
    ) -> Self {
        let Parts {
            core,
            fresh,
            ram,
            ram_code,
            used,
        } = Parts::of(part, &mut soc.flash, new_core);
        let hclk = soc.rcc.clocks().hclk;
        Self {
            core,
            bus: Bus {
                part,
                soc,
                clock: InstructionClock::new(Time::ZERO, hclk),
                segments: Segments::new(Pace {
                    costs,
                    wait_states: 0,
                    prefetch: true,
                }),
                findings: Findings::default(),
                ident,
                dbgmcu: Dbgmcu::new(part.idcode),
                dwt: Dwt::default(),
                stop: (Time::ZERO, 0),
                busy: false,
                halt: false,
                queued: Vec::new(),
                pc: 0,
                waits: None,
                ram,
                flash_is_watched: false,
                routed_pages: vec![false; part.flash_size / ROUTED_PAGE],
                read_stalls: false,
                touched: false,
                carries_on: false,
            },
            fresh,
            counted: 0,
            powered: false,
            held_until: Time::ZERO,
            locked_up: false,
            resets: 0,
            power_ons: 0,
            cut: None,
            cut_at: None,
            resting: Resting::default(),
            log: Log::new(rtt_block),
            poll_at: if rtt_block.is_some() { POLL } else { Time::MAX },
            active: Active::default(),
            sequential: None,
            unsettled: true,
            stirred: true,
            ram_code,
            core_is_used: used,
            debugged: false,
        }
    }

    /// Returns the virtual time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.bus.clock.time(self.core.retired())
    }

    /// Returns whether its core goes on with what it has translated for an earlier machine.
    #[must_use]
    pub fn core_is_used(&self) -> bool {
        self.core_is_used
    }

    /// Instructions done since the machine was made.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.counted + self.core.retired()
    }

    /// Returns the cycles of HCLK since the machine was made.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.bus.clock.cycle(self.core.retired())
    }

    /// Returns how the core has spent the time since the machine was made.
    #[must_use]
    pub fn core_time(&self) -> CoreTime {
        self.resting.of(self.now())
    }

    /// Starts the measurement of interrupt waits again from zero, or stops it.
    pub fn measure_waits(&mut self, on: bool) {
        self.ram_code.end(&mut *self.core, &self.bus.ram);
        if let Some(mut waits) = self.bus.waits.take() {
            waits.leave(&mut *self.core);
        }
        let keep = self.bus.charges_tables();
        self.bus.waits = on.then(|| Box::new(Waits::new(keep)));
    }

    /// What was translated from SRAM outlasts a start that copies the same code there.
    fn keep_ram_code(&mut self) {
        if self.bus.waits.is_none() {
            self.ram_code.reset(&mut *self.core, &self.bus.ram);
        } else {
            // The measurement decides which pages are sent to the bus.
            self.ram_mut();
        }
    }

    /// Returns how long exception `number` had to wait, as measured.
    #[must_use]
    pub fn wait(&self, number: usize) -> Wait {
        self.bus
            .waits
            .as_ref()
            .map_or_else(Wait::default, |waits| waits.of(number))
    }

    /// Returns the address of the next instruction.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.core.pc() as u32
    }

    /// Returns whether the power is on.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.powered
    }

    /// Returns whether the core has locked up.
    #[must_use]
    pub fn locked_up(&self) -> bool {
        self.locked_up
    }

    /// Returns whether the core waits for an interrupt or an event.
    #[must_use]
    pub fn asleep(&self) -> bool {
        self.core.waiting()
    }

    /// Resets since the power came on.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Returns how often the power came on.
    #[must_use]
    pub fn power_ons(&self) -> u64 {
        self.power_ons
    }

    /// Returns what the firmware logged since the last call.
    pub fn take_log(&mut self) -> String {
        self.log.take(self.bus.ram.bytes())
    }

    /// Returns the SRAM.
    #[must_use]
    pub fn ram(&self) -> &[u8] {
        self.bus.ram.bytes()
    }

    /// Returns the SRAM, to change: a debugger's write.
    pub fn ram_mut(&mut self) -> &mut [u8] {
        let base = u64::from(RAM_BASE);
        self.core.ask(Queued::Invalidate(
            base,
            base + self.bus.ram.bytes().len() as u64,
        ));
        self.bus.ram.bytes_mut()
    }

    /// Returns the flash, to change: a programmer's write.
    pub fn flash_mut(&mut self) -> &mut [u8] {
        self.flash_range_mut(0..self.bus.part.flash_size)
            .unwrap_or_default()
    }

    /// Returns a part of the flash, to change; only the code in it is translated anew. `None` when it does not all lie
    /// in flash.
    pub fn flash_range_mut(&mut self, range: core::ops::Range<usize>) -> Option<&mut [u8]> {
        if range.start > range.end || range.end > self.bus.part.flash_size {
            return None;
        }
        let at = |offset: usize| u64::from(FLASH_BASE) + offset as u64;
        self.core
            .ask(Queued::Invalidate(at(range.start), at(range.end)));
        self.bus.soc.flash.bytes_mut().get_mut(range)
    }

    /// Returns a core register: 0 to 15, 16 xPSR, 17 MSP, 18 PSP, 19 PRIMASK, 20 BASEPRI, 21 FAULTMASK, 22 CONTROL.
    #[must_use]
    pub fn register(&self, number: usize) -> Option<u32> {
        let bytes = self.core.gdb_register(number)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }

    /// Switches the power on, with the SRAM contents of a cold part. Does nothing while the power is on.
    pub fn power_on(&mut self) {
        if self.powered {
            return;
        }
        self.powered = true;
        self.power_ons += 1;
        self.keep_ram_code();
        fill_with_noise(self.bus.ram.bytes_mut(), self.power_ons);
        self.bus.dbgmcu = Dbgmcu::new(self.bus.part.idcode);
        self.bus.dwt = Dwt::default();
        self.bus.soc.set_power(true, self.now());
        self.reset(Cause::PowerOn);
        self.resets = 0;
    }

    /// Switches the power off at this instant. Does nothing while the power is off.
    pub fn power_off(&mut self) {
        if !self.powered {
            return;
        }
        let now = self.now();
        self.bus.advance(now, self.core.retired());
        self.log.poll(self.bus.ram.bytes_mut());
        self.powered = false;
        self.locked_up = false;
        self.cut = None;
        self.cut_at = None;
        self.bus.soc.set_power(false, now);
        self.bus.soc.signals.reset = None;
    }

    /// Cuts the power in the middle of the `nth` flash operation from now (1 = the next), when `fraction` (0 to
    /// 1) of it is done.
    pub fn cut_in_flash_operation(&mut self, nth: u64, fraction: f64) {
        self.cut = Some(Cut {
            operation: self.bus.soc.flash.started() + nth.max(1),
            fraction: fraction.clamp(0.0, 1.0),
        });
    }

    /// Resets the whole part.
    pub fn reset(&mut self, cause: Cause) {
        let now = self.now();
        self.log.poll(self.bus.ram.bytes_mut());
        self.bus.soc.reset(cause, now);
        let count = self.core.retired();
        self.counted += count;
        self.bus.clock.restart_count(count);
        self.core
            .load(&self.fresh)
            .expect("the state the same core saved");
        self.keep_ram_code();
        let vectors = self.bus.soc.flash.bytes();
        let word = |address: u64, _: Width| {
            let at = address as usize;
            let bytes = vectors.get(at..at + 4)?;
            Some(u64::from(u32::from_le_bytes(bytes.try_into().ok()?)))
        };
        self.core.boot(0, &word);
        if let Some(waits) = &mut self.bus.waits {
            waits.reset(&mut *self.core);
        }
        // The core knows no line level any more.
        self.bus
            .queued
            .retain(|queued| !matches!(queued, Queued::Line(..)));
        self.bus.soc.repeat_lines();
        self.bus.update_rate(0);
        self.active = Active::default();
        self.unsettled = true;
        self.stirred = true;
        self.locked_up = false;
        self.resets = self.resets.saturating_add(1);
        let pulse = if cause == Cause::PowerOn {
            POWER_ON_RESET
        } else {
            RESET_PULSE
        };
        self.held_until = now + pulse;
    }
}

/// Fills the SRAM after power-on with arbitrary bytes, which are the same in every run (xorshift64).
fn fill_with_noise(bytes: &mut [u8], seed: u64) {
    let mut state = 0x9E37_79B9_7F4A_7C15 ^ seed;
    for chunk in bytes.chunks_mut(8) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        chunk.copy_from_slice(&state.to_le_bytes()[..chunk.len()]);
    }
}
