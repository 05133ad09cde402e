//! In place of the pseudo-terminal, on systems where the simulator has none: `sim_options::PTY`.

use std::path::Path;
use std::sync::mpsc::Sender;

use super::Event;

/// The terminal that there is not.
pub struct Pty;

impl Pty {
    /// Makes none. That a link was asked for has been refused before.
    ///
    /// # Errors
    ///
    /// Never.
    #[allow(clippy::unnecessary_wraps, reason = "a terminal may not be made")]
    pub fn open(_: Option<&Path>, _: Sender<Event>) -> Result<Self, String> {
        Ok(Self)
    }

    /// There is none.
    pub fn path(&self) -> Option<&Path> {
        None
    }

    /// There is no rate.
    ///
    /// # Errors
    ///
    /// Never.
    #[allow(clippy::unnecessary_wraps, reason = "a terminal may not take a rate")]
    pub fn keep_own_rate(&mut self, _: u32) -> Result<(), String> {
        Ok(())
    }

    /// Nobody sets a rate.
    pub fn take_rate(&mut self) -> Option<u32> {
        None
    }

    /// Nobody reads it.
    pub fn write(&self, _: &[u8]) {}
}
