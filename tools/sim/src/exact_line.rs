//! The exact-line protocol on a board: carries out the requests of crate `exact-line`, in virtual time.

use std::time::Duration;

use modbus_line::RATES;
use modbus_line::exact::{Ability, Event, Hello, LONGEST_RUN, Piece, Reply, Request};

use crate::Board;
use crate::line::{Character, Format, Settings};
use f103::time::Time;

/// What the client of a board's line knows already.
#[derive(Clone, Debug, Default)]
pub struct Session {
    /// Driver edges up to this instant were reported.
    edges_until: Time,
    /// Number of findings that were reported.
    findings: usize,
    /// End of the last byte of the reply that is being sent, and the longest silence inside it.
    last_end: Option<Duration>,
    longest: Duration,
}

impl Session {
    /// Carries out a request and lets the time pass that it takes.
    ///
    /// # Errors
    ///
    /// Why the request cannot be carried out, in one line; then nothing has happened.
    pub fn answer(&mut self, board: &mut Board, request: &Request) -> Result<Reply, String> {
        let until = begin(board, request)?;
        board.run_until(until);
        Ok(self.finish(board, request))
    }

    /// Returns the reply to a request that has [begun](begin), once its time is over.
    pub fn finish(&mut self, board: &mut Board, request: &Request) -> Reply {
        let now = duration(board.now());
        match request {
            Request::Hello(_) => Reply::Hello(now, hello(board)),
            Request::Send(_) | Request::Run(_) => Reply::Events(now, self.events(board)),
            Request::Findings => Reply::Findings(now, self.findings(board)),
            Request::Line(..) | Request::Power(_) | Request::Reset | Request::Echo(_) => {
                Reply::Done(now)
            }
        }
    }

    fn events(&mut self, board: &mut Board) -> Vec<Event> {
        let from = std::mem::replace(&mut self.edges_until, board.now());
        let received = board.line().take_received();
        let bytes = received.iter().map(|received| Event::Byte {
            byte: received.byte,
            start: duration(received.start),
            end: duration(received.end),
            good: received.is_good(),
        });
        let mut events: Vec<Event> = bytes.collect();
        let edges = board.line().driver_edges().filter(|edge| edge.0 > from);
        events.extend(edges.map(|(at, on)| Event::Driver {
            at: duration(at),
            on,
        }));
        events.sort_by_key(Event::at);
        self.with_silences(events)
    }

    /// Adds the longest silence inside each reply that has ended.
    fn with_silences(&mut self, events: Vec<Event>) -> Vec<Event> {
        let mut all = Vec::with_capacity(events.len());
        for event in events {
            all.push(event);
            match event {
                Event::Byte { start, end, .. } => {
                    let silence = self.last_end.map(|last| start.saturating_sub(last));
                    self.longest = self.longest.max(silence.unwrap_or_default());
                    self.last_end = Some(end);
                }
                Event::Driver { on: true, .. } => self.longest = Duration::ZERO,
                Event::Driver { at, on: false } => {
                    let longest = self.longest;
                    all.extend(self.last_end.take().map(|_| Event::Silence { at, longest }));
                }
                Event::Silence { .. } => {}
            }
        }
        all
    }

    fn findings(&mut self, board: &Board) -> Vec<String> {
        let new = board.findings().iter().skip(self.findings);
        let new: Vec<String> = new.map(ToString::to_string).collect();
        self.findings += new.len();
        new
    }
}

/// Begins to carry out a request; returns when its time is over. Until then the caller lets the board run.
///
/// # Errors
///
/// Why the request cannot be carried out, in one line; then nothing has happened.
pub fn begin(board: &mut Board, request: &Request) -> Result<Time, String> {
    match request {
        Request::Send(pieces) => return send(board, pieces),
        Request::Run(span) => return Ok(board.now() + time(*span)),
        Request::Line(baud, format) => {
            let settings = settings(*baud, format)?;
            board.line().set_settings(settings);
        }
        Request::Power(true) => board.power_on(),
        Request::Power(false) => board.power_off(),
        Request::Reset => board.reset(),
        Request::Echo(echo) => board.line().set_echo(*echo),
        Request::Hello(_) | Request::Findings => {}
    }
    Ok(board.now())
}

