//! The command `modio-sim`: runs the boards and connects them to its endpoints. Virtual time follows the wall clock, or
//! with `--exact-line` the requests of a client.
//!
//! ```text
//! ptys, TCP ─bytes──┐                     ┌──> bytes to ptys and TCP
//! exact line ───────┤                     ├──> bytes and times to the exact line
//! HTTP ───request───┼─> one queue ─> run ─┼──> reply to HTTP, events to its listeners
//! Modbus TCP ───────┤                     ├──> responses to Modbus TCP
//! GDB ─────bytes────┤                     ├──> bytes to GDB, frames to the capture file
//! Ctrl-C, SIGTERM ──┘    the boards'    ├──> log on stdout
//!                        only thread      └──> findings on stderr
//! ```
//!
//! One thread owns the boards. The other threads wait for input and put it into the queue, which wakes the first
//! thread. So the boards need no lock, and a request does not wait for a tick of a clock.

use std::sync::{Weak, mpsc};

use modbus_line::adu::Framing;
use modbus_line::exact::Request;
use sim::Time;
use sim::options::Options;

mod action;
mod api;
mod attached;
mod boards;
mod capture;
mod clients;
mod disturbance;
mod exact_line;
mod faults;
mod findings;
mod flash_file;
mod frames;
mod gateway;
mod gdb;
mod http;
mod inside;
mod live;
mod pace;
#[cfg_attr(not(all(unix, not(target_os = "macos"))), path = "no_pty.rs")]
mod pty;
mod radio;
mod rs232;
mod run;
mod scenario;
mod scene;
mod state;
mod tcp;
mod terminals;
#[cfg(test)]
mod testing;
mod unit;

use flash_file::FlashFile;
pub use inside::version;
use scene::Scene;

/// Virtual time from power-on until the endpoints are made and printed. Every unit answers by then: a unit that
/// prepares its store, waits for its switch and has no crystal needs 360 ms (docs/safety.md), and its loader 100 ms.
const START_UP: Time = Time::from_ms(500);

/// Most virtual time, from power-on, that the simulator waits for the first board's LoRa module to enter normal mode,
/// before the endpoints are printed.
const RADIO_START_UP: Time = Time::from_secs(3);

/// Virtual time that a request and its reply have in [`rehearse`]: 30 characters at 9600 bit/s.
const REHEARSED: Time = Time::from_ms(60);

/// An event that wakes the thread of the boards.
enum Event {
    /// Bytes from the master at the pseudo-terminal, to be sent on the line.
    Bytes(Vec<u8>, Hold),
    /// Bytes from a client of `--tcp`, to be sent on the line.
    Tcp(Weak<clients::Client>, Vec<u8>, Hold),
    /// Bytes from a master, for the gateway radio.
    Radio(Vec<u8>, Hold),
    /// Bytes from a master, for the RS-232 socket.
    Rs232(Vec<u8>, Hold),
    /// A request to the HTTP interface, and the receiver of its reply.
    Request(api::Request, tokio::sync::oneshot::Sender<api::Reply>),
    /// From the debugger.
    Gdb(gdb::Message),
    /// From a client of the Modbus TCP gateway.
    Gateway(gateway::Message),
    /// From the client of the exact line, with the receiver of the answer.
    Exact(Request, exact_line::Answers),
    /// The simulator has to end.
    Stop,
}

/// The client of the line that has sent bytes. All other clients receive these bytes.
#[derive(Clone)]
enum Origin {
    Pty,
    Tcp(Weak<clients::Client>),
    Gateway,
}

/// While this exists, the endpoint that has sent an event reads no more bytes from its master, which then has to wait
/// as at a serial port.
type Hold = mpsc::Sender<()>;

/// Sends an event with bytes, and waits until the boards' thread wants more. Returns false when the simulator ends.
fn pass_on(
    bytes: &[u8],
    event: impl FnOnce(Vec<u8>, Hold) -> Event,
    events: &mpsc::Sender<Event>,
) -> bool {
    let (hold, held) = mpsc::channel();
    let sent = events.send(event(bytes.to_vec(), hold)).is_ok();
    // Nothing is ever sent: this returns when the hold is dropped.
    let _ = held.recv();
    sent
}

