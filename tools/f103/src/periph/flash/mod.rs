//! The flash program and erase controller, PM0075 (STM32F10xxx flash programming manual) chapters 2 and 3.
//!
//! It owns the flash's cells. An operation takes time, and changes the cells when it ends. A power cut or a reset
//! during the operation leaves it incomplete ([`mod@array`]). Option bytes can be read but not programmed.

mod array;
mod operations;

use std::num::NonZero;

use crate::memory::Memory;
use crate::part::Part;
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

pub use array::Torn;
use array::{Cells, Operation};

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

const ACR_LATENCY: u32 = 0b111;
const ACR_PRFTBE: u32 = 1 << 4;
const ACR_PRFTBS: u32 = 1 << 5;
const ACR_WRITABLE: u32 = ACR_LATENCY | 1 << 3 | ACR_PRFTBE;

const SR_BSY: u32 = 1 << 0;
const SR_PGERR: u32 = 1 << 2;
const SR_WRPRTERR: u32 = 1 << 4;
const SR_EOP: u32 = 1 << 5;

/// Instructions that the core may run from its prefetch buffer before an operation stalls its fetches: two
/// lines of 64 bits (PM0075 2.2) hold eight Thumb instructions at most.
const FETCHED_AHEAD: u32 = 8;

const CR_PG: u32 = 1 << 0;
const CR_PER: u32 = 1 << 1;
const CR_MER: u32 = 1 << 2;
const CR_STRT: u32 = 1 << 6;
const CR_LOCK: u32 = 1 << 7;
const CR_ERRIE: u32 = 1 << 10;
const CR_EOPIE: u32 = 1 << 12;
const CR_OPTION: u32 = 1 << 4 | 1 << 5 | 1 << 9;
const CR_WRITABLE: u32 = CR_PG | CR_PER | CR_MER | CR_ERRIE | CR_EOPIE;

/// Durations of the operations; DS5319 table 28 gives 20 to 40 ms for an erase, 40 to 70 us for a half-word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Durations {
    /// A page erase or a mass erase; 30 ms, the middle of the range, unless set.
    pub erase: Time,
    /// A half-word; 52.5 us, the typical value, unless set.
    pub program: Time,
}

impl Default for Durations {
    fn default() -> Self {
        Self {
            erase: Time::from_ms(30),
            program: Time::from_ns(52_500),
        }
    }
}

/// The reason why the controller rejects a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Complaint {
    /// The reason in words.
    pub text: &'static str,
    /// Whether the part answers with a bus error, a fault in the core.
    pub bus_error: bool,
}

/// State of the key sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lock {
    /// This many keys were right so far.
    Keys(usize),
    Open,
    /// A wrong key: closed until reset (PM0075 2.3.1).
    Jammed,
}

/// An operation under way.
#[derive(Clone, Copy, Debug)]
struct Busy {
    operation: Operation,
    from: Time,
    until: Time,
}

/// The controller and the cells.
#[derive(Debug)]
pub struct Flash {
    cells: Cells,
    /// How long operations take.
    pub durations: Durations,
    /// LOCK reads 0 while the controller is locked, as it is reported of a clone of the part.
    pub hides_lock: bool,
    /// The result of a power cut during an operation.
    pub torn: Torn,
    /// Whether the HSI, which times the operations, runs (PM0075 2.3).
    pub hsi_on: bool,
    /// FLASH_WRPR: each clear bit protects 4 KiB; the last bit also protects everything after its 4 KiB.
    wrpr: u32,
    acr: u32,
    lock: Lock,
    cr: u32,
    sr: u32,
    ar: u32,
    busy: Option<Busy>,
    /// Instructions left in the prefetch buffer. The core stalls only after it has run them.
    ahead: u32,
    /// BSY still reads 0 although an erase runs: it rises a cycle after STRT (errata sheet ES096 of the medium-density
    /// parts, 2.2.8), of which a half-word has none. The model applies it to all parts, in its worst case: BSY reads
    /// 0 until the first read of a register of this block, or until the core stalls.
    bsy_is_late: bool,
    /// Number of the operation that is to end without EOP, counted like `started`.
    without_eop: Option<u64>,
    /// Operations started since the part was made.
    started: u64,
    complaint: Option<Complaint>,
    changed: Option<(usize, usize)>,
    changes: NonZero<u64>,
}