fn hello(board: &mut Board) -> Hello {
    let modules = fitted(board);
    let Settings { baud, format } = board.line().settings();
    Hello {
        baud,
        format: format.name().to_owned(),
        abilities: Ability::ALL.into(),
        name: format!("the simulator with {modules}"),
    }
}

/// Returns the module in the slot of a board that has one, such as `4do`; of a board with several slots the modules by
/// port, such as `1=4do 2=none`; and the name of a board without slots.
fn fitted(board: &Board) -> String {
    let slots: Vec<_> = board.slots().collect();
    match slots[..] {
        [] => return board.layout().board.name.to_owned(),
        [(_, slot)] => return slot.module().to_string(),
        _ => {}
    }
    let modules = slots
        .iter()
        .map(|(port, slot)| format!("{port}={}", slot.module()));
    modules.collect::<Vec<_>>().join(" ")
}

/// Puts pieces on the line; returns when the last of them has ended.
fn send(board: &mut Board, pieces: &[Piece]) -> Result<Time, String> {
    let settings = board.line().settings();
    check(settings, pieces)?;
    let mut at = board.now();
    let line = board.line();
    for piece in pieces {
        at = match piece {
            Piece::Bytes(bytes) => line.send(at, bytes),
            Piece::Gap(gap) => at + time(*gap),
            Piece::BadParity(byte) => {
                let character = Character::new(settings, *byte).with_wrong_parity();
                line.send_character(at, character)
            }
            Piece::BadStop(byte) => line.send_character(at, with_low_stop(settings, *byte)),
            Piece::Break(bits) => {
                line.send_character(at, Character::line_break(settings.rate(), *bits))
            }
            Piece::Glitch(width) => {
                line.noise(at, time(*width));
                at + time(*width)
            }
        };
    }
    Ok(at)
}

/// Makes sure that these pieces can be sent before any of them is.
fn check(settings: Settings, pieces: &[Piece]) -> Result<(), String> {
    let mut length = Time::ZERO;
    for piece in pieces {
        length += match piece {
            Piece::Bytes(bytes) => settings.characters(bytes.len() as u64),
            Piece::Gap(span) | Piece::Glitch(span) => time(*span),
            Piece::BadParity(_) if settings.format.parity().is_none() => {
                let format = settings.format.name();
                return Err(format!("{format} has no parity bit that could be wrong"));
            }
            Piece::BadParity(_) | Piece::BadStop(_) => settings.characters(1),
            // One bit brings the line back up.
            Piece::Break(bits) => settings.rate().bits(u64::from(*bits) + 1),
        };
    }
    if length > time(LONGEST_RUN) {
        let most = LONGEST_RUN.as_micros();
        return Err(format!("the pieces take more than {most} us"));
    }
    Ok(())
}

/// Returns a character with low stop bits, and one more bit that brings the line back up.
fn with_low_stop(settings: Settings, byte: u8) -> Character {
    let mut character = Character::new(settings, byte);
    for bit in character.bits - settings.format.stop_bits()..character.bits {
        character = character.with_bit_flipped(bit);
    }
    character.levels |= 1 << character.bits;
    character.bits += 1;
    character
}

/// Returns the settings of a rate and a format's name.
fn settings(baud: u32, format: &str) -> Result<Settings, String> {
    if !RATES.contains(&baud.into()) {
        return Err(format!("{baud} bit/s is not within 300 to 4000000"));
    }
    let format = Format::named(format).ok_or_else(|| {
        let names = Format::ALL.map(Format::name).join(", ");
        format!("{format:?} is not supported; use one of {names}")
    })?;
    Ok(Settings { baud, format })
}

const fn time(duration: Duration) -> Time {
    Time::from_ns(duration.as_nanos() as u64)
}

