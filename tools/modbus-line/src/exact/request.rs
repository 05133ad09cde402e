//! Requests of a client.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use super::time::{Micros, parse};
use super::{LONGEST_LINE, LONGEST_RUN};

/// Something to send on the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Characters without a gap between them.
    Bytes(Vec<u8>),
    /// Silence.
    Gap(Duration),
    /// A character whose parity bit is wrong. Needs a format with parity.
    BadParity(u8),
    /// A character whose stop bits are low.
    BadStop(u8),
    /// The line is low for 1 to 15 bits, then high for one.
    Break(u8),
    /// The line is inverted for this time.
    Glitch(Duration),
}

/// A request line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Asks for the description of the server; the number is the newest version of the protocol that the client
    /// knows.
    Hello(u32),
    /// Sends pieces on the line, one after another, and lets time pass until the last one has ended.
    Send(Vec<Piece>),
    /// Lets time pass.
    Run(Duration),
    /// Changes the baud rate, in bit/s, and the format, such as `8E1`, of the master's end.
    Line(u32, String),
    /// Switches the unit's power.
    Power(bool),
    /// Resets the unit by its reset pin.
    Reset,
    /// Selects whether the unit receives what it sends.
    Echo(bool),
    /// Asks for actions of the unit that could damage or disturb a real part.
    Findings,
}

impl fmt::Display for Piece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bytes(bytes) => bytes.iter().try_for_each(|byte| write!(f, "{byte:02X}")),
            Self::Gap(time) => write!(f, "gap:{}", Micros(*time)),
            Self::BadParity(byte) => write!(f, "parity:{byte:02X}"),
            Self::BadStop(byte) => write!(f, "stop:{byte:02X}"),
            Self::Break(bits) => write!(f, "break:{bits}"),
            Self::Glitch(time) => write!(f, "glitch:{}", Micros(*time)),
        }
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let switch = |on: &bool| if *on { "on" } else { "off" };
        match self {
            Self::Hello(version) => write!(f, "hello {version}"),
            Self::Send(pieces) => {
                f.write_str("send")?;
                pieces
                    .iter()
                    // An empty piece has no text.
                    .filter(|piece| !matches!(piece, Piece::Bytes(bytes) if bytes.is_empty()))
                    .try_for_each(|piece| write!(f, " {piece}"))
            }
            Self::Run(time) => write!(f, "run {}", Micros(*time)),
            Self::Line(baud, format) => write!(f, "line {baud} {format}"),
            Self::Power(on) => write!(f, "power {}", switch(on)),
            Self::Reset => f.write_str("reset"),
            Self::Echo(on) => write!(f, "echo {}", switch(on)),
            Self::Findings => f.write_str("findings"),
        }
    }
}

impl FromStr for Piece {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((kind, value)) = text.split_once(':') else {
            return bytes(text).map(Self::Bytes);
        };
        let byte = || match bytes(value)?[..] {
            [byte] => Ok(byte),
            _ => Err(format!("{value:?} is not one byte in hexadecimal")),
        };
        match kind {
            "gap" => parse(value).map(Self::Gap),
            "parity" => byte().map(Self::BadParity),
            "stop" => byte().map(Self::BadStop),
            "break" => match value.parse() {
                Ok(bits @ 1..=15) if value.starts_with(|c: char| c.is_ascii_digit()) => {
                    Ok(Self::Break(bits))
                }
                _ => Err(format!("{value:?} is not a number of bits from 1 to 15")),
            },
            "glitch" => parse(value).map(Self::Glitch),
            _ => Err(format!(
                "{kind:?} is not a piece: use hexadecimal bytes, gap, parity, stop, break or glitch"
            )),
        }
    }
}

fn bytes(text: &str) -> Result<Vec<u8>, String> {
    let digits: Option<Vec<u8>> = text
        .chars()
        .map(|c| c.to_digit(16).and_then(|digit| u8::try_from(digit).ok()))
        .collect();
    match digits {
        Some(digits) if !digits.is_empty() && digits.len().is_multiple_of(2) => {
            Ok(digits.chunks(2).map(|two| two[0] << 4 | two[1]).collect())
        }
        _ => Err(format!(
            "{:?} is not an even number of hexadecimal digits",
            shortened(text)
        )),
    }
}

/// Returns the beginning of a text that may be very long.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

impl FromStr for Request {
    type Err = String;

