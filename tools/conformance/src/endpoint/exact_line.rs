//! The exact-line protocol as an endpoint: an emulator or simulator in which time passes on request only.
//! docs/conformance.md describes the protocol.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use modbus_line::LineFormat;
use modbus_line::exact::{Ability, Event, Hello, LONGEST_RUN, Reply, Request, VERSION};

use super::stream::connect;
use super::{Abilities, Broken, Endpoint, Piece, Received};

/// Time that a server may take for a request. The longest request is ten minutes of virtual time.
const PATIENCE: Duration = Duration::from_secs(600);

/// How long to wait for the server to notice that an earlier client has disconnected.
const HANDOVER: Duration = Duration::from_secs(5);

/// A connection to a server.
pub trait Transport {
    /// Sends a request to the server and returns the reply. The error is one line.
    fn ask(&mut self, request: &Request) -> Result<Reply, String>;
}

/// A master on an exact line.
pub struct ExactLine<T> {
    server: T,
    hello: Hello,
    line: LineFormat,
    now: Duration,
    /// Bytes that were reported and not yet returned by `receive`.
    bytes: VecDeque<Received>,
    driver_edges: Vec<(Duration, bool)>,
}

impl<T: Transport> ExactLine<T> {
    /// Sends `hello` to the server.
    pub fn new(mut server: T) -> Result<Self, Broken> {
        let reply = server.ask(&Request::Hello(VERSION)).map_err(Broken)?;
        let Reply::Hello(now, hello) = reply else {
            return Err(Broken("the server did not reply to hello".to_owned()));
        };
        let format = hello.format.parse().map_err(Broken)?;
        Ok(Self {
            line: LineFormat::new(hello.baud, format),
            server,
            hello,
            now,
            bytes: VecDeque::new(),
            driver_edges: Vec::new(),
        })
    }

    fn can(&self, ability: Ability) -> bool {
        self.hello.abilities.contains(&ability)
    }

    /// Sends a request and stores the reported events. Fails when the server does not have the ability that the request
    /// needs. Returns the findings, if the request asks for them.
    fn ask(&mut self, request: &Request, needs: Option<Ability>) -> Result<Vec<String>, Broken> {
        if let Some(ability) = needs.filter(|ability| !self.can(*ability)) {
            let (name, ability) = (&self.hello.name, ability.name());
            return Err(Broken(format!("{name} has no ability {ability}")));
        }
        let reply = self
            .server
            .ask(request)
            .map_err(|why| Broken(format!("{}: {why}", self.hello.name)))?;
        self.now = reply.now();
        let events = match reply {
            Reply::Events(_, events) => events,
            Reply::Findings(_, findings) => return Ok(findings),
            Reply::Hello(..) | Reply::Done(_) => Vec::new(),
        };
        for event in events {
            match event {
                Event::Byte {
                    byte,
                    start,
                    end,
                    good,
                } => self.bytes.push_back(Received {
                    byte,
                    start,
                    end,
                    good,
                }),
                Event::Driver { at, on } => self.driver_edges.push((at, on)),
                // The suite calculates the silences from the bytes.
                Event::Silence { .. } => {}
            }
        }
        Ok(Vec::new())
    }

    fn run(&mut self, time: Duration) -> Result<(), Broken> {
        let mut left = time;
        while !left.is_zero() {
            let step = left.min(LONGEST_RUN);
            self.ask(&Request::Run(step), None)?;
            left -= step;
        }
        Ok(())
    }
}