const fn duration(time: Time) -> Duration {
    Duration::from_nanos(time.as_ns())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Image, Module};

    /// Returns a board whose core runs an endless loop: a vector table (stack, reset) and `b .` after it.
    fn board() -> Board {
        let program = [0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0xFE, 0xE7];
        let image = Image::from_bytes(&program).expect("a vector table and an instruction");
        let config = Config {
            module: Module::Do4,
            ..Config::default()
        };
        Board::new(&image, config).expect("it fits")
    }

    fn ask(board: &mut Board, line: &str) -> Result<String, String> {
        let request: Request = line.parse()?;
        let reply = Session::default().answer(board, &request)?;
        Ok(reply.to_string())
    }

    #[test]
    fn pieces_take_their_time_on_the_line() {
        let mut board = board();
        for (line, us) in [
            ("send 010203", 33.0 * 104.166_7),
            ("send gap:1000", 1000.0),
            ("send break:15", 16.0 * 104.166_7),
            ("send glitch:10", 10.0),
            ("send stop:55", 12.0 * 104.166_7),
            ("send 01 gap:50 01", 22.0 * 104.166_7 + 50.0),
            ("run 123.456", 123.456),
        ] {
            let before = board.now().as_ps() as f64 / 1e6;
            ask(&mut board, line).unwrap();
            let took = board.now().as_ps() as f64 / 1e6 - before;
            assert!((took - us).abs() < 1.0, "{line}: {took}");
        }
    }

    #[test]
    fn each_reply_is_followed_by_its_longest_silence() {
        let us = Duration::from_micros;
        let byte = |start, end| Event::Byte {
            byte: 0,
            start: us(start),
            end: us(end),
            good: true,
        };
        let driver = |at, on| Event::Driver { at: us(at), on };
        let silence = |at, longest| Event::Silence {
            at: us(at),
            longest: us(longest),
        };
        let mut session = Session::default();
        let mut told = |events: &[Event]| session.with_silences(events.to_vec());
        let begun = [driver(5, true), byte(10, 20), byte(23, 33)];
        assert_eq!(told(&begun), begun);
        let ended = [byte(34, 44), driver(45, false)];
        assert_eq!(told(&ended), [&ended[..], &[silence(45, 3)]].concat());
        // The silence before a reply is not inside it. A driver that was on without a byte is no reply.
        let next = [driver(90, true), byte(99, 109), driver(110, false)];
        assert_eq!(told(&next), [&next[..], &[silence(110, 0)]].concat());
        let none = [driver(120, true), driver(121, false)];
        assert_eq!(told(&none), none);
    }

    #[test]
    fn requests_that_take_no_time_leave_the_clock_alone() {
        let mut board = board();
        board.run_for(Time::from_ms(3));
        let now = ask(&mut board, "findings").unwrap();
        for line in [
            "line 19200 8E1",
            "echo on",
            "reset",
            "power off",
            "power on",
        ] {
            assert_eq!(ask(&mut board, line).unwrap(), now, "{line}");
        }
        let hello = ask(&mut board, "hello 1").unwrap();
        assert!(hello.starts_with(&format!(
            "{now} version=1 line=19200,8E1 abilities=line,faults,"
        )));
        assert!(hello.ends_with(" name=the simulator with 4do"), "{hello}");
    }

    #[test]
    fn a_board_with_several_slots_names_all_its_modules() {
        let image =
            Image::from_bytes(&[0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08, 0xFE, 0xE7]);
        let config = Config {
            layout: &crate::board::MODIO_08,
            slots: vec![(3, Module::Ao4)],
            ..Config::default()
        };
        let mut board = Board::new(&image.unwrap(), config).unwrap();
        let hello = ask(&mut board, "hello 1").unwrap();
        let name = "the simulator with 1=4di 2=none 3=4ao 4=none";
        assert!(hello.ends_with(&format!(" name={name}")), "{hello}");
        let read = Reply::read(&Request::Hello(1), &hello).unwrap();
        assert!(format!("{read:?}").contains(name), "{read:?}");
    }

    #[test]
    fn what_cannot_be_done_is_refused_before_anything_happens() {
        let mut board = board();
        let before = board.now();
        for (line, reason) in [
            ("send 01 parity:02", "8N2 has no parity"),
            ("send gap:300000000 gap:300000001", "600000000"),
            ("line 100 8N2", "300 to 4000000"),
            ("line 9600 7N1", "\"7N1\""),
        ] {
            let error = ask(&mut board, line).unwrap_err();
            assert!(error.contains(reason), "{line}: {error}");
        }
        assert_eq!(board.now(), before);
        assert_eq!(board.line().master_free(), before, "nothing is queued");
    }
}
