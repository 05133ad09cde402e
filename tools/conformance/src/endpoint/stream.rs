//! A serial port, a pseudo-terminal or a TCP socket. Its times are those of the operating system, which are not exact.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use modbus_line::LineFormat;
use modbus_line::port::Port;
use serial2::{IntoSettings as _, SerialPort};

use super::{Abilities, Broken, Endpoint, Piece, Received};
use crate::hil::shell::Power;

/// Longest time that one read waits, before the clock is read again.
const SLICE: Duration = Duration::from_millis(5);

/// The shortest silence that ends a frame on every host and every connection, however busy they are.
const SILENCE: Duration = Duration::from_millis(100);

/// The longest frame, in characters (V1.02 2.5.2.1), and additional time after which every line has had a silence.
const LONGEST: usize = 513;
const GRACE: Duration = Duration::from_secs(2);

/// Time limit for connecting to one address.
const CONNECTING: Duration = Duration::from_secs(5);

/// The connection.
enum Carrier {
    Serial(Port<SerialPort>),
    Tcp(TcpStream),
}

/// Raw bytes through the operating system.
pub struct Stream {
    carrier: Carrier,
    name: String,
    line: LineFormat,
    begin: Instant,
    power: Option<Power>,
}

impl Stream {
    /// Opens a serial port or a pseudo-terminal.
    pub fn serial(path: &Path, line: LineFormat) -> Result<Self, Broken> {
        let port = Port::open(path, line, SerialPort::open).map_err(Broken)?;
        let name = format!("{} at {line}", path.display());
        Ok(Self::over(Carrier::Serial(port), name, line))
    }

    /// Connects to a socket; `line` is the rate and format of the line behind the socket.
    pub fn tcp(address: &str, line: LineFormat) -> Result<Self, Broken> {
        let socket = connect(address)
            .map_err(|why| Broken(format!("cannot connect to {address}: {why}")))?;
        let name = format!("{address} (a line at {line})");
        Ok(Self::over(Carrier::Tcp(socket), name, line))
    }

    fn over(carrier: Carrier, name: String, line: LineFormat) -> Self {
        Self {
            carrier,
            name,
            line,
            begin: Instant::now(),
            power: None,
        }
    }

    /// Returns the same connection to a unit whose power a command switches, if there is one.
    #[must_use]
    pub fn with_power(mut self, command: Option<String>) -> Self {
        self.power = command.map(Power::new);
        self
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Broken> {
        let written = match &mut self.carrier {
            Carrier::Serial(port) => port.inner.write_all(bytes),
            Carrier::Tcp(socket) => socket.write_all(bytes),
        };
        written.map_err(|error| Broken(format!("{}: cannot send: {error}", self.name)))
    }

    /// Returns bytes that were received at this instant, with their times.
    fn with_times(&self, bytes: Vec<u8>) -> Vec<Received> {
        let end = self.begin.elapsed();
        let start = end.saturating_sub(self.line.characters(1));
        let received = bytes.into_iter().map(|byte| Received {
            byte,
            start,
            end,
            good: true,
        });
        received.collect()
    }

    /// Returns the bytes that are received within `wait`; there may be none.
    fn read(&mut self, wait: Duration) -> Result<Vec<u8>, Broken> {
        let wait = wait.max(Duration::from_millis(1));
        let mut buffer = [0; 512];
        let read = match &mut self.carrier {
            Carrier::Serial(Port { inner, .. }) => inner
                .set_read_timeout(wait)
                .and_then(|()| inner.read(&mut buffer)),
            Carrier::Tcp(socket) => socket
                .set_read_timeout(Some(wait))
                .and_then(|()| socket.read(&mut buffer)),
        };
        match read {
            Ok(0) => {
                let name = &self.name;
                Err(Broken(format!(
                    "{name}: the other end has closed the connection"
                )))
            }
            Ok(length) => Ok(buffer[..length].to_vec()),
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => {
                    Ok(Vec::new())
                }
                _ => Err(Broken(format!("{}: cannot receive: {error}", self.name))),
            },
        }
    }
}

/// Connects to the first address of the host that answers. A request is sent immediately, not together with later
/// bytes.
pub(super) fn connect(address: &str) -> Result<TcpStream, String> {
    let found = address.to_socket_addrs();
    let found = found.map_err(|error| format!("no address such as 127.0.0.1:5020: {error}"))?;
    let mut last = "the name has no address".to_owned();
    for address in found {
        let connected = TcpStream::connect_timeout(&address, CONNECTING);
        match connected.and_then(|socket| socket.set_nodelay(true).map(|()| socket)) {
            Ok(socket) => return Ok(socket),
            Err(error) => last = error.to_string(),
        }
    }
    Err(last)
}

