//! Ctrl-C and SIGTERM. The first one sets a flag, so that the running case can end and the unit is restored. The second
//! one ends the program immediately.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result};

/// The exit status that shells use for a program that Ctrl-C ended.
pub const STATUS: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);

/// Catches these signals from now on. Returns the flag that they set.
pub fn catch() -> Result<&'static AtomicBool> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(STATUS));
        }
        eprintln!("interrupted: the running case ends and the unit is restored; press Ctrl-C again to end immediately");
    })
    .context("cannot install a handler for Ctrl-C")?;
    Ok(&ASKED)
}
