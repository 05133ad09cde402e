//! The memory that keeps the fault record over a reset.

use core::{array, cell::UnsafeCell, mem::MaybeUninit, ptr, sync::atomic::AtomicU8};

use super::{
    Fault, FaultRecord, TASKS, number,
    record::{Noted, WORDS},
};

/// Data that a reset does not change. Only [`take_at_start`] initialises it.
#[repr(C)]
struct Kept {
    record: [u32; WORDS],
    uptime: u32,
    marks: [AtomicU8; TASKS],
    dip: u32,
    saves: u32,
}

struct Place(UnsafeCell<MaybeUninit<Kept>>);

// SAFETY: only the functions of this module access record, uptime, dip and saves, by single volatile accesses of a word,
// which cannot be torn. A fault handler may interrupt a sequence of these accesses, but the interrupted code never
// continues. The marks are atomics.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".uninit.FAULT")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

fn place() -> *mut Kept {
    PLACE.0.get().cast()
}

fn read() -> Option<Noted> {
    // SAFETY: the pointers are to the words of a static in RAM, where any content is valid. The reads are volatile,
    // so that the compiler does not rely on the memory being uninitialised.
    let words =
        array::from_fn(|at| unsafe { ptr::read_volatile(&raw const (*place()).record[at]) });
    Noted::from_words(&words)
}

fn write(noted: &Noted) {
    // SAFETY: the pointer is to a static; `Place` explains why no other access is under way.
    unsafe { ptr::write_volatile(&raw mut (*place()).record, noted.words()) };
}

/// Returns the record of the last fault before this start and prepares the memory for the next one. A power-on
/// clears the record. A watchdog reset is noted when nothing else was. `reset_cause` has the format of
/// [`Board::reset_cause`](crate::board::Board::reset_cause). The board calls this once at every start, before it
/// starts the crystal, because the record contains the number of crystal failures.
#[must_use]
pub(crate) fn take_at_start(reset_cause: u8) -> FaultRecord {
    // SAFETY: as in `read`; bytes and words may hold any value.
    let (uptime, marks) = unsafe {
        (
            ptr::read_volatile(&raw const (*place()).uptime),
            ptr::read_volatile((&raw const (*place()).marks).cast::<[u8; TASKS]>()),
        )
    };
    let mut kept = read();
    let noted = Noted::at_start(&mut kept, reset_cause, uptime, marks);
    write(noted);
    keep_uptime(0);
    // SAFETY: as in `write`; volatile for the same reason as in `read`.
    unsafe {
        ptr::write_volatile(
            (&raw mut (*place()).marks).cast::<[u8; TASKS]>(),
            [0; TASKS],
        )
    };
    noted.record
}

/// Notes a fault, with the last uptime that was kept. For panic and fault handlers. Only the first fault since the
/// start is noted.
pub fn note(fault: Fault) {
    // If the words are not a valid record, the fault came before `take_at_start` or has overwritten them.
    let mut kept = read();
    let noted = kept.get_or_insert_default();
    // SAFETY: as in `read`.
    let uptime = unsafe { ptr::read_volatile(&raw const (*place()).uptime) };
    noted.add(fault, uptime, 0);
    write(noted);
}

/// Keeps the uptime of the firmware, in seconds. Call this once per second.
pub fn keep_uptime(seconds: u32) {
    // SAFETY: as in `write`.
    unsafe { ptr::write_volatile(&raw mut (*place()).uptime, seconds) };
}

/// Returns the DIP switch as read at power-on, or `None` when no valid value is kept.
pub(crate) fn kept_dip() -> Option<u8> {
    // SAFETY: as in `read`; a word may hold anything.
    number::from_word(number::DIP, unsafe {
        ptr::read_volatile(&raw const (*place()).dip)
    })
}

/// Keeps the DIP switch over resets.
pub(crate) fn keep_dip(dip: u8) {
    // SAFETY: as in `write`.
    unsafe { ptr::write_volatile(&raw mut (*place()).dip, number::to_word(number::DIP, dip)) };
}

/// Returns the number of saves left before the reset, or `None` when no valid number is kept.
pub(crate) fn kept_saves() -> Option<u8> {
    // SAFETY: as in `read`; a word may hold anything.
    number::from_word(number::SAVES, unsafe {
        ptr::read_volatile(&raw const (*place()).saves)
    })
}

/// Keeps the number of saves that the firmware may still write to flash. Call this after every change.
pub fn keep_saves(left: u8) {
    // SAFETY: as in `write`.
    unsafe {
        ptr::write_volatile(
            &raw mut (*place()).saves,
            number::to_word(number::SAVES, left),
        )
    };
}

/// Returns the marks of the tasks, all 0 after [`take_at_start`]. After a watchdog reset the next start reports
/// every task as missing whose mark is not 1, which means "has run to its end". Each task stores its own mark; the
/// code that refreshes the watchdog clears all of them.
#[must_use]
pub fn marks() -> &'static [AtomicU8; TASKS] {
    // SAFETY: the static is aligned for the array and holds bytes, and any byte is a valid `AtomicU8`. Only
    // `take_at_start` writes the marks in another way, by volatile stores that cannot tear a byte.
    unsafe { &(*place()).marks }
}