impl Flash {
    /// Returns the controller of `part` after power-on, with an erased flash and these write-protection bits. `seed`
    /// decides the results of torn operations.
    #[must_use]
    pub fn new(part: &Part, wrpr: u32, seed: u64) -> Self {
        Self {
            cells: Cells::erased(part, seed),
            durations: Durations::default(),
            hides_lock: false,
            torn: Torn::default(),
            hsi_on: true,
            wrpr,
            acr: ACR_PRFTBE,
            lock: Lock::Keys(0),
            cr: 0,
            sr: 0,
            ar: 0,
            busy: None,
            ahead: 0,
            bsy_is_late: false,
            without_eop: None,
            started: 0,
            complaint: None,
            changed: None,
            changes: NonZero::<u64>::MIN,
        }
    }

    /// Returns the host address of the cells, for the core ([`crate::memory::Memory::host`]).
    pub fn host(&mut self) -> *mut u8 {
        self.cells.host()
    }

    /// Moves the cells to `memory`, which has the same size. The previous contents of `memory` are lost.
    pub(crate) fn move_to(&mut self, memory: Memory) {
        self.cells.move_to(memory);
    }

    /// Takes the memory of the cells, for a flash that is no longer needed.
    pub(crate) fn take_memory(&mut self) -> Memory {
        self.cells.take_memory()
    }

    /// Returns the contents.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.cells.bytes()
    }

    /// Returns the contents, for changes from outside.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.changes = self.changes.saturating_add(1);
        self.cells.bytes_mut()
    }

    /// Returns the wait states of a fetch, and whether the prefetch buffer is on (FLASH_ACR).
    #[must_use]
    pub fn access_control(&self) -> (u32, bool) {
        (self.acr & ACR_LATENCY, self.acr & ACR_PRFTBE != 0)
    }

    /// Returns the end of the operation under way.
    #[must_use]
    pub fn busy_until(&self) -> Option<Time> {
        self.busy.map(|busy| busy.until)
    }

    /// Returns the instant until which a fetch from flash stalls. No fetch stalls while the prefetch buffer has
    /// instructions.
    #[must_use]
    pub fn stalled_until(&self) -> Option<Time> {
        self.busy_until().filter(|_| self.ahead == 0)
    }

    /// Counts the instructions that the core has run since the operation began.
    pub fn ran(&mut self, instructions: u64) {
        let instructions = u32::try_from(instructions).unwrap_or(u32::MAX);
        self.ahead = self.ahead.saturating_sub(instructions);
        self.bsy_is_late &= self.ahead > 0;
    }

    /// Makes the `nth` operation from now (1 = the next) end without EOP. It still changes the cells as usual.
    pub fn end_without_eop(&mut self, nth: u64) {
        self.without_eop = Some(self.started + nth.max(1));
    }

    /// Returns the begin and the end of the operation under way.
    #[must_use]
    pub fn busy_span(&self) -> Option<(Time, Time)> {
        self.busy.map(|busy| (busy.from, busy.until))
    }

    /// Operations started since the part was made.
    #[must_use]
    pub fn started(&self) -> u64 {
        self.started
    }

    /// Grows whenever the contents may have changed, by an operation or from outside.
    #[must_use]
    pub fn changes(&self) -> NonZero<u64> {
        self.changes
    }

    /// Reads the word at byte `at` (a multiple of 4), with unsteady cells as this read finds them.
    pub fn read_word(&mut self, at: usize) -> u32 {
        u32::from_le_bytes(self.cells.read(at))
    }

    /// Returns whether there are unsteady cells among these bytes. The core reads bytes without such cells directly.
    #[must_use]
    pub fn is_unsteady(&self, bytes: core::ops::Range<usize>) -> bool {
        self.cells.is_unsteady(bytes)
    }

    /// Takes the complaint about a write since the last call.
    pub fn take_complaint(&mut self) -> Option<Complaint> {
        self.complaint.take()
    }

    /// Returns the bytes (first, end) that an operation changed since the last call.
    pub fn take_changed(&mut self) -> Option<(usize, usize)> {
        self.changed.take()
    }

    fn write_cr(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        if self.lock != Lock::Open {
            if value & !CR_LOCK != 0 {
                self.complaint = Some(Complaint {
                    text: "FLASH_CR written while locked",
                    bus_error: false,
                });
            }
            return Ok(());
        }
        if self.busy.is_some() {
            self.complaint = Some(Complaint {
                text: "FLASH_CR written while an operation runs",
                bus_error: false,
            });
            return Ok(());
        }
        self.cr = value & CR_WRITABLE;
        if value & CR_STRT != 0 {
            self.erase(now);
        }
        if value & CR_LOCK != 0 {
            self.lock = Lock::Keys(0);
        }
        if value & CR_OPTION != 0 {
            return Err(Unmodelled("option byte programming (FLASH_CR)"));
        }
        Ok(())
    }

    fn write_key(&mut self, value: u32) {
        self.lock = match self.lock {
            Lock::Keys(n) if value == KEYS[n] => {
                if n + 1 == KEYS.len() {
                    Lock::Open
                } else {
                    Lock::Keys(n + 1)
                }
            }
            _ => {
                self.complaint = Some(Complaint {
                    text: "wrong key: FLASH_CR is locked until reset",
                    bus_error: true,
                });
                Lock::Jammed
            }
        };
    }
}

