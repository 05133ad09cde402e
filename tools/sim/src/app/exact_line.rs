//! The RS-485 line in virtual time on a TCP socket: `--exact-line`. The protocol is in docs/conformance.md.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread;

use modbus_line::exact::{LONGEST_LINE, Reply, Request};
use sim::Time;
use sim::exact_line::{Session, begin};

use super::Event;
use super::clients::{self, Client};
use super::scene::Scene;

/// Longest first line of a connection in bytes, with its end: `hello` and a number.
const LONGEST_HELLO: usize = 32;

/// Takes the answer to a request: a reply, or the reason why the request cannot be carried out.
pub type Answers = Sender<Result<Reply, String>>;

/// Starts to listen at `address`, and returns the address: with port 0 the system chooses the port.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let in_use = InUse::default();
    let serve = move |client: Client| {
        if in_use.0.load(Ordering::Acquire) {
            // A client that disconnects instead of reading this does not matter.
            let _ = refuse(&client);
            return;
        }
        let (events, in_use) = (events.clone(), in_use.clone());
        thread::spawn(move || {
            // An error is the end of the connection.
            let _ = serve(&client, &in_use, &events);
        });
    };
    clients::listen(address, serve)
        .map_err(|error| format!("cannot serve the exact line at {address}: {error}"))
}

/// Whether a client has the line.
#[derive(Clone, Default)]
struct InUse(Arc<AtomicBool>);

/// Gives the line back when it is dropped.
struct Turn<'a>(&'a InUse);

impl InUse {
    /// Takes the line if no other client has it.
    fn take(&self) -> Option<Turn<'_>> {
        let taken = self.0.swap(true, Ordering::AcqRel);
        (!taken).then(|| Turn(self))
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.0.store(false, Ordering::Release);
    }
}

fn refuse(client: &Client) -> io::Result<()> {
    client
        .stream()
        .write_all(b"error the line is in use by another client\n")
}

/// Serves a client until it disconnects. The client gets the line with its first request, which must be `hello`: a page
/// in a browser, which begins with an HTTP request, and a connection that sends nothing have no effect.
fn serve(client: &Client, in_use: &InUse, events: &Sender<Event>) -> io::Result<()> {
    let (stream, mut writer) = (client.stream(), client.stream());
    // Requests and replies are short and alternate. Collecting more bytes before sending would only delay them.
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(clients::FIRST))?;
    let mut reader = BufReader::new(stream);
    let mut line = Vec::new();
    reader
        .by_ref()
        .take(LONGEST_HELLO as u64)
        .read_until(b'\n', &mut line)?;
    if !line.starts_with(b"hello ") || !line.ends_with(b"\n") {
        return writer.write_all(b"error the first request of a connection must be hello 1\n");
    }
    let Some(_turn) = in_use.take() else {
        return refuse(client);
    };
    client.heard();
    stream.set_read_timeout(None)?;
    loop {
        let ended = line.ends_with(b"\n");
        if !ended && line.len() < LONGEST_LINE {
            // The client disconnected, at the end of a line or in the middle of one.
            return Ok(());
        }
        let text = match answer(&line, events) {
            Ok(reply) => format!("{reply}\n"),
            Err(reason) => format!("error {reason}\n"),
        };
        writer.write_all(text.as_bytes())?;
        if !ended {
            return Ok(());
        }
        line.clear();
        reader
            .by_ref()
            .take(LONGEST_LINE as u64 + 2)
            .read_until(b'\n', &mut line)?;
    }
}

/// Has the board's thread carry out the request in a line.
fn answer(line: &[u8], events: &Sender<Event>) -> Result<Reply, String> {
    let line = str::from_utf8(line).map_err(|_| "the line is not ASCII text".to_owned())?;
    let request: Request = line.trim_end_matches(['\n', '\r']).parse()?;
    let (answers, answer) = mpsc::channel();
    let stopping = || "the simulator is stopping".to_owned();
    events
        .send(Event::Exact(request, answers))
        .map_err(|_| stopping())?;
    answer.recv().map_err(|_| stopping())?
}

/// The requests of the line's client, carried out one after another.
#[derive(Default)]
pub struct Requests {
    session: Session,
    /// The request under way, the virtual time at which it ends, and the receiver of its reply.
    under_way: Option<(Request, Time, Answers)>,
}

impl Requests {
    /// Begins to carry out a request.
    pub fn begin(&mut self, scene: &mut Scene, request: Request, answers: Answers) {
        match begin(scene.first(), &request) {
            Ok(until) => self.under_way = Some((request, until, answers)),
            // A client that has disconnected needs no answer. The same holds below.
            Err(reason) => drop(answers.send(Err(reason))),
        }
    }

    /// Returns whether a request is under way.
    pub fn busy(&self) -> bool {
        self.under_way.is_some()
    }

    /// Lets at most `slice` of virtual time pass for the request under way, and replies when its time is over.
    pub fn run(&mut self, scene: &mut Scene, slice: Time) {
        let Some((request, until, answers)) = self.under_way.take() else {
            return;
        };
        let now = scene.now();
        scene.run_until(until.min(now + slice));
        if scene.now() < until {
            self.under_way = Some((request, until, answers));
        } else {
            let reply = self.session.finish(scene.first(), &request);
            drop(answers.send(Ok(reply)));
        }
    }
}
