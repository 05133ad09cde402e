//! Access to the kept region.
//!
//! Each part has one writer, so that no update interrupts another: the scan writes the live words, the background task
//! the sealed part, and before both the start. A fault handler writes the sealed part, too; what it interrupts never
//! continues.

use core::{
    array,
    cell::UnsafeCell,
    ptr,
    sync::atomic::{AtomicU8, AtomicU32, Ordering},
};

use super::{
    AT_SAFE, COPY, HELD, MARKS, MODULES, OUTPUTS, POINTS, PULSES, UPTIME, WORDS, live,
    sealed::{
        self, AS_255, ASKED, CAUSE, CHOSEN, DEVELOPMENT, DIP, FLAGS, FRESH, HAS_DIP, RECORDS,
        SAVES, Sealed, UNSEEN,
    },
};
use crate::fault::{Fault, Kind};
use ports::marks::{ENDED, TASKS};

/// The seconds from power-on to this start, or before it to the one before. The region has the latter until the outputs
/// are this run's.
static STARTED_S: AtomicU32 = AtomicU32::new(0);

#[repr(transparent)]
struct Region(UnsafeCell<[u32; WORDS]>);

// SAFETY: the words are accessed by single volatile accesses only, which cannot be torn, and the marks as atomics.
unsafe impl Sync for Region {}

unsafe extern "C" {
    /// The region, placed by the linker script.
    static _kept: Region;
}

fn word(at: usize) -> *mut u32 {
    // SAFETY: the linker script reserves the region. The remainder is the index of one of its words.
    unsafe { _kept.0.get().cast::<u32>().add(at % WORDS) }
}

pub(super) fn read(at: usize) -> u32 {
    // SAFETY: a word of RAM, which may hold any value. Volatile, because the value may be older than this start.
    unsafe { ptr::read_volatile(word(at)) }
}

/// Writes a word. Writes reach the memory in their order in the program.
fn write(at: usize, value: u32) {
    // SAFETY: a word of RAM to which no reference exists.
    unsafe { ptr::write_volatile(word(at), value) }
}

fn live(at: usize) -> u32 {
    live::number([read(at), read(at + 1)])
}

fn set_live(at: usize, number: u32) {
    write(at, number);
    write(at + 1, !number);
}

/// Changes the sealed part: notes a fault, if there is one, and then replaces the bits of `mask` in a word. Without a
/// valid copy clears the rest of the region first.
#[inline(never)]
pub(super) fn update(fault: Option<&Fault>, word: usize, mask: u32, bits: u32) {
    let mut sealed = Sealed::after_power_on();
    let in_force = sealed.load(read);
    if in_force.is_none() {
        (UPTIME..WORDS).for_each(|at| write(at, 0));
    }
    if let Some(fault) = fault {
        let missing = if fault.kind == Kind::Watchdog {
            missing()
        } else {
            0
        };
        let uptime = live(UPTIME).wrapping_sub(STARTED_S.load(Ordering::Relaxed));
        sealed.note(fault, uptime, missing);
    }
    sealed.set(word, mask, bits);
    sealed.store(in_force.unwrap_or_default(), write);
}

/// Makes the region count as after power-on.
pub(crate) fn forget() {
    write(0, 0);
    write(COPY, 0);
}

/// Prepares the region for this start, and returns the content of the sealed part and the seconds since power-on. A reset
/// by the watchdog is noted when nothing else was. The board calls this once at every start, before it starts the crystal, because the content
/// has the number of crystal failures.
pub(crate) fn at_start(by_watchdog: bool) -> (Sealed, u32) {
    let fault = Fault {
        kind: Kind::Watchdog,
        ..Fault::default()
    };
    // The fault was one of the run before.
    STARTED_S.store(read(sealed::STARTED), Ordering::Relaxed);
    update(by_watchdog.then_some(&fault), FLAGS, FRESH | ASKED, 0);
    let started = live(UPTIME);
    STARTED_S.store(started, Ordering::Relaxed);
    let marks = marks().iter();
    marks.for_each(|mark| mark.store(0, Ordering::Relaxed));
    // Both copies are valid now.
    (Sealed::copy(0, read), started)
}

/// Returns the reset flags that the loader kept, once, and whether it trusts the development key.
pub(crate) fn take_cause() -> (u8, bool) {
    let cause = read(CAUSE);
    update(None, CAUSE, UNSEEN, 0);
    (cause as u8 & 0b11_1111, cause & DEVELOPMENT != 0)
}

/// Returns whether this start is one as with SW01 = 255, once.
pub(crate) fn take_as_255() -> bool {
    let as_255 = read(FLAGS) & AS_255 != 0;
    if as_255 {
        update(None, FLAGS, AS_255, 0);
    }
    as_255
}

/// Notes a fault. For panic and fault handlers. Only the first fault since the start is noted.
pub fn note(fault: &Fault) {
    update(Some(fault), FLAGS, 0, 0);
}

