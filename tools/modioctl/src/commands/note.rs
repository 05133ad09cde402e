//! What a command has done so far. Ctrl-C and a failure print it, because a command that ends in the middle has changed
//! something.

use std::cell::RefCell;
use std::fmt::Display;

use crate::failure::Failure;

/// What the user does about settings that are written and not saved.
pub const UNDO: &str = " and nothing is saved: `modioctl reboot` brings the saved settings back";

/// What the command has done so far; empty if that needs no words.
#[derive(Debug, Default)]
pub struct Note(RefCell<String>);

impl Note {
    /// Returns the text.
    pub fn text(&self) -> String {
        self.0.borrow().clone()
    }

    /// Sets the text.
    pub fn set(&self, text: impl Display) {
        self.0.replace(text.to_string());
    }

    /// Waits for a request that changes something. `unknown` is what holds without an answer, and `refused` what holds
    /// when the unit has answered with an exception.
    pub async fn during<T>(
        &self,
        unknown: impl Display,
        refused: impl Display,
        request: impl Future<Output = Result<T, Failure>>,
    ) -> Result<T, Failure> {
        self.set(unknown);
        let result = request.await;
        if matches!(result, Err(Failure::Refused(_))) {
            self.set(refused);
        }
        result
    }
}

/// Values that are being written.
pub struct Progress<'a> {
    note: &'a Note,
    what: &'static str,
    /// What follows from values that are written.
    then: &'static str,
    /// Number of values that are written.
    pub done: usize,
    /// Number of values that are to be written.
    pub all: usize,
}

impl<'a> Progress<'a> {
    /// Begins to write this number of settings.
    pub fn of_settings(note: &'a Note, all: usize) -> Self {
        Self::begin(note, "settings", UNDO, all)
    }

    /// Begins to write this number of values, of which some may be settings.
    pub fn of_values(note: &'a Note, all: usize, has_settings: bool) -> Self {
        let then = if has_settings { UNDO } else { "" };
        Self::begin(note, "values", then, all)
    }

    fn begin(note: &'a Note, what: &'static str, then: &'static str, all: usize) -> Self {
        let progress = Self {
            note,
            what,
            then,
            done: 0,
            all,
        };
        note.set(progress.text(false));
        progress
    }

    /// Waits for the request that writes this number of values.
    pub async fn write(
        &mut self,
        count: usize,
        request: impl Future<Output = Result<(), Failure>>,
    ) -> Result<(), Failure> {
        let [unknown, refused] = [true, false].map(|perhaps| self.text(perhaps));
        self.note.during(unknown, refused, request).await?;
        self.done += count;
        self.note.set(self.text(false));
        Ok(())
    }

    /// Describes how much is written. With `perhaps` there is a request whose answer is missing.
    fn text(&self, perhaps: bool) -> String {
        let Self {
            what,
            then,
            done,
            all,
            ..
        } = self;
        let at_least = if perhaps { "at least " } else { "" };
        match done {
            0 if perhaps => format!("some of the {what} may be written{then}"),
            0 => "nothing is written".to_owned(),
            done if done == all => format!("all {what} are written{then}"),
            done => format!("{at_least}{done} of {all} {what} are written{then}"),
        }
    }
}