impl Peripheral for Flash {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        let hides = self.lock == Lock::Open || self.hides_lock;
        let locked = if hides { 0 } else { CR_LOCK };
        let strt = match self.busy.map(|busy| busy.operation) {
            Some(Operation::Page { .. } | Operation::Mass) => CR_STRT,
            _ => 0,
        };
        let bsy_is_late = core::mem::take(&mut self.bsy_is_late);
        Ok(match offset {
            // PRFTBS follows PRFTBE.
            0x00 => self.acr | (self.acr & ACR_PRFTBE) << 1 & ACR_PRFTBS,
            // The key registers are write-only.
            0x04 | 0x08 => 0,
            0x0C if bsy_is_late => self.sr & !SR_BSY,
            0x0C => self.sr,
            0x10 => self.cr | locked | strt,
            0x14 => 0,
            // FLASH_OBR: no read protection, option bytes as from the factory.
            0x1C => 0x03FF_FFFC,
            0x20 => self.wrpr,
            _ => return Err(Unmodelled("a reserved address of FLASH")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => self.acr = value & ACR_WRITABLE,
            0x04 => self.write_key(value),
            0x08 => return Err(Unmodelled("option byte programming (FLASH_OPTKEYR)")),
            // EOP, WRPRTERR and PGERR are cleared by writing 1.
            0x0C => self.sr &= !(value & (SR_EOP | SR_WRPRTERR | SR_PGERR)),
            0x10 => return self.write_cr(value, now),
            0x14 => self.ar = value,
            _ => return Err(Unmodelled("a reserved address of FLASH")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        self.busy_until()
    }

    fn advance(&mut self, now: Time) {
        if let Some(busy) = self.busy
            && busy.until <= now
        {
            self.busy = None;
            self.changed = Some(self.cells.finish(busy.operation));
            self.changes = self.changes.saturating_add(1);
            self.ahead = 0;
            self.bsy_is_late = false;
            self.sr &= !SR_BSY;
            if self.without_eop == Some(self.started) {
                self.without_eop = None;
            } else {
                self.sr |= SR_EOP;
            }
        }
    }

    fn irq(&self) -> bool {
        let done = self.cr & CR_EOPIE != 0 && self.sr & SR_EOP != 0;
        let failed = self.cr & CR_ERRIE != 0 && self.sr & (SR_PGERR | SR_WRPRTERR) != 0;
        done || failed
    }

    fn reset(&mut self, now: Time) {
        // A reset in the middle of an operation leaves what a power cut would (PM0075 2.3.2 warns of it).
        self.power_off(now);
        self.acr = ACR_PRFTBE;
        self.lock = Lock::Keys(0);
        self.cr = 0;
        self.sr = 0;
        self.ar = 0;
        self.complaint = None;
    }
}

#[cfg(test)]
mod tests;