impl Endpoint for Stream {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            power: self.power.is_some(),
            set_line: matches!(self.carrier, Carrier::Serial(_)),
            character_time: true,
            start_bit: true,
            // On a serial port a lost reply is a finding. On a socket the host may delay bytes.
            asks_again: matches!(self.carrier, Carrier::Tcp(_)),
            ..Abilities::default()
        }
    }

    fn line(&self) -> LineFormat {
        self.line
    }

    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        let Carrier::Serial(port) = &mut self.carrier else {
            return Err(Broken("a socket has no rate and format".to_owned()));
        };
        let mut set = || {
            let mut settings = port.inner.get_configuration()?;
            line.apply_to_settings(&mut settings)?;
            port.inner.set_configuration(&settings)
        };
        set().map_err(|error| Broken(format!("{} does not take {line}: {error}", self.name)))?;
        self.line = line;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.begin.elapsed()
    }

    fn rest(&mut self, time: Duration) -> Result<(), Broken> {
        thread::sleep(time);
        Ok(())
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        let mut waiting = Vec::new();
        for piece in pieces {
            match piece {
                Piece::Bytes(bytes) => waiting.extend_from_slice(bytes),
                Piece::Gap(gap) => {
                    self.write(&waiting)?;
                    // The line carries the bytes for some time after they are written.
                    thread::sleep(self.line.characters(waiting.len()) + (*gap).max(SILENCE));
                    waiting.clear();
                }
                Piece::BadParity(_) | Piece::BadStop(_) | Piece::Break(_) | Piece::Glitch(_) => {
                    let why = "this endpoint cannot send damaged characters";
                    return Err(Broken(why.to_owned()));
                }
            }
        }
        self.write(&waiting)?;
        thread::sleep(self.line.characters(waiting.len()));
        Ok(self.now())
    }

    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        let none = || Broken("no --power-cmd".to_owned());
        let switched = self.power.as_mut().ok_or_else(none)?.switch(on);
        switched.map_err(|error| Broken(format!("{error:#}")))
    }

    fn flush(&mut self) -> Result<Vec<Received>, Broken> {
        // Return also when the line is never silent. The next `receive` reports that.
        let latest = Instant::now() + SILENCE;
        let mut late = Vec::new();
        while Instant::now() < latest {
            let bytes = self.read(Duration::ZERO)?;
            if bytes.is_empty() {
                break;
            }
            late.extend(self.with_times(bytes));
        }
        Ok(late)
    }

    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Received>, Broken> {
        let mut received: Vec<Received> = Vec::new();
        let mut until = Instant::now() + patience;
        let longest = until + self.line.characters(LONGEST) * 2 + GRACE;
        while received.len() < enough {
            if Instant::now() > longest {
                return Err(Broken(format!(
                    "{} is never silent: is there another master on the line, or has it another rate?",
                    self.name
                )));
            }
            let left = until.saturating_duration_since(Instant::now());
            let bytes = self.read(left.min(SLICE))?;
            if bytes.is_empty() {
                if left.is_zero() {
                    break;
                }
                continue;
            }
            received.extend(self.with_times(bytes));
            until = Instant::now() + quiet;
        }
        Ok(received)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tester::apart;
    use std::net::TcpListener;

    /// An endpoint, and the other end of its connection.
    fn connected(line: LineFormat) -> (Stream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let stream = Stream::tcp(&address, line).unwrap();
        (stream, listener.accept().unwrap().0)
    }

    #[test]
    fn line_that_is_never_silent_is_an_error() {
        let (mut stream, mut peer) = connected(LineFormat::new(115_200, "8N1".parse().unwrap()));
        thread::spawn(move || while peer.write_all(&[0x55; 20]).is_ok() {});
        // A busy host may run the other thread only after a pause, which must not look like silence.
        let wait = Duration::from_secs(1);
        let error = stream.receive(wait, wait, usize::MAX).unwrap_err();
        assert!(error.to_string().contains("never silent"), "{error}");
    }

    #[test]
    fn socket_sends_and_receives_bytes_and_detects_silence_and_the_end() {
        let (mut stream, mut peer) = connected(LineFormat::default());
        let pieces = apart(&[1, 2], Duration::from_millis(1), &[3]);
        stream.send(&pieces).unwrap();
        let mut got = [0; 3];
        peer.read_exact(&mut got).unwrap();
        assert_eq!(got, [1, 2, 3]);

        let short = Duration::from_millis(10);
        assert_eq!(stream.receive(short, short, usize::MAX).unwrap(), []);
        peer.write_all(&[9, 8]).unwrap();
        let long = Duration::from_secs(5);
        let received = stream.receive(long, short, usize::MAX).unwrap();
        let bytes: Vec<u8> = received.iter().map(|h| h.byte).collect();
        assert_eq!(bytes, [9, 8]);
        drop(peer);
        let gone = stream.receive(long, short, usize::MAX);
        assert!(gone.unwrap_err().0.contains("closed"));
    }

    #[test]
    fn bytes_of_a_late_reply_are_discarded_before_the_next_request() {
        let (mut stream, mut peer) = connected(LineFormat::default());
        peer.write_all(&[1, 2, 3]).unwrap();
        thread::sleep(Duration::from_millis(50));
        let late: Vec<u8> = stream.flush().unwrap().iter().map(|h| h.byte).collect();
        assert_eq!(late, [1, 2, 3]);
        let short = Duration::from_millis(10);
        assert_eq!(stream.receive(short, short, usize::MAX).unwrap(), []);
    }

    #[test]
    fn damaged_characters_are_refused() {
        let (mut stream, _) = connected(LineFormat::default());
        assert!(stream.send(&[Piece::BadStop(1)]).is_err());
        assert!(stream.set_line(LineFormat::default()).is_err());
    }

    #[test]
    fn line_without_a_server_is_an_error_in_one_line() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap().to_string();
        drop(taken);
        for text in [
            Stream::tcp(&address, LineFormat::default()),
            Stream::tcp("nowhere", LineFormat::default()),
            Stream::serial(Path::new("/dev/no-such-port"), LineFormat::default()),
        ]
        .map(|opened| opened.err().unwrap().0)
        {
            assert!(!text.contains('\n') && text.len() > 10, "{text}");
        }
    }
}
