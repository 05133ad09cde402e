//! What the suite speaks through: raw bytes to one serial line, whatever carries them.

pub mod exact_line;
#[cfg(feature = "sim")]
pub mod sim;
pub mod stream;
pub mod trace;

use std::time::Duration;

use crate::line::LineFormat;

/// Something to put on the line. A gap lasts exactly as long as asked where time is exact, elsewhere at least
/// as long. Damaged characters, breaks and glitches need [`Abilities::faults`].
pub use ::exact_line::Piece;

/// A character that came, by the endpoint's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Its data.
    pub byte: u8,
    /// Its start bit.
    pub start: Duration,
    /// The end of its last stop bit.
    pub end: Duration,
    /// Parity, stop bits and levels were right, as far as the endpoint can tell.
    pub good: bool,
}

/// What an endpoint can do. All `false`: raw bytes, and silences that last at least as long as asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Abilities {
    /// Its times are exact to a microsecond, those of gaps inside what it sends included.
    pub exact: bool,
    /// It can send damaged characters, breaks and glitches.
    pub faults: bool,
    /// It can cut and restore the unit's power.
    pub power: bool,
    /// It sees when the unit's driver goes on and off.
    pub driver: bool,
    /// It can let the unit hear itself, as with DE and RE tied together.
    pub echo: bool,
    /// It can change its rate and format.
    pub set_line: bool,
    /// Characters that the unit sends take their time on its line.
    pub character_time: bool,
    /// The unit notices a start bit when it begins, not only when the character has ended.
    pub start_bit: bool,
    /// A request may get lost on the way to the unit: it is sent once more when a due reply does not come.
    pub asks_again: bool,
}

/// Error when the endpoint no longer works, or cannot do what was asked: the reason in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Broken(pub String);

/// A master's end of a serial line. Its clock starts at 0 some time before the first call.
///
/// Every method fails with [`Broken`] when the line is gone, and those that need an ability when it is
/// not there.
pub trait Endpoint {
    /// What it is, for people: `the simulator, 4do`.
    fn name(&self) -> String;

    /// What it can do.
    fn abilities(&self) -> Abilities;

    /// The rate and format it speaks, or is told that the line has.
    fn line(&self) -> LineFormat;

    /// Changes rate and format.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken>;

    /// The time.
    fn now(&self) -> Duration;

    /// Lets time pass.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn rest(&mut self, time: Duration) -> Result<(), Broken>;

    /// Sends, and returns with the end of the last stop bit: measured when time is exact, else estimated.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken>;

    /// What has come since the last call, and what comes until `quiet` has passed in silence; gives up
    /// after `patience` without a character. Stops early at `enough` characters.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn hear(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Heard>, Broken>;

    /// Discards the characters that were received and not yet returned by `hear`, such as those of a late reply,
    /// and returns them. Does nothing where time is exact: there a late character is a finding.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn flush(&mut self) -> Result<Vec<Heard>, Broken> {
        Ok(Vec::new())
    }

    /// Switches the unit's power. After switching on, the unit starts while time passes.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn set_power(&mut self, _on: bool) -> Result<(), Broken> {
        Err(Broken("this endpoint cannot switch the power".to_owned()))
    }

    /// Lets the unit hear itself, or not.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn set_echo(&mut self, _echo: bool) -> Result<(), Broken> {
        Err(Broken("this endpoint has no echo to switch".to_owned()))
    }

    /// When the unit's driver went on and off since the last call.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken> {
        Err(Broken("this endpoint does not see the driver".to_owned()))
    }

    /// What the unit's parts complain about since the last call, such as a byte lost because the driver
    /// was off: only a simulator knows.
    ///
    /// # Errors
    ///
    /// See the trait.
    fn take_complaints(&mut self) -> Result<Vec<String>, Broken> {
        Ok(Vec::new())
    }
}