impl<T: Transport> Endpoint for ExactLine<T> {
    fn name(&self) -> String {
        format!("{}, {}", self.hello.name, self.line)
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            exact: true,
            faults: self.can(Ability::Faults),
            power: self.can(Ability::Power),
            driver: self.can(Ability::Driver),
            echo: self.can(Ability::Echo),
            set_line: self.can(Ability::Line),
            character_time: self.can(Ability::CharacterTime),
            start_bit: self.can(Ability::StartBit),
            asks_again: false,
        }
    }

    fn line(&self) -> LineFormat {
        self.line
    }

    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        let request = Request::Line(line.baud, line.format.to_string());
        self.ask(&request, Some(Ability::Line))?;
        self.line = line;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.now
    }

    fn rest(&mut self, time: Duration) -> Result<(), Broken> {
        self.run(time)
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        let mut pieces = pieces.to_vec();
        pieces.retain(|piece| !matches!(piece, Piece::Bytes(bytes) if bytes.is_empty()));
        if !pieces.is_empty() {
            self.ask(&Request::Send(pieces), None)?;
        }
        Ok(self.now)
    }

    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Received>, Broken> {
        let mut received: Vec<Received> = Vec::new();
        let mut until = self.now + patience;
        loop {
            while received.len() < enough {
                // A byte after the silence that ends a reply belongs to the next call.
                let belongs = |next: &&Received| received.is_empty() || next.start <= until;
                let Some(next) = self.bytes.front().filter(belongs).copied() else {
                    break;
                };
                self.bytes.pop_front();
                until = next.end + quiet;
                received.push(next);
            }
            if received.len() >= enough || self.now >= until {
                return Ok(received);
            }
            // When the caller waits for a number of bytes, time must not pass much beyond the last byte.
            let most = if enough == usize::MAX {
                Duration::MAX
            } else {
                self.line.characters(1)
            };
            self.run(until.saturating_sub(self.now).min(most))?;
        }
    }

    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        self.ask(&Request::Power(on), Some(Ability::Power))
            .map(drop)
    }

    fn set_echo(&mut self, echo: bool) -> Result<(), Broken> {
        self.ask(&Request::Echo(echo), Some(Ability::Echo))
            .map(drop)
    }

    fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken> {
        if !self.can(Ability::Driver) {
            let why = "this endpoint does not record the driver";
            return Err(Broken(why.to_owned()));
        }
        Ok(std::mem::take(&mut self.driver_edges))
    }

    fn take_complaints(&mut self) -> Result<Vec<String>, Broken> {
        if !self.can(Ability::Findings) {
            return Ok(Vec::new());
        }
        self.ask(&Request::Findings, None)
    }
}

/// A server behind a TCP socket.
pub struct Tcp {
    stream: BufReader<TcpStream>,
}

impl Tcp {
    /// Connects to a server and sends `hello`. Fails also when another client uses the line.
    pub fn connect(address: &str) -> Result<ExactLine<Self>, Broken> {
        let cannot = |why: String| Broken(format!("no exact line at {address}: {why}"));
        let begin = Instant::now();
        loop {
            let server = Self::open(address).map_err(cannot)?;
            match ExactLine::new(server) {
                // The server may not have noticed yet that the client before this one has disconnected.
                Err(Broken(why)) if why.contains("in use") && begin.elapsed() < HANDOVER => {
                    thread::sleep(Duration::from_millis(100));
                }
                Err(Broken(why)) => return Err(cannot(why)),
                Ok(line) => return Ok(line),
            }
        }
    }

    fn open(address: &str) -> Result<Self, String> {
        let stream = connect(address)?;
        let set = stream.set_read_timeout(Some(PATIENCE));
        set.map_err(|error| error.to_string())?;
        let stream = BufReader::new(stream);
        Ok(Self { stream })
    }
}

impl Transport for Tcp {
    fn ask(&mut self, request: &Request) -> Result<Reply, String> {
        let text = format!("{request}\n");
        let written = self.stream.get_mut().write_all(text.as_bytes());
        let mut line = String::new();
        let read = self.stream.read_line(&mut line);
        match (written, read) {
            // A reply of the server takes precedence over a failed write.
            (_, Ok(1..)) => Reply::read(request, line.trim_end()),
            (Ok(()), Ok(_)) => Err("the server has closed the connection".to_owned()),
            (Err(error), _) | (_, Err(error)) => Err(format!("the connection broke: {error}")),
        }
    }
}
