//! The machine: the Cortex-M3 core with its memories, on the bus with everything else, and the part's power.
//!
//! The core is crate rigless's: it translates the firmware's instructions to host code and counts them. Its
//! time is [`timing`]'s, by the [`costs`](crate::costs) of the [`segment`]s of code that [`execute`] lets it run; its
//! bus is [`bus`], and [`run`] takes it from event to event.

mod answer;
pub mod bus;
mod cortex;
mod debug;
pub mod decode;
pub mod dwt;
mod execute;
mod flash_reads;
mod kit;
mod measure;
mod power;
mod ram_code;
mod request;
mod run;
pub mod segment;
pub mod timing;
pub mod usage;
pub mod waits;

use std::collections::BTreeMap;

use rigless::emulator::Queued;

use crate::costs::Pace;
use crate::error::Error;
use crate::finding::Findings;
use crate::image::Image;
use crate::memory::{FLASH_BASE, RAM_BASE, ROUTED_PAGE};
use crate::periph::dbgmcu::Dbgmcu;
use crate::periph::flash::Flash;
use crate::periph::ident::Ident;
use crate::rtt::{Log, POLL};
use crate::soc::{Circuit, Config, Soc};
use crate::time::Time;
use bus::Bus;
use dwt::Dwt;
use execute::Active;
use kit::{Core, Parts};
use ram_code::RamCode;
pub(crate) use run::Limit;
use segment::Segments;
use timing::InstructionClock;
use usage::Resting;

/// A power cut in the middle of a flash operation to come.
#[derive(Clone, Copy, Debug)]
struct Cut {
    /// The operation: how many the flash will have started by then.
    operation: u64,
    /// How much of it is done by then, 0 to 1.
    fraction: f64,
}

/// An STM32F103 in the circuit `C`.
#[derive(Debug)]
pub struct Chip<C> {
    /// Dropped before the memories mapped into it.
    core: Core,
    /// Everything else.
    pub(crate) bus: Bus<C>,
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
    /// Another chip used the core before.
    core_is_used: bool,
    /// A debugger has set something in the core.
    debugged: bool,
    /// Addresses of the image's symbols.
    symbols: BTreeMap<String, u32>,
}

impl<C: Circuit> Chip<C> {
    /// Returns a part with `image` in its flash, powered on at time 0 in `circuit`. Its core uses the code that was
    /// translated for an earlier chip, unless `config` asks for a new core.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] if the image does not fit into the flash or the SRAM, or if `config.flash` has another size.
    ///
    /// # Panics
    ///
    /// On a host that the core cannot generate code for.
    pub fn in_circuit(image: &Image, config: Config, circuit: C) -> Result<Self, Error> {
        let part = config.part;
        image.check(part)?;
        let mut flash = Flash::new(part, config.write_protection, config.seed);
        flash.durations = config.corner.flash_durations();
        flash.hides_lock = config.corner.is_clone();
        if let Some(contents) = &config.flash {
            if contents.len() != part.flash_size {
                return Err(Error::Image(format!(
                    "the contents of the flash have {} bytes, but the flash has {}",
                    contents.len(),
                    part.flash_size
                )));
            }
            flash.bytes_mut().copy_from_slice(contents);
        }
        image.load(flash.bytes_mut(), part.page_size)?;
        let ident = Ident::new(part, config.unique_id, config.write_protection);
        let Parts {
            core,
            fresh,
            ram,
            ram_code,
            used,
        } = Parts::of(part, &mut flash, config.new_core);
        let soc = Soc::new(&config, flash, ram, circuit);
        let hclk = soc.rcc.clocks().hclk;
        let mut chip = Self {
            core,
            bus: Bus {
                part,
                soc,
                clock: InstructionClock::new(Time::ZERO, hclk),
                segments: Segments::new(Pace {
                    costs: config.corner.costs(),
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
            log: Log::default(),
            poll_at: POLL,
            active: Active::default(),
            sequential: None,
            unsettled: true,
            stirred: true,
            ram_code,
            core_is_used: used,
            debugged: false,
            symbols: image.symbols.clone(),
        };
        chip.bus.soc.refresh(Time::ZERO);
        chip.power_on();
        Ok(chip)
    }

    /// Returns the address of a symbol of the image. The address of a function has bit 0 set (Thumb).
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Returns the virtual time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.bus.clock.time(self.core.retired())
    }

    /// Returns the address of the next instruction.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.core.pc() as u32
    }

    /// Returns whether the core has locked up. Only a reset ends this state.
    #[must_use]
    pub fn locked_up(&self) -> bool {
        self.locked_up
    }

    /// Returns whether the core waits in WFI or WFE.
    #[must_use]
    pub fn asleep(&self) -> bool {
        self.core.waiting()
    }

    /// Returns the text that the firmware has logged over RTT since the last call.
    pub fn take_log(&mut self) -> String {
        self.log.take(self.bus.soc.ram.bytes())
    }

    /// Returns the contents of the SRAM.
    #[must_use]
    pub fn ram(&self) -> &[u8] {
        self.bus.soc.ram.bytes()
    }

    /// Returns the contents of the SRAM, for changing them as with a debug probe.
    pub fn ram_mut(&mut self) -> &mut [u8] {
        let base = u64::from(RAM_BASE);
        self.core.ask(Queued::Invalidate(
            base,
            base + self.bus.soc.ram.bytes().len() as u64,
        ));
        self.bus.soc.ram.bytes_mut()
    }

    /// Returns a part of the flash, to change; only the code in it is translated anew. `None` when it does not all lie
    /// in flash.
    pub(crate) fn flash_range_mut(&mut self, range: core::ops::Range<usize>) -> Option<&mut [u8]> {
        if range.start > range.end || range.end > self.bus.part.flash_size {
            return None;
        }
        let at = |offset: usize| u64::from(FLASH_BASE) + offset as u64;
        self.core
            .ask(Queued::Invalidate(at(range.start), at(range.end)));
        self.bus.soc.flash.bytes_mut().get_mut(range)
    }

    /// Returns the value of a core register: 0 to 12 are R0 to R12, 13 SP, 14 LR, 15 PC, 16 xPSR, 17 MSP, 18 PSP, 19
    /// PRIMASK, 20 BASEPRI, 21 FAULTMASK, 22 CONTROL; `None` for any other number.
    #[must_use]
    pub fn register(&self, number: usize) -> Option<u32> {
        let bytes = self.core.gdb_register(number)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    }
}
