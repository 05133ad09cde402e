//! Where the record is kept.

use core::{array, cell::UnsafeCell, mem::MaybeUninit, ptr, sync::atomic::AtomicU8};

use crate::dip;

use super::{
    Fault, FaultRecord, TASKS,
    record::{Noted, WORDS},
};

/// What a reset leaves alone. Nothing initialises it but [`take_at_start`].
#[repr(C)]
struct Kept {
    record: [u32; WORDS],
    uptime: u32,
    marks: [AtomicU8; TASKS],
    dip: u32,
}

struct Place(UnsafeCell<MaybeUninit<Kept>>);

// SAFETY: record, uptime and dip are accessed by the functions of this module alone, by single volatile
// accesses of a word, which cannot be torn. They may come between each other: a fault handler stops
// whatever it interrupts for good. The marks are atomics.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".uninit.FAULT")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

fn place() -> *mut Kept {
    PLACE.0.get().cast()
}

fn read() -> Option<Noted> {
    // SAFETY: the pointers are to the words of a static. It is RAM, so it holds some words, whatever they
    // are; volatile, so that the compiler does not reason from nobody having initialised them.
    let words =
        array::from_fn(|at| unsafe { ptr::read_volatile(&raw const (*place()).record[at]) });
    Noted::from_words(&words)
}

fn write(noted: &Noted) {
    // SAFETY: the pointer is to a static; see `Place` for why nobody else looks.
    unsafe { ptr::write_volatile(&raw mut (*place()).record, noted.words()) };
}

/// Takes the record of what went wrong before this start, and starts a new account: a power-on clears
/// it, a watchdog's bite is noted when nothing else was. `reset_cause` as
/// [`Board::reset_cause`](crate::board::Board::reset_cause) has it. The board calls this once at every start,
/// before it starts the crystal: how often that has failed is in the record.
#[must_use]
pub(crate) fn take_at_start(reset_cause: u8) -> FaultRecord {
    // SAFETY: as in `read`; bytes and words may hold anything.
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
    // SAFETY: as in `write`; volatile, for the same reason as in `read`.
    unsafe {
        ptr::write_volatile(
            (&raw mut (*place()).marks).cast::<[u8; TASKS]>(),
            [0; TASKS],
        )
    };
    noted.record
}

/// Notes a fault, with the uptime that was kept. For the handlers of panics and faults; only the first
/// since the start is noted.
pub fn note(fault: Fault) {
    // Words that are no record: the fault came before `take_at_start`, or wrote over them.
    let mut kept = read();
    let noted = kept.get_or_insert_default();
    // SAFETY: as in `read`.
    let uptime = unsafe { ptr::read_volatile(&raw const (*place()).uptime) };
    noted.add(fault, uptime, 0);
    write(noted);
}

/// Keeps for how long the firmware has run, in seconds: once a second.
pub fn keep_uptime(seconds: u32) {
    // SAFETY: as in `write`.
    unsafe { ptr::write_volatile(&raw mut (*place()).uptime, seconds) };
}

/// The DIP switch as it was read at power-on; `None` when nothing valid is kept.
pub(crate) fn kept_dip() -> Option<u8> {
    // SAFETY: as in `read`; a word may hold anything.
    dip::from_word(unsafe { ptr::read_volatile(&raw const (*place()).dip) })
}

/// Keeps the DIP switch over resets.
pub(crate) fn keep_dip(dip: u8) {
    // SAFETY: as in `write`.
    unsafe { ptr::write_volatile(&raw mut (*place()).dip, dip::to_word(dip)) };
}

/// The marks of the tasks, all 0 after [`take_at_start`]. Once the watchdog has bitten, the next start
/// reports the tasks whose mark is not 1, "has run to its end", as missing. A task leaves its mark by a store of
/// its own; whoever feeds the watchdog takes them all back.
#[must_use]
pub fn marks() -> &'static [AtomicU8; TASKS] {
    // SAFETY: the static is aligned for it and holds bytes, of which any is a valid `AtomicU8`.
    // `take_at_start` writes them otherwise than through this, in volatile stores that tear no byte.
    unsafe { &(*place()).marks }
}
