//! Replies of a server.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use super::VERSION;
use super::request::Request;
use super::time::{Micros, parse};

/// An ability of a server or of its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ability {
    /// It changes rate and format of the master's end.
    Line,
    /// It sends damaged characters, breaks and glitches.
    Faults,
    /// It switches the unit's power.
    Power,
    /// It resets the unit.
    Reset,
    /// It can let the unit receive its own frames.
    Echo,
    /// It reports when the unit's driver is switched.
    Driver,
    /// Characters that the unit sends have a duration on the line.
    CharacterTime,
    /// The unit detects a start bit when it begins.
    StartBit,
    /// It reports actions of the unit that could damage or disturb a real part.
    Findings,
}

impl Ability {
    /// Every ability.
    pub const ALL: [Self; 9] = [
        Self::Line,
        Self::Faults,
        Self::Power,
        Self::Reset,
        Self::Echo,
        Self::Driver,
        Self::CharacterTime,
        Self::StartBit,
        Self::Findings,
    ];

    /// Returns the name in the protocol.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Faults => "faults",
            Self::Power => "power",
            Self::Reset => "reset",
            Self::Echo => "echo",
            Self::Driver => "driver",
            Self::CharacterTime => "character-time",
            Self::StartBit => "start-bit",
            Self::Findings => "findings",
        }
    }
}

/// Description of the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Rate of the master's end in bit/s.
    pub baud: u32,
    /// Format of the master's end, such as `8N2`.
    pub format: String,
    /// Abilities of the server. A client ignores abilities that it does not know.
    pub abilities: BTreeSet<Ability>,
    /// Name of the server, for people.
    pub name: String,
}

/// An event on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The unit sent a byte.
    Byte {
        /// The data of the byte.
        byte: u8,
        /// Beginning of the start bit.
        start: Duration,
        /// End of the last stop bit.
        end: Duration,
        /// Whether parity and stop bits were correct.
        good: bool,
    },
    /// The unit switched its driver.
    Driver {
        /// Time of the event.
        at: Duration,
        /// Whether the driver was on afterwards.
        on: bool,
    },
    /// A reply of the unit has ended.
    Silence {
        /// Time at which the driver was switched off.
        at: Duration,
        /// Longest silence between two bytes of the reply.
        longest: Duration,
    },
}

impl Event {
    /// Returns the time at which the event was complete.
    #[must_use]
    pub const fn at(&self) -> Duration {
        match self {
            Self::Byte { end, .. } => *end,
            Self::Driver { at, .. } | Self::Silence { at, .. } => *at,
        }
    }
}

/// Reply to a request that the server has executed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// To `hello`.
    Hello(Duration, Hello),
    /// To `send` and `run`: the time, and every event since the last such reply.
    Events(Duration, Vec<Event>),
    /// To `findings`.
    Findings(Duration, Vec<String>),
    /// To all others.
    Done(Duration),
}

impl Reply {
    /// Returns the time after the request.
    #[must_use]
    pub const fn now(&self) -> Duration {
        match self {
            Self::Hello(now, _)
            | Self::Events(now, _)
            | Self::Findings(now, _)
            | Self::Done(now) => *now,
        }
    }

    /// Parses the reply line to `request`.
    ///
    /// # Errors
    ///
    /// The server's reason after `error`, or a description of what is wrong with the line.
    pub fn read(request: &Request, line: &str) -> Result<Self, String> {
        let strange = || format!("the server replied {line:?} to {request}");
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "ok" => {}
            "error" => return Err(rest.to_owned()),
            _ => return Err(strange()),
        }
        let (now, rest) = rest.split_once(' ').unwrap_or((rest, ""));
        let now = parse(now).map_err(|_| strange())?;
        match request {
            Request::Hello(_) => hello(rest).map(|hello| Self::Hello(now, hello)),
            Request::Send(_) | Request::Run(_) => {
                let words = rest.split(' ').filter(|word| !word.is_empty());
                let events: Option<Vec<Option<Event>>> = words.map(event).collect();
                let known = events.ok_or_else(strange)?.into_iter().flatten();
                Ok(Self::Events(now, known.collect()))
            }
            Request::Findings => {
                let findings = rest
                    .split('|')
                    .map(str::trim)
                    .filter(|text| !text.is_empty());
                Ok(Self::Findings(now, findings.map(str::to_owned).collect()))
            }
            Request::Line(..) | Request::Power(_) | Request::Reset | Request::Echo(_) => {
                Ok(Self::Done(now))
            }
        }
    }
}

fn hello(text: &str) -> Result<Hello, String> {
    let value = |key: &str| {
        let at = text.split(' ').find_map(|word| word.strip_prefix(key));
        at.ok_or_else(|| format!("the server's hello has no {key}"))
    };
    let version = value("version=")?;
    if version != VERSION.to_string() {
        return Err(format!(
            "the server speaks version {version} of the protocol, not {VERSION}"
        ));
    }
    let line = value("line=")?;
    let (baud, format) = line
        .split_once(',')
        .and_then(|(baud, format)| Some((baud.parse().ok()?, format.to_owned())))
        .ok_or_else(|| {
            format!("{line:?} in the server's hello is not a rate and format such as 9600,8N2")
        })?;
    let abilities = value("abilities=")?;
    let known = |ability: &Ability| abilities.split(',').any(|name| name == ability.name());
    let name = text.split_once("name=").map_or("", |(_, name)| name);
    Ok(Hello {
        baud,
        format,
        abilities: Ability::ALL.into_iter().filter(known).collect(),
        name: name.to_owned(),
    })
}