    /// Parses a request line without its line end.
    fn from_str(line: &str) -> Result<Self, String> {
        if line.len() > LONGEST_LINE {
            return Err(format!("the line is longer than {LONGEST_LINE} characters"));
        }
        let mut words = line.split(' ').filter(|word| !word.is_empty());
        let Some(name) = words.next() else {
            return Err("the line is empty: a request such as hello 1 is expected".to_owned());
        };
        let words: Vec<&str> = words.collect();
        let takes = |what: &str| Err(format!("{name} takes {what}"));
        match (name, &words[..]) {
            ("hello", [version]) => match version.parse() {
                Ok(version @ 1..) => Ok(Self::Hello(version)),
                _ => Err(format!(
                    "{version:?} is not a version of the protocol, such as 1"
                )),
            },
            ("hello", _) => takes("the newest version that the client knows"),
            ("send", []) => takes("at least one piece"),
            ("send", words) => words
                .iter()
                .map(|word| word.parse())
                .collect::<Result<_, _>>()
                .map(Self::Send),
            ("run", [time]) => match parse(time)? {
                time if time <= LONGEST_RUN => Ok(Self::Run(time)),
                _ => Err(format!(
                    "{time} us is more than {} us",
                    LONGEST_RUN.as_micros()
                )),
            },
            ("run", _) => takes("a time in microseconds"),
            ("line", [baud, format]) => match baud.parse() {
                Ok(baud @ 1..) => Ok(Self::Line(baud, (*format).to_owned())),
                _ => Err(format!("{baud:?} is not a rate in bit/s")),
            },
            ("line", _) => takes("a rate and a format, such as 9600 8N2"),
            ("power", ["on"]) => Ok(Self::Power(true)),
            ("power", ["off"]) => Ok(Self::Power(false)),
            ("echo", ["on"]) => Ok(Self::Echo(true)),
            ("echo", ["off"]) => Ok(Self::Echo(false)),
            ("power" | "echo", _) => takes("on or off"),
            ("reset", []) => Ok(Self::Reset),
            ("findings", []) => Ok(Self::Findings),
            ("reset" | "findings", _) => takes("no arguments"),
            _ => Err(format!(
                "{:?} is not a request: use hello, send, run, line, power, reset, echo or findings",
                shortened(name)
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_request_is_parsed_as_it_was_written() {
        let us = Duration::from_nanos;
        for request in [
            Request::Hello(1),
            Request::Send(vec![
                Piece::Bytes(vec![1, 0xAB]),
                Piece::Gap(us(4_010_417)),
                Piece::BadParity(0x5A),
                Piece::BadStop(0),
                Piece::Break(15),
                Piece::Glitch(us(1)),
            ]),
            Request::Run(us(25_000_000)),
            Request::Line(19_200, "8E1".to_owned()),
            Request::Power(true),
            Request::Power(false),
            Request::Reset,
            Request::Echo(true),
            Request::Echo(false),
            Request::Findings,
        ] {
            assert_eq!(request.to_string().parse(), Ok(request));
        }
    }

    #[test]
    fn lines_with_extra_spaces_and_lower_case_are_parsed() {
        let typed: Request = "  send  01ab   gap:10  FF ".parse().unwrap();
        let pieces = vec![
            Piece::Bytes(vec![1, 0xAB]),
            Piece::Gap(Duration::from_micros(10)),
            Piece::Bytes(vec![0xFF]),
        ];
        assert_eq!(typed, Request::Send(pieces));
    }

    #[test]
    fn bad_lines_are_rejected_with_a_reason() {
        let long = format!("send {}", "00".repeat(LONGEST_LINE / 2));
        for (line, reason) in [
            ("", "empty"),
            ("   ", "empty"),
            ("go", "\"go\" is not a request"),
            ("SEND 01", "not a request"),
            ("hello", "newest version"),
            ("hello 0", "\"0\""),
            ("hello x", "\"x\""),
            ("send", "at least one piece"),
            ("send 1", "even number"),
            ("send 0x01", "even number"),
            ("send 01 zz", "\"zz\""),
            ("send \u{e9}\u{e9}", "even number"),
            ("send wait:1", "\"wait\" is not a piece"),
            ("send gap:-1", "\"-1\""),
            ("send parity:0102", "not one byte"),
            ("send break:0", "1 to 15"),
            ("send break:+3", "1 to 15"),
            ("send break:16", "1 to 15"),
            ("run", "a time"),
            ("run 1 2", "a time"),
            ("run 1.0001", "1.0001"),
            ("run 600000001", "600000000"),
            ("line 9600", "9600 8N2"),
            ("line fast 8N2", "\"fast\""),
            ("power", "on or off"),
            ("echo maybe", "on or off"),
            ("reset now", "no arguments"),
            (&long, "longer than"),
        ] {
            let error = line.parse::<Request>().unwrap_err();
            assert!(error.contains(reason), "{line:.20}: {error}");
            assert!(!error.contains('\n') && error.len() < 200, "{error}");
        }
    }
}
