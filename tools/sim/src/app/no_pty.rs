//! Replaces the pseudo-terminal on systems where the simulator has none (`sim::options::PTY`). Nothing is ever
//! received.

use std::path::Path;
use std::sync::mpsc::Sender;

use super::{Event, Hold};

/// A missing pseudo-terminal, with the methods of the real one.
pub struct Pty;

impl Pty {
    /// Opens nothing. The options have refused `--pty`, `--lora` and `--rs232` before.
    ///
    /// # Errors
    ///
    /// Never.
    #[allow(clippy::unnecessary_wraps, reason = "opening a real terminal may fail")]
    pub fn open(
        _: Option<&Path>,
        _: Sender<Event>,
        _: fn(Vec<u8>, Hold) -> Event,
    ) -> Result<Self, String> {
        Ok(Self)
    }

    /// Returns `None`: there is no terminal.
    pub fn path(&self) -> Option<&Path> {
        None
    }

    /// Does nothing: no master can set a rate.
    ///
    /// # Errors
    ///
    /// Never.
    #[allow(
        clippy::unnecessary_wraps,
        reason = "a real terminal may refuse a rate"
    )]
    pub fn keep_own_rate(&mut self, _: u32) -> Result<(), String> {
        Ok(())
    }

    /// Returns `None`: no master can set a rate.
    pub fn take_rate(&mut self) -> Option<u32> {
        None
    }

    /// Drops the bytes.
    pub fn write(&self, _: &[u8]) {}
}