/// Parses an event. Returns `Some(None)` for an unknown kind of event.
fn event(word: &str) -> Option<Option<Event>> {
    let (what, when) = word.split_once('@')?;
    match what {
        "driver-on" | "driver-off" => Some(Some(Event::Driver {
            at: parse(when).ok()?,
            on: what == "driver-on",
        })),
        _ if what.starts_with("silence-") => Some(Some(Event::Silence {
            at: parse(when).ok()?,
            longest: parse(&what["silence-".len()..]).ok()?,
        })),
        _ if what.len() == 2 => {
            let byte = u8::from_str_radix(what, 16).ok()?;
            let (span, good) = when
                .strip_suffix('!')
                .map_or((when, true), |span| (span, false));
            let (start, end) = span.split_once('-')?;
            Some(Some(Event::Byte {
                byte,
                start: parse(start).ok()?,
                end: parse(end).ok()?,
                good,
            }))
        }
        _ => Some(None),
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte {
                byte,
                start,
                end,
                good,
            } => {
                let mark = if *good { "" } else { "!" };
                write!(f, "{byte:02X}@{}-{}{mark}", Micros(*start), Micros(*end))
            }
            Self::Driver { at, on } => write!(
                f,
                "driver-{}@{}",
                if *on { "on" } else { "off" },
                Micros(*at)
            ),
            Self::Silence { at, longest } => {
                write!(f, "silence-{}@{}", Micros(*longest), Micros(*at))
            }
        }
    }
}

impl fmt::Display for Reply {
    /// Writes the reply line without its line end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ok {}", Micros(self.now()))?;
        match self {
            Self::Hello(_, hello) => {
                let abilities: Vec<&str> = hello
                    .abilities
                    .iter()
                    .map(|ability| ability.name())
                    .collect();
                write!(
                    f,
                    " version={VERSION} line={},{} abilities={} name={}",
                    hello.baud,
                    hello.format,
                    abilities.join(","),
                    hello.name
                )
            }
            Self::Events(_, events) => events.iter().try_for_each(|event| write!(f, " {event}")),
            Self::Findings(_, findings) if findings.is_empty() => Ok(()),
            Self::Findings(_, findings) => {
                let texts: Vec<String> = findings
                    .iter()
                    .map(|text| text.replace(['\n', '\r', '|'], " "))
                    .collect();
                write!(f, " {}", texts.join(" | "))
            }
            Self::Done(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_micros(100_000);

    #[test]
    fn every_reply_is_parsed_as_it_was_written() {
        let hello = Hello {
            baud: 9600,
            format: "8N2".to_owned(),
            abilities: BTreeSet::from(Ability::ALL),
            name: "the simulator with 4do".to_owned(),
        };
        let us = Duration::from_micros;
        let byte = Event::Byte {
            byte: 0xA5,
            start: us(7),
            end: us(8),
            good: true,
        };
        let damaged = Event::Byte {
            byte: 1,
            start: us(9),
            end: us(11),
            good: false,
        };
        let events = vec![
            Event::Driver {
                at: us(6),
                on: true,
            },
            byte,
            damaged,
            Event::Driver {
                at: us(12),
                on: false,
            },
            Event::Silence {
                at: us(12),
                longest: us(1),
            },
        ];
        for (request, reply) in [
            (Request::Hello(1), Reply::Hello(NOW, hello)),
            (Request::Run(NOW), Reply::Events(NOW, events)),
            (Request::Send(vec![]), Reply::Events(NOW, vec![])),
            (
                Request::Findings,
                Reply::Findings(NOW, vec!["a b".to_owned(), "c".to_owned()]),
            ),
            (Request::Findings, Reply::Findings(NOW, vec![])),
            (Request::Reset, Reply::Done(NOW)),
        ] {
            assert_eq!(Reply::read(&request, &reply.to_string()), Ok(reply));
        }
    }

    #[test]
    fn unknown_abilities_and_events_are_ignored() {
        let line = "ok 0 version=1 line=9600,8N2 abilities=power,teleport name=x y";
        let Ok(Reply::Hello(_, hello)) = Reply::read(&Request::Hello(1), line) else {
            panic!("expected a hello reply");
        };
        assert_eq!(hello.abilities, BTreeSet::from([Ability::Power]));
        assert_eq!(hello.name, "x y");
        let reply = Reply::read(&Request::Run(NOW), "ok 5 fuse-blown@3 02@1-4");
        assert!(matches!(reply, Ok(Reply::Events(_, events)) if events.len() == 1));
    }

    #[test]
    fn errors_and_strange_lines_are_reported() {
        for (request, line, reason) in [
            (
                Request::Hello(1),
                "error the line is in use",
                "the line is in use",
            ),
            (Request::Hello(1), "SSH-2.0", "SSH-2.0"),
            (Request::Hello(1), "", "replied \"\""),
            (Request::Hello(1), "ok", "replied \"ok\""),
            (Request::Hello(1), "ok 0 line=9600,8N2", "version="),
            (
                Request::Hello(1),
                "ok 0 version=2 line=9600,8N2",
                "version 2",
            ),
            (
                Request::Hello(1),
                "ok 0 version=1 line=x abilities= name=",
                "\"x\"",
            ),
            (Request::Run(NOW), "ok 0 zz@1-2", "zz@1-2"),
            (Request::Run(NOW), "ok 0 01@1", "01@1"),
            (Request::Run(NOW), "ok 0 nonsense", "nonsense"),
        ] {
            let error = Reply::read(&request, line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
    }
}
