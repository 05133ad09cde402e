//! Runs the board in step with the wall clock, and passes on what comes in and goes out.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::bench::Bench;
use super::flash_file::FlashFile;
use super::gdb::Session;
use super::pace::{Pace, span};
use super::{Event, api, pty, tcp};

/// The board is brought up to date at least so often: no byte waits longer to be passed on.
const SLICE: Duration = Duration::from_millis(1);

/// No longer than this in one go, so that Ctrl-C works on a machine too slow to keep up.
const AT_ONCE: Duration = Duration::from_millis(20);

/// Where what the unit sends is heard.
pub struct Endpoints {
    /// The pseudo-terminal.
    pub pty: pty::Pty,
    /// The TCP socket, if there is one.
    pub tcp: Option<tcp::Tcp>,
}

/// Runs until [`Event::Stop`], or for `limit` by the wall clock, and keeps the flash's file up to date.
pub fn until_stopped(
    bench: &mut Bench,
    queue: &Receiver<Event>,
    endpoints: &Endpoints,
    mut flash: Option<&mut FlashFile>,
    limit: Option<Duration>,
) {
    let begin = Instant::now();
    let mut pace = Pace::new(begin, bench.board.now());
    let mut debugger = Session::default();
    loop {
        let wall = Instant::now();
        catch_up(bench, &mut pace, &mut debugger);
        bench.tell();
        if let Some(file) = &mut flash {
            file.keep_or_tell(&bench.board);
        }
        let bytes = bench.heard();
        if !bytes.is_empty() {
            endpoints.pty.write(&bytes);
            endpoints.tcp.iter().for_each(|tcp| tcp.write(&bytes));
        }
        let mut wait = SLICE.saturating_sub(wall.elapsed());
        if let Some(limit) = limit {
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return;
            }
            wait = wait.min(left);
        }
        match queue.recv_timeout(wait) {
            Ok(Event::Bytes(bytes)) => {
                catch_up(bench, &mut pace, &mut debugger);
                bench.send(&bytes);
            }
            Ok(Event::Request(request, reply)) => {
                catch_up(bench, &mut pace, &mut debugger);
                let before = bench.board.now();
                // That the client has gone does not matter.
                let _ = reply.send(api::answer(bench, &request));
                if bench.board.now() > before {
                    // A power cycle takes its time at once: from here on in step again.
                    pace = Pace::new(Instant::now(), bench.board.now());
                }
            }
            Ok(Event::Gdb(message)) => {
                catch_up(bench, &mut pace, &mut debugger);
                debugger.take(message, bench);
            }
            Ok(Event::Stop) => return,
            // Without the senders there is only time left to pass.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(wait),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Brings virtual time to where the wall clock is, or a good way towards it; while a debugger has the core
/// halted it stands still.
fn catch_up(bench: &mut Bench, pace: &mut Pace, debugger: &mut Session) {
    let at = bench.board.now();
    if debugger.halted() {
        *pace = Pace::new(Instant::now(), at);
        return;
    }
    let target = pace.target(Instant::now(), at);
    debugger.run_until(target.min(at + span(AT_ONCE)), bench);
}