/// Runs boards as the options name them until each has served a request, and drops them. The boards that are made next
/// take over their cores, on which the code is translated: without that the first replies are late by the wall clock,
/// and a scan misses the units.
fn rehearse(options: &Options) -> Result<(), String> {
    let mut scene = Scene::new(boards::fitted(options)?);
    scene.run_until(START_UP);
    for n in 0..scene.units.len() {
        let address = scene.bus.board(n).dip();
        scene.put(Framing::Rtu.frame(0, address, &[0x11]), Origin::Gateway);
        scene.run_until(scene.now() + REHEARSED);
    }
    Ok(())
}

/// Runs the simulator until something stops it or its time is over.
///
/// # Errors
///
/// In one line: why the simulator cannot start, or why it cannot write the flash file at the end.
pub fn run(options: &Options) -> Result<(), String> {
    options.check_line()?;
    if options.exact_line.is_none() {
        rehearse(options)?;
    }
    let mut scene = Scene::new(boards::fitted(options)?);
    if let Some(line) = options.line {
        scene.fix_line(line);
    }
    if options.fixed_line {
        scene.fix_gateway();
    }
    if let Some(path) = &options.scenario {
        scene.scenario = scenario::Scenario::read(path, &scene.known())?;
    }
    let files = scene.units.iter().filter_map(|unit| unit.flash.as_ref());
    let notes = files.filter_map(FlashFile::noted);
    notes.for_each(|note| scene::complain(&note));
    // An unwritable file is reported now, not when the firmware saves something.
    scene.write_flash()?;
    let (events, queue) = mpsc::channel();

    let stop = events.clone();
    // Sending fails only after the receiver was dropped, when the simulator is ending anyway.
    ctrlc::set_handler(move || drop(stop.send(Event::Stop)))
        .map_err(|error| format!("cannot catch Ctrl-C: {error}"))?;

    // A client that finds an endpoint, such as the link to the pseudo-terminal, can use it immediately.
    scene.run_until(START_UP);
    scene.start_radio(RADIO_START_UP);
    let mut endpoints = match options.exact_line {
        Some(address) => run::Endpoints::Exact(exact_line::listen(address, events.clone())?),
        None => run::Endpoints::Clock {
            pty: pty::Pty::open(options.pty.as_deref(), events.clone(), Event::Bytes)?,
            lora: options
                .lora
                .as_deref()
                .map(|link| pty::Pty::open(Some(link), events.clone(), Event::Radio))
                .transpose()?,
            rs232: options
                .rs232
                .as_deref()
                .map(|link| pty::Pty::open(Some(link), events.clone(), Event::Rs232))
                .transpose()?,
            tcp: options
                .tcp
                .map(|address| tcp::Tcp::listen(address, events.clone()))
                .transpose()?,
        },
    };
    let mut live = live::Live::default();
    let http = http::listen(options.http, events.clone(), live.listeners())?;
    let gdb = options
        .gdb
        .map(|address| gdb::listen(address, events.clone()))
        .transpose()?;
    // Last, because it replaces a capture file that exists.
    let mut attached = attached::Attached::new(options, events)?;

    match &mut endpoints {
        run::Endpoints::Exact(address) => {
            // The line has taken over the unit's rate and format by now. From here on only the client changes them.
            scene.bus.line().set_follow(false);
            scene.announce("exact-line", address);
        }
        run::Endpoints::Clock { pty, tcp, .. } => {
            if options.fixed_line {
                let settings = scene.bus.line().settings();
                scene.fix_line(settings);
                pty.keep_own_rate(settings.baud)?;
            }
            if let Some(path) = pty.path() {
                scene.announce("pty", path.display());
            }
            if let Some(tcp) = tcp {
                scene.announce("tcp", tcp.address());
            }
            if let Some(gateway) = &attached.gateway {
                scene.announce("modbus-tcp", gateway.address());
            }
        }
    }
    scene.announce("http", format_args!("http://{http}/"));
    if let Some(gdb) = gdb {
        scene.announce("gdb", gdb);
    }
    for (name, path) in endpoints.others() {
        scene.announce(name, path.display());
    }

    run::until_stopped(
        &mut scene,
        &queue,
        &mut endpoints,
        &mut live,
        &mut attached,
        options.run_for,
    );
    scene.write_flash()
}