/// Keeps SW01 as read at power-on.
pub(crate) fn keep_dip(dip: u8) {
    update(None, FLAGS, DIP, HAS_DIP | u32::from(dip));
}

/// Keeps that every start until the next power-on is one of recovery, as with SW01 = 255. For the background task.
pub fn keep_recovery() {
    keep_dip(u8::MAX);
}

/// Keeps the number of saves that the firmware may still write to flash. For the background task.
pub fn keep_saves(left: u8) {
    keep(SAVES, sealed::saves(left));
}

/// Keeps the number of records of outputs that the firmware may still write to flash. For the background task.
pub fn keep_records(left: u8) {
    keep(RECORDS, sealed::records(left));
}

/// Returns the number of records of outputs left, 255 after power-on.
#[must_use]
pub fn records() -> u8 {
    sealed::records_of(read(FLAGS))
}

/// Keeps bits of the flags, if they have changed.
fn keep(mask: u32, bits: u32) {
    if read(FLAGS) & mask != bits {
        update(None, FLAGS, mask, bits);
    }
}

/// Keeps that the restart that now follows was asked for. For the background task.
pub fn keep_asked() {
    update(None, FLAGS, 0, ASKED);
}

/// Keeps that the restart that now follows is one as with SW01 = 255. For the background task.
pub fn keep_as_255() {
    update(None, FLAGS, 0, AS_255);
}

/// Ends the choice of SW01 = 254. For the background task.
pub fn end_choice() {
    update(None, FLAGS, CHOSEN, 0);
}

/// Keeps the seconds since power-on. For the scan, at least once a second.
pub fn keep_uptime(seconds: u32) {
    set_live(UPTIME, seconds);
}

/// Returns the first word of a slot's pulse counters.
fn pulses_of(slot: usize) -> usize {
    PULSES + 8 * slot
}

/// Returns the pulse counters of a slot, counted from 0, as they were kept. 0 after power-on.
#[must_use]
pub fn pulses(slot: usize) -> [u32; 4] {
    array::from_fn(|channel| live(pulses_of(slot) + 2 * channel))
}

/// Keeps the pulse counters of a slot. For the scan, after every change.
pub fn keep_pulses(slot: usize, pulses: &[u32; 4]) {
    for (pair, pulses) in pulses.iter().enumerate() {
        set_live(pulses_of(slot) + 2 * pair, *pulses);
    }
}

/// Returns the half-word of a point, 0 to 31.
fn half_word(point: usize) -> *mut u16 {
    // SAFETY: the half-words lie in words of the region. The low half of a word is the first one.
    unsafe { word(OUTPUTS).cast::<u16>().add(point % POINTS) }
}

/// Returns what the outputs had at the reset, before the first [`keep_output`]: the half-word of each point, the modules
/// that were in force, the outputs that a link held, and those that were at SAFE. `None` after a power-on, and after an image
/// that does not keep outputs.
#[must_use]
pub fn outputs() -> Option<([u16; POINTS], u32, u32, u32)> {
    // SAFETY: a half-word of RAM, which may hold any value. Volatile, because the value may be older than this start.
    let values = array::from_fn(|point| unsafe { ptr::read_volatile(half_word(point)) });
    let valid = Sealed::copy(0, read).has_outputs();
    valid.then(|| (values, read(MODULES), read(HELD), read(AT_SAFE)))
}

/// Keeps the half-word of an output, 0 to 31. For the scan, after every change.
pub fn keep_output(point: usize, value: u16) {
    // SAFETY: a half-word of RAM to which no reference exists.
    unsafe { ptr::write_volatile(half_word(point), value) }
}

/// Keeps which outputs a link holds, and which are at SAFE. For the scan, after every change.
pub fn keep_held([held, at_safe]: [u32; 2]) {
    write(HELD, held);
    write(AT_SAFE, at_safe);
}

/// Makes the outputs those of this run, with these modules in force. For the start, after all half-words have been kept.
pub fn keep_outputs(modules: u32) {
    write(MODULES, modules);
    let started = STARTED_S.load(Ordering::Relaxed);
    update(None, sealed::STARTED, u32::MAX, started);
}

/// Returns the marks of the tasks, all 0 after the start. After a watchdog reset the next start reports every task
/// as missing whose mark is not [`ENDED`]. Each task stores its own mark; the code that refreshes the watchdog clears
/// all of them.
#[must_use]
pub fn marks() -> &'static [AtomicU8; TASKS] {
    // SAFETY: the last words of the region, aligned and long enough. Any byte is a valid `AtomicU8`, and every access
    // to these words is one to the atomics.
    unsafe { &*word(MARKS).cast() }
}

/// Returns one bit for each task whose mark does not say that it has run to its end.
fn missing() -> u16 {
    let marks = marks().iter().map(|mark| mark.load(Ordering::Relaxed));
    let missing = marks.enumerate().filter(|(_, mark)| *mark != ENDED);
    missing.fold(0, |missing, (task, _)| missing | 1 << task)
}
