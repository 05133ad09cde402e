//! Ctrl-C and SIGTERM: noted, so that what is under way ends and the unit is put back; the second time
//! the program ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

/// The exit status of a program that Ctrl-C ended, as shells have it.
pub const STATUS: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);

/// From now on these signals are noted; gives where.
///
/// # Errors
///
/// When the system has no such handler left, in one line.
pub fn catch() -> Result<&'static AtomicBool, String> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(STATUS));
        }
        eprintln!("interrupted: ending what is under way and putting the unit back; once more to end at once");
    })
    .map_err(|error| format!("no handler for Ctrl-C: {error}"))?;
    Ok(&ASKED)
}
