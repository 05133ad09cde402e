//! Runs the boards in step with the wall clock or on request, and passes input and output between them and the
//! endpoints.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use sim::Time;

use super::attached::Attached;
use super::exact_line::Requests;
use super::gdb::Session;
use super::live::Live;
use super::pace::{Pace, Speed, span};
use super::scene::Scene;
use super::{Event, Hold, Origin, api, pty, tcp};

/// Longest time between two updates of the boards: no byte waits longer to be passed on.
const SLICE: Duration = Duration::from_millis(1);

/// Most virtual time that passes between two looks at the queue, so that Ctrl-C works on a computer that is too slow to
/// keep up.
const AT_ONCE: Duration = Duration::from_millis(20);

/// Virtual time that the bytes of a master may take to send before no more are read from it.
const AHEAD: Time = Time::from_secs(1);

/// Longest time that the loop waits for an event.
const IDLE: Duration = Duration::from_secs(1);

/// The endpoints that carry the line's bytes.
pub enum Endpoints {
    /// Virtual time follows the wall clock.
    Clock {
        /// The pseudo-terminal.
        pty: pty::Pty,
        /// The TCP socket, with `--tcp`.
        tcp: Option<tcp::Tcp>,
        /// The pseudo-terminal of the gateway radio, with `--lora`.
        lora: Option<pty::Pty>,
        /// The pseudo-terminal of the RS-232 socket, with `--rs232`.
        rs232: Option<pty::Pty>,
    },
    /// The exact line at this address: virtual time passes when its client asks for it.
    Exact(SocketAddr),
}

impl Endpoints {
    /// Returns the pseudo-terminals that are not those of the RS-485 line, with their names.
    pub fn others(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let (lora, rs232) = match self {
            Self::Clock { lora, rs232, .. } => (lora.as_ref(), rs232.as_ref()),
            Self::Exact(_) => (None, None),
        };
        let named = [("lora", lora), ("rs232", rs232)];
        named
            .into_iter()
            .filter_map(|(name, pty)| Some((name, pty?.path()?)))
    }
}

/// Runs until [`Event::Stop`], or for `limit` by the wall clock, and keeps the flash files up to date.
pub fn until_stopped(
    scene: &mut Scene,
    queue: &Receiver<Event>,
    endpoints: &mut Endpoints,
    live: &mut Live,
    attached: &mut Attached,
    limit: Option<Duration>,
) {
    let begin = Instant::now();
    let mut clock = Clock {
        pace: match endpoints {
            Endpoints::Clock { .. } => Some(Pace::new(begin, scene.now())),
            Endpoints::Exact(_) => None,
        },
        speed: Speed::new(begin, scene.now()),
        debugger: Session::default(),
    };
    let mut requests = Requests::default();
    // The ends of the bytes that masters have sent, while no more are read from them.
    let mut holds: Vec<(Time, Hold)> = Vec::new();
    loop {
        let wall = Instant::now();
        clock.catch_up(scene);
        requests.run(scene, span(AT_ONCE));
        holds.retain(|(end, _)| *end > scene.now() + AHEAD);
        scene.print_news();
        live.send(scene, wall);
        attached.update(scene, clock.debugger.halted());
        scene.keep_flash();
        let mut wait = if requests.busy() {
            Duration::ZERO
        } else {
            IDLE
        };
        if let Endpoints::Clock {
            pty,
            tcp,
            lora,
            rs232,
        } = endpoints
        {
            if let Some(baud) = pty.take_rate() {
                scene.set_client_rate(baud);
            }
            for (origin, bytes) in scene.take_sent() {
                if !matches!(origin, Origin::Pty) {
                    pty.write(&bytes);
                }
                tcp.iter().for_each(|tcp| tcp.write(&bytes, Some(&origin)));
            }
            let bytes = scene.take_received();
            if !bytes.is_empty() {
                pty.write(&bytes);
                tcp.iter().for_each(|tcp| tcp.write(&bytes, None));
            }
            if let Some(lora) = lora {
                let bytes = scene.take_received_by_radio();
                if !bytes.is_empty() {
                    lora.write(&bytes);
                }
            }
            if let Some(rs232) = rs232 {
                let bytes = scene.take_received_by_rs232();
                if !bytes.is_empty() {
                    rs232.write(&bytes);
                }
            }
            wait = SLICE.saturating_sub(wall.elapsed());
        }
        if let Some(limit) = limit {
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return;
            }
            wait = wait.min(left);
        }
        match queue.recv_timeout(wait) {
            Ok(Event::Bytes(bytes, hold)) => {
                clock.catch_up(scene);
                holds.push((scene.send(&bytes, Origin::Pty), hold));
            }
            Ok(Event::Tcp(client, bytes, hold)) => {
                clock.catch_up(scene);
                holds.push((scene.send(&bytes, Origin::Tcp(client)), hold));
            }
            Ok(Event::Radio(bytes, hold)) => {
                clock.catch_up(scene);
                holds.push((scene.send_by_radio(&bytes), hold));
            }
            Ok(Event::Rs232(bytes, hold)) => {
                clock.catch_up(scene);
                holds.push((scene.send_by_rs232(&bytes), hold));
            }
            Ok(Event::Gateway(message)) => {
                if let Some(gateway) = &mut attached.gateway {
                    gateway.take(message);
                }
            }
            Ok(Event::Exact(request, answers)) => requests.begin(scene, request, answers),
            Ok(Event::Request(request, reply)) => {
                clock.catch_up(scene);
                let before = scene.now();
                // A client that has disconnected needs no reply.
                let _ = reply.send(api::answer(scene, &request));
                if scene.now() > before {
                    // A power cycle has let virtual time pass, so it is ahead of the wall clock. Start from here.
                    clock.restart(scene.now());
                }
            }
            Ok(Event::Gdb(message)) => {
                clock.catch_up(scene);
                clock.debugger.take(message, scene);
            }
            Ok(Event::Stop) => return,
            // No sender is left, so no event can arrive: only let time pass.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(wait),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Lets virtual time pass with the wall clock, or as a debugger wants.
struct Clock {
    /// The wall clock; `None` when time passes on request only.
    pace: Option<Pace>,
    speed: Speed,
    debugger: Session,
}

impl Clock {
    /// Pairs the present of the wall clock with the virtual time `at`.
    fn restart(&mut self, at: Time) {
        if let Some(pace) = &mut self.pace {
            let wall = Instant::now();
            *pace = Pace::new(wall, at);
            self.speed.restart(wall, at);
        }
    }

    /// Lets virtual time catch up with the wall clock, by at most [`AT_ONCE`]. It stands still while a debugger has
    /// halted the core.
    fn catch_up(&mut self, scene: &mut Scene) {
        let at = scene.now();
        if self.debugger.halted() {
            return self.restart(at);
        }
        if let Some(pace) = &mut self.pace {
            let wall = Instant::now();
            let target = pace.target(wall, at);
            if let Some(percent) = self.speed.too_low(wall, at) {
                eprintln!(
                    "modio-sim: warning: this computer has run the boards at {percent} % of their speed in the last 10 s: if that goes on, give masters a longer time-out, or simulate fewer boards"
                );
            }
            self.debugger
                .run_until(target.min(at + span(AT_ONCE)), scene);
        }
    }
}
