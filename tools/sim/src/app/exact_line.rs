//! The RS-485 line in virtual time on a TCP socket: `--exact-line`. The protocol is in docs/conformance.md.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::thread;

use ::exact_line::{LONGEST_LINE, Reply, Request};
use sim::Time;
use sim::exact_line::{Session, begin};

use super::Event;
use super::bench::Bench;

/// Takes the answer to a request: a reply, or the reason why the request cannot be carried out.
pub type Answers = Sender<Result<Reply, String>>;

/// Starts to listen at `address`, and returns the address: with port 0 the system chooses the port.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let cannot = |error| format!("cannot serve the exact line at {address}: {error}");
    let listener = TcpListener::bind(address).map_err(cannot)?;
    let address = listener.local_addr().map_err(cannot)?;
    let in_use = Arc::new(AtomicBool::new(false));
    thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            if in_use.swap(true, Ordering::AcqRel) {
                // A client that disconnects instead of reading this does not matter.
                let _ = stream.write_all(b"error the line is in use by another client\n");
                continue;
            }
            let (events, in_use) = (events.clone(), Arc::clone(&in_use));
            thread::spawn(move || {
                // An error is the end of the connection.
                let _ = serve(&stream, &events);
                in_use.store(false, Ordering::Release);
            });
        }
    });
    Ok(address)
}

/// Serves a client until it disconnects.
fn serve(stream: &TcpStream, events: &Sender<Event>) -> std::io::Result<()> {
    // Requests and replies are short and alternate. Collecting more bytes before sending would only delay them.
    stream.set_nodelay(true)?;
    let mut reader = BufReader::new(stream);
    let mut writer = stream;
    loop {
        let mut line = Vec::new();
        let length = reader
            .by_ref()
            .take(LONGEST_LINE as u64 + 2)
            .read_until(b'\n', &mut line)?;
        if length == 0 {
            return Ok(());
        }
        let ended = line.ends_with(b"\n");
        if !ended && length < LONGEST_LINE {
            // The client disconnected in the middle of a line.
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
    pub fn begin(&mut self, bench: &mut Bench, request: Request, answers: Answers) {
        match begin(bench.first(), &request) {
            Ok(until) => self.under_way = Some((request, until, answers)),
            // A client that has disconnected needs no answer. The same holds below.
            Err(reason) => drop(answers.send(Err(reason))),
        }
    }

    /// Whether a request is under way.
    pub fn busy(&self) -> bool {
        self.under_way.is_some()
    }

    /// Lets at most `slice` of virtual time pass for the request under way, and replies when its time is over.
    pub fn run(&mut self, bench: &mut Bench, slice: Time) {
        let Some((request, until, answers)) = self.under_way.take() else {
            return;
        };
        let now = bench.now();
        bench.run_until(until.min(now + slice));
        if bench.now() < until {
            self.under_way = Some((request, until, answers));
        } else {
            let reply = self.session.finish(bench.first(), &request);
            drop(answers.send(Ok(reply)));
        }
    }
}
