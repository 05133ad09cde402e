//! A core with the memories mapped into it, which the next machine of this process reuses.
//!
//! The translation of the firmware takes several times as long as the run of its start. A dropped machine therefore
//! keeps its core, with the translated code, for the next machine of the same part. That machine loads the core's
//! state after reset, as for every other reset, and writes the new contents of the flash. Only the code whose bytes
//! differ is translated again. The run is the same as on a new core.

use core::fmt;
use core::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

use rigless::emulator::{Processor, Queued};

use super::ram_code::RamCode;
use super::{Chip, cortex};
use crate::memory::{FLASH_BASE, Memory, RAM_BASE, ROUTED_PAGE};
use crate::part::Part;
use crate::periph::flash::Flash;

/// Maximum number of cores that are kept. One for each test that runs at the same time is enough.
const MOST: usize = 8;
/// Length in bytes of the pieces in which flash is compared.
const PIECE: usize = 64;

/// The cores of dropped machines.
static LEFT: Mutex<Vec<Kit>> = Mutex::new(Vec::new());

/// The core of a machine.
pub(super) struct Core(Option<Box<dyn Processor>>);

impl Deref for Core {
    type Target = dyn Processor;

    #[inline]
    fn deref(&self) -> &Self::Target {
        self.0
            .as_deref()
            .expect("a machine has a core until it is dropped")
    }
}

impl DerefMut for Core {
    #[inline]
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.0
            .as_deref_mut()
            .expect("a machine has a core until it is dropped")
    }
}

impl fmt::Debug for Core {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A core that no machine uses, and its memories.
struct Kit {
    part: &'static Part,
    /// Dropped before the memories mapped into it.
    core: Box<dyn Processor>,
    fresh: Vec<u8>,
    flash: Memory,
    ram: Memory,
    ram_code: RamCode,
}

/// The parts that a new machine is built from.
pub(super) struct Parts {
    /// The core, out of reset, with the flash and `ram` mapped into it.
    pub core: Core,
    /// The core's state out of reset.
    pub fresh: Vec<u8>,
    pub ram: Memory,
    pub ram_code: RamCode,
    /// Whether another machine has used these parts.
    pub used: bool,
}

impl Parts {
    /// For a machine of `part` with this flash, whose cells move to where the core finds them: left behind by another
    /// machine, unless they are to be new or there are none.
    pub(super) fn of(part: &'static Part, flash: &mut Flash, new: bool) -> Self {
        let left = if new { None } else { take(part) };
        match left {
            Some(kit) => kit.with(flash),
            None => Self::new(part, flash),
        }
    }

    fn new(part: &'static Part, flash: &mut Flash) -> Self {
        let mut ram = Memory::new(part.ram_size, 0);
        let mut core = cortex::m3(part);
        let fresh = core.save();
        let host = flash.host();
        let base = u64::from(FLASH_BASE);
        // SAFETY: both memories are aligned to 4 KiB, as long as mapped, and live, behind pointers that do not
        // move, as long as the core: in the machine, then in a `Kit`, each of which drops the core first. Slices
        // of them are lent out only by methods that borrow the machine while the core does not run, or by its bus
        // inside a call.
        unsafe {
            core.map(base, part.flash_size as u64, host, false);
            core.map(0, part.flash_size as u64, host, false);
            core.map(u64::from(RAM_BASE), part.ram_size as u64, ram.host(), true);
        }
        Self {
            core: Core(Some(core)),
            fresh,
            ram,
            ram_code: RamCode::default(),
            used: false,
        }
    }
}

impl Kit {
    fn with(mut self, flash: &mut Flash) -> Parts {
        self.core
            .load(&self.fresh)
            .expect("the state the same core saved");
        let pieces = self
            .flash
            .bytes()
            .chunks(PIECE)
            .zip(flash.bytes().chunks(PIECE));
        for (n, (was, is)) in pieces.enumerate() {
            if was != is {
                let start = u64::from(FLASH_BASE) + (n * PIECE) as u64;
                self.core
                    .ask(Queued::Invalidate(start, start + PIECE as u64));
            }
        }
        flash.move_to(self.flash);
        Parts {
            core: Core(Some(self.core)),
            fresh: self.fresh,
            ram: self.ram,
            ram_code: self.ram_code,
            used: true,
        }
    }
}

fn take(part: &Part) -> Option<Kit> {
    let mut left = LEFT.lock().unwrap_or_else(PoisonError::into_inner);
    let at = left.iter().rposition(|kit| kit.part.name == part.name)?;
    Some(left.remove(at))
}

fn leave(kit: Kit) {
    let mut left = LEFT.lock().unwrap_or_else(PoisonError::into_inner);
    if left.len() < MOST {
        left.push(kit);
    }
}

impl<C> Drop for Chip<C> {
    fn drop(&mut self) {
        let Some(mut core) = self.core.0.take() else {
            return;
        };
        // What a debugger or a measurement has set in the core is not part of the state that is loaded.
        if self.debugged || self.bus.waits.is_some() || std::thread::panicking() {
            return;
        }
        for queued in core::mem::take(&mut self.bus.queued) {
            core.ask(queued);
        }
        if let Some((first, end)) = self.bus.soc.flash.take_changed() {
            let base = u64::from(FLASH_BASE);
            core.ask(Queued::Invalidate(base + first as u64, base + end as u64));
        }
        let routed = self.bus.routed_pages.iter().enumerate();
        for (page, _) in routed.filter(|(_, routed)| **routed) {
            let start = (page * ROUTED_PAGE) as u64;
            core.ask(Queued::Unroute(u64::from(FLASH_BASE) + start));
            core.ask(Queued::Unroute(start));
        }
        // Clears the breakpoint to pass: no instruction is at an odd address.
        core.pass_breakpoint(1);
        core.take_reset_request();
        leave(Kit {
            part: self.bus.part,
            core,
            fresh: core::mem::take(&mut self.fresh),
            flash: self.bus.soc.flash.take_memory(),
            ram: core::mem::replace(&mut self.bus.soc.ram, Memory::new(1, 0)),
            ram_code: core::mem::take(&mut self.ram_code),
        });
    }
}
