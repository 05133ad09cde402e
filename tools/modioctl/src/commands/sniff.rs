//! `modioctl sniff`.

use std::fs::File;
use std::path::PathBuf;
use std::time::Duration;

use chrono::{DateTime, Local, SecondsFormat};
use modbus_line::capture::{Packet, Recorder};
use modbus_line::other::{TELNET, is_telnet};
use modbus_line::port::is_pseudo_terminal;
use serde_json::{Value as Json, json};
use tokio::time::{Instant, timeout};

use crate::bus::adu::{self, Framing};
use crate::bus::{Direction, Endpoint, Place, Stream, decode};
use crate::cli::Sniff;
use crate::device::place;
use crate::failure::Failure;
use crate::output::{self, not_written};
use crate::sniff::{Kind, Piece, Splitter};
use crate::trace;

/// Silence after which an incomplete RTU frame counts as garbled, in addition to the time of some characters. USB
/// adapters deliver bytes in batches, 16 ms apart and more.
const BATCH: Duration = Duration::from_millis(60);
/// Longest time between two characters of an ASCII frame (V1.02, 2.5.2.1).
const ASCII_IDLE: Duration = Duration::from_secs(1);

/// Shows the frames on the line until the program is stopped. Sends nothing.
pub async fn run(endpoint: &Endpoint, options: &Sniff, json: bool) -> Result<(), Failure> {
    if matches!(endpoint.place, Place::ModbusTcp(_)) {
        return Err(Failure::usage(
            "sniff listens on serial lines; a Modbus TCP connection carries only its own frames: give --port or --tcp, or capture the network with Wireshark",
        ));
    }
    let mut stream = Stream::open(endpoint).await?;
    let mut printer = Printer::new(endpoint, options, json)?;
    let start = printer.start;
    let mut splitter = Splitter::new(endpoint.framing, character(endpoint), endpoint.timeout);
    let idle = match endpoint.framing {
        Framing::Ascii => ASCII_IDLE,
        Framing::Rtu | Framing::Mbap => BATCH + endpoint.time_of(12),
    };
    let record = options.record.as_deref();
    let record = record.map_or_else(String::new, |path| format!(", writing {}", path.display()));
    eprintln!(
        "modioctl: listening at {}{record}; Ctrl-C stops",
        place(endpoint)
    );
    let mut chunk = [0; 512];
    loop {
        let read = if splitter.is_empty() {
            stream.read(&mut chunk).await
        } else {
            match timeout(idle, stream.read(&mut chunk)).await {
                Ok(read) => read,
                Err(_) => {
                    printer.print(&splitter.flush())?;
                    continue;
                }
            }
        };
        let lost = match read {
            Ok(count) if count > 0 => {
                let bytes = chunk.get(..count).unwrap_or_default();
                printer.print(&splitter.push(bytes, start.elapsed()))?;
                continue;
            }
            Ok(_) => "the other end closed the connection".to_owned(),
            Err(error) => error.to_string(),
        };
        printer.print(&splitter.flush())?;
        return Err(Failure::Port(format!(
            "{} is lost ({lost}): check that the adapter is plugged in, or that the gateway runs",
            place(endpoint)
        )));
    }
}

/// Returns the time of one character on the line. Returns zero where bytes are not paced by the line: a TCP connection
/// or a pseudo-terminal delivers all bytes of a frame at the same time.
fn character(endpoint: &Endpoint) -> Duration {
    match &endpoint.place {
        Place::Serial(path) if !is_pseudo_terminal(path.as_ref()) => endpoint.time_of(1),
        _ => Duration::ZERO,
    }
}

/// Prints pieces and writes them to the capture file.
struct Printer {
    framing: Framing,
    json: bool,
    start: Instant,
    wall: DateTime<Local>,
    last: Option<Duration>,
    record: Option<(Recorder<File>, PathBuf)>,
}

impl Printer {
    fn new(endpoint: &Endpoint, options: &Sniff, json: bool) -> Result<Self, Failure> {
        let record = options.record.as_deref().map(|path| {
            let program = concat!("modioctl ", env!("CARGO_PKG_VERSION"));
            let file = output::create(path, options.force)?;
            let recorder = Recorder::new(file, program, &place(endpoint));
            let recorder = recorder.map_err(|error| not_written(path, &error))?;
            Ok((recorder, path.to_owned()))
        });
        Ok(Self {
            framing: endpoint.framing,
            json,
            start: Instant::now(),
            wall: Local::now(),
            last: None,
            record: record.transpose()?,
        })
    }

    fn print(&mut self, pieces: &[Piece]) -> Result<(), Failure> {
        for piece in pieces {
            let gap = self.last.map(|last| piece.from.saturating_sub(last));
            self.last = Some(piece.until);
            if self.json {
                let time = self.wall + piece.from;
                output::line(object(self.framing, piece, time, gap))?;
            } else {
                output::line(line(self.framing, piece, gap))?;
            }
            if let Some((recorder, path)) = &mut self.record {
                let since = self.wall.timestamp_nanos_opt().unwrap_or_default();
                let since = Duration::from_nanos(u64::try_from(since).unwrap_or_default());
                let written = recorder.write(&Packet {
                    time: since.saturating_add(piece.from),
                    direction: match &piece.kind {
                        Kind::Frame { direction, .. } => Some(*direction),
                        Kind::Garbled => None,
                    },
                    framing: self.framing,
                    bytes: &piece.bytes,
                    comment: &words(self.framing, piece),
                });
                written.map_err(|error| not_written(path, &error))?;
            }
        }
        Ok(())
    }
}

fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e4).round() / 10.0
}

fn words(framing: Framing, piece: &Piece) -> String {
    match &piece.kind {
        // Three bytes can be noise.
        Kind::Garbled if piece.bytes.len() > 3 && is_telnet(&piece.bytes) => TELNET.to_owned(),
        Kind::Garbled => format!("garbled: {}", decode::count_of(&piece.bytes)),
        Kind::Frame {
            direction, request, ..
        } => {
            let request = request.as_ref().map(|request| &request.pdu[..]);
            decode::frame(framing, *direction, &piece.bytes, request)
        }
    }
}

/// Returns a piece as a line: time in s, gap in ms, direction, bytes, words, turnaround in ms.
fn line(framing: Framing, piece: &Piece, gap: Option<Duration>) -> String {
    let gap = gap.map(|gap| format!("+{:.1}", milliseconds(gap)));
    let gap = gap.unwrap_or_else(|| "-".to_owned());
    let text = match &piece.kind {
        Kind::Garbled => {
            let bytes = adu::bytes(Framing::Rtu, &piece.bytes);
            format!("?? {bytes}  {}", words(framing, piece))
        }
        Kind::Frame {
            direction, request, ..
        } => {
            let request = request.as_ref().map(|request| &request.pdu[..]);
            trace::frame(*direction, framing, &piece.bytes, request)
        }
    };
    let turnaround = piece.turnaround().map_or_else(String::new, |time| {
        format!(" (after {:.1} ms)", milliseconds(time))
    });
    let seconds = piece.from.as_secs_f64();
    format!("{seconds:9.3} {gap:>9} ms {text}{turnaround}")
}

fn object(framing: Framing, piece: &Piece, time: DateTime<Local>, gap: Option<Duration>) -> Json {
    let (kind, unit, function) = match &piece.kind {
        Kind::Garbled => ("garbled", None, None),
        Kind::Frame {
            direction,
            unit,
            pdu,
            ..
        } => {
            let kind = match direction {
                Direction::Request => "request",
                Direction::Response => "response",
            };
            (kind, Some(*unit), pdu.first().map(|code| code & 0x7F))
        }
    };
    json!({
        "time": time.to_rfc3339_opts(SecondsFormat::Micros, false),
        "gap_ms": gap.map(milliseconds),
        "kind": kind,
        "unit": unit,
        "function": function,
        "turnaround_ms": piece.turnaround().map(milliseconds),
        "bytes": adu::bytes(Framing::Rtu, &piece.bytes),
        "text": words(framing, piece),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces() -> Vec<Piece> {
        let frame = |pdu: &[u8]| Framing::Rtu.frame(0, 1, pdu);
        let second = Duration::from_secs(1);
        let mut splitter = Splitter::new(Framing::Rtu, Duration::ZERO, second);
        let mut pieces = splitter.push(&frame(&[3, 0, 0x10, 0, 1]), second);
        let answer = [&frame(&[3, 2, 0, 5])[..], &[0xFF]].concat();
        pieces.extend(splitter.push(&answer, second + Duration::from_micros(4260)));
        pieces.extend(splitter.flush());
        pieces
    }

    #[test]
    fn frame_of_a_gateway_with_telnet_is_named() {
        let mut splitter = Splitter::new(Framing::Rtu, Duration::ZERO, Duration::ZERO);
        let frame = Framing::Rtu.frame(0, 1, &[3, 2, 0, 0xFF]);
        let (front, back) = frame.split_at(5);
        let pieces = splitter.push(&[front, &[0xFF], back].concat(), Duration::ZERO);
        let pieces = [pieces, splitter.flush()].concat();
        let words = pieces.iter().map(|piece| words(Framing::Rtu, piece));
        assert_eq!(words.collect::<Vec<_>>(), [TELNET]);
    }

    #[test]
    fn lines_have_times_directions_and_words() {
        let lines: Vec<_> = pieces()
            .iter()
            .map(|piece| line(Framing::Rtu, piece, piece.turnaround()))
            .collect();
        assert_eq!(
            lines,
            [
                "    1.000         - ms -> 01 03 00 10 00 01 85 CF  unit 1: read holding registers 0x0010 x 1",
                "    1.004      +4.3 ms <- 01 03 02 00 05 78 47  unit 1: read holding registers 0x0010 = 0005 (after 4.3 ms)",
                "    1.004         - ms ?? FF  garbled: 1 byte",
            ]
        );
    }

    #[test]
    fn json_objects_have_the_same_content() {
        let pieces = pieces();
        let response = object(Framing::Rtu, &pieces[1], Local::now(), None);
        assert_eq!(response["kind"], "response");
        assert_eq!(response["function"], 3);
        assert_eq!(response["turnaround_ms"], 4.3);
        assert_eq!(response["bytes"], "01 03 02 00 05 78 47");
        let garbled = object(Framing::Rtu, &pieces[2], Local::now(), None);
        assert_eq!(garbled["kind"], "garbled");
        assert_eq!(garbled["unit"], Json::Null);
    }
}
