//! The lines on which the suite tests a unit: raw bytes on one serial line, over different connections.

pub mod exact_line;
#[cfg(feature = "sim")]
pub mod sim;
pub mod stream;
pub mod trace;

use std::time::Duration;

use modbus_line::LineFormat;

use crate::frame::hex;

/// Something to send. Where time is exact, a gap has exactly the length asked for; elsewhere it may be longer. Damaged
/// characters, breaks and glitches need [`Abilities::faults`].
pub use modbus_line::exact::Piece;

/// Returns pieces as text for people. Pieces that repeat, alone or in pairs, are shown once with their number.
pub(crate) fn shown(pieces: &[Piece]) -> String {
    let texts: Vec<String> = pieces
        .iter()
        .map(|piece| match piece {
            Piece::Bytes(bytes) => hex(bytes),
            Piece::Gap(gap) => format!("({} us of silence)", gap.as_micros()),
            Piece::BadParity(byte) => format!("{byte:02X} (wrong parity)"),
            Piece::BadStop(byte) => format!("{byte:02X} (stop bit low)"),
            Piece::Break(bits) => format!("(break of {bits} bits)"),
            Piece::Glitch(width) => format!("(glitch of {} us)", width.as_micros()),
        })
        .collect();
    folded(&texts)
}

/// Number of repetitions from which on texts are shown once.
const MANY: usize = 4;

/// Joins texts. A text, or a pair of texts, that is repeated many times is there once with the number of times.
fn folded(texts: &[String]) -> String {
    let (mut parts, mut rest) = (Vec::new(), texts);
    while let [first, ..] = rest {
        let times = |length: usize| {
            let mut all = rest.chunks(length);
            all.position(|chunk| *chunk != rest[..length])
                .unwrap_or(rest.len() / length)
        };
        let repeated = (1..=rest.len().min(2)).find(|length| times(*length) >= MANY);
        let taken = match repeated {
            Some(length) => {
                parts.push(format!(
                    "{} x [{}]",
                    times(length),
                    rest[..length].join(" ")
                ));
                times(length) * length
            }
            None => {
                parts.push(first.clone());
                1
            }
        };
        rest = &rest[taken..];
    }
    parts.join(" ")
}

/// A received character, with the times of the endpoint's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// The data.
    pub byte: u8,
    /// Begin of the start bit.
    pub start: Duration,
    /// End of the last stop bit.
    pub end: Duration,
    /// Parity, stop bits and levels were right, as far as the endpoint checks them.
    pub good: bool,
}

/// What an endpoint can do. With none of these it sends and receives bytes, with silences of at least the length asked
/// for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Abilities {
    /// Its times are exact to a microsecond, including the gaps between the bytes that it sends.
    pub exact: bool,
    /// It can send damaged characters, breaks and glitches.
    pub faults: bool,
    /// It can switch the unit's power off and on.
    pub power: bool,
    /// It records when the unit's driver is switched on and off.
    pub driver: bool,
    /// It can let the unit receive its own frames, as with DE and RE tied together.
    pub echo: bool,
    /// It can change its rate and format.
    pub set_line: bool,
    /// Characters that the unit sends have their duration on its line.
    pub character_time: bool,
    /// The unit detects a character at its start bit, not only at its end.
    pub start_bit: bool,
    /// A request may get lost on the way to the unit: it is repeated once when a due reply is missing.
    pub asks_again: bool,
}

/// Error when the endpoint no longer works, or cannot do what was asked: the reason in one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Broken(pub String);

/// The master's end of a serial line. Its clock starts at 0, at an instant before the first call.
///
/// # Errors
///
/// Every method fails with [`Broken`] when the line no longer works, or when the endpoint does not have the ability
/// that the method needs.
pub trait Endpoint {
    /// Its name for people, such as `the simulator, 4do`.
    fn name(&self) -> String;

    /// Its abilities.
    fn abilities(&self) -> Abilities;

    /// Returns the rate and format of the line, as set or as given by the user.
    fn line(&self) -> LineFormat;

    /// Changes rate and format.
    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken>;

    /// Returns the time of its clock.
    fn now(&self) -> Duration;

    /// Lets time pass.
    fn rest(&mut self, time: Duration) -> Result<(), Broken>;

    /// Sends pieces. Returns the end of the last stop bit: measured where time is exact, estimated elsewhere.
    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken>;

    /// Returns the characters received since the last call, and those that follow until the line is silent for `quiet`.
    /// Returns early after `enough` characters, and with none when none is received within `patience`.
    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Received>, Broken>;

    /// Discards the characters that were received and not yet returned by `receive`, such as those of a late reply,
    /// and returns them. Does nothing where time is exact: there a late character is a finding.
    fn flush(&mut self) -> Result<Vec<Received>, Broken> {
        Ok(Vec::new())
    }

    /// Switches the unit's power. After switching on, the unit starts while time passes.
    fn set_power(&mut self, _on: bool) -> Result<(), Broken> {
        Err(Broken("this endpoint cannot switch the power".to_owned()))
    }

    /// Switches the echo: whether the unit receives its own frames.
    fn set_echo(&mut self, _echo: bool) -> Result<(), Broken> {
        Err(Broken("this endpoint has no echo to switch".to_owned()))
    }

    /// When the unit's driver was switched on and off since the last call.
    fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken> {
        Err(Broken(
            "this endpoint does not record the driver".to_owned(),
        ))
    }

    /// Returns what the firmware has done since the last call that a real part would not accept, such as a byte that
    /// was lost because the driver was off. Only a simulator reports this.
    fn take_complaints(&mut self) -> Result<Vec<String>, Broken> {
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_that_repeat_are_shown_once_with_their_number() {
        let gap = |us| Piece::Gap(Duration::from_micros(us));
        let glitch = Piece::Glitch(Duration::from_micros(5));
        let mut pieces = vec![Piece::Bytes(vec![1, 3]), gap(104), glitch.clone()];
        for _ in 0..399 {
            pieces.extend([gap(200), glitch.clone()]);
        }
        assert_eq!(
            shown(&pieces),
            "01 03 (104 us of silence) 399 x [(glitch of 5 us) (200 us of silence)] (glitch of 5 us)"
        );
        let breaks = [vec![Piece::Break(10); 400], vec![gap(1), gap(1)]].concat();
        assert_eq!(
            shown(&breaks),
            "400 x [(break of 10 bits)] (1 us of silence) (1 us of silence)"
        );
        assert_eq!(shown(&[]), "");
    }
}
