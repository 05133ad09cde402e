//! The command `modio-sim`: the board between its endpoints, in step with the wall clock, or with
//! `--exact-line` in virtual time.
//!
//! ```text
//! pty, TCP ──bytes──┐                     ┌──> bytes to pty and TCP
//! exact line ───────┤                     ├──> bytes and times to the exact line
//! HTTP ───request───┼─> one queue ─> run ─┼──> reply to HTTP, events to those who listen
//! GDB ─────bytes────┤                     ├──> bytes to GDB
//! Ctrl-C, SIGTERM ──┘    the board's only ├──> log on stdout
//!                        thread           └──> findings on stderr
//! ```
//!
//! One thread owns the board; the others wait for input and put it into the queue, which wakes that
//! thread, so that nothing is locked and a request waits for no tick of a clock.

use std::path::Path;
use std::sync::mpsc;

use ::exact_line::Request;
use register_map::configuration;
use sim::board::Layout;
use sim::line::{Format, Settings};
use sim::{Board, Config, Image, Time};
use sim_options::Options;

mod api;
mod bench;
mod exact_line;
mod flash_file;
mod frames;
mod gdb;
mod http;
mod live;
mod pace;
mod pty;
mod run;
mod state;
mod summary;
mod tcp;
#[cfg(test)]
mod testing;

use bench::Bench;
use flash_file::FlashFile;

/// So long the board has been on when the endpoints are announced: its start-up and the first silence on
/// the line are over then, and it answers.
const START_UP: Time = Time::from_ms(100);

/// What wakes the thread that has the board.
enum Event {
    /// Bytes from a master, to go out on the line.
    Bytes(Vec<u8>),
    /// A request to the HTTP interface, and where its reply goes.
    Request(api::Request, tokio::sync::oneshot::Sender<api::Reply>),
    /// From the debugger.
    Gdb(gdb::Message),
    /// From the client of the exact line, and where the answer goes.
    Exact(Request, exact_line::Answers),
    /// Time to end.
    Stop,
}

/// Runs the simulator until it is told to stop or its time is up.
///
/// # Errors
///
/// In one line: what keeps it from starting, or the flash's file from being written at the end.
pub fn run(options: &Options) -> Result<(), String> {
    let layout = Layout::of(options.board).ok_or("the simulator does not know this board")?;
    let opened = options
        .flash
        .as_deref()
        .map(|path| FlashFile::open(path, layout.part.flash_size));
    let (mut flash, stored) = match opened {
        Some(opened) => opened.map(|(file, stored)| (Some(file), stored))?,
        None => (None, None),
    };
    let mut bench = Bench::new(fitted(layout, options, stored)?);
    if let Some((baud, format)) = &options.line {
        let format = Format::named(format).ok_or("the simulator does not know this format")?;
        bench.fix_line(Settings {
            baud: *baud,
            format,
        });
    }
    let (events, queue) = mpsc::channel();

    let stop = events.clone();
    // The receiver is gone only when the end has come already.
    ctrlc::set_handler(move || drop(stop.send(Event::Stop)))
        .map_err(|error| format!("cannot catch Ctrl-C: {error}"))?;

    let endpoints = match options.exact_line {
        Some(address) => run::Endpoints::Exact(exact_line::listen(address, events.clone())?),
        None => run::Endpoints::Clock {
            pty: pty::Pty::open(options.pty.as_deref(), events.clone())?,
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
        .map(|address| gdb::listen(address, events))
        .transpose()?;
    // An unwritable file is reported now, not when the firmware saves something.
    flash
        .as_mut()
        .map_or(Ok(()), |file| file.keep(&bench.board))?;

    bench.board.run_until(START_UP);
    match &endpoints {
        run::Endpoints::Exact(address) => {
            // The unit has set its UART up by now. From here on the client says what its own end has.
            bench.board.line().set_follow(false);
            bench::say(&format!("exact-line: {address}"));
        }
        run::Endpoints::Clock { pty, tcp } => {
            bench::say(&format!("pty: {}", pty.path().display()));
            if let Some(tcp) = tcp {
                bench::say(&format!("tcp: {}", tcp.address()));
            }
        }
    }
    bench::say(&format!("http: http://{http}/"));
    if let Some(gdb) = gdb {
        bench::say(&format!("gdb: {gdb}"));
    }

    run::until_stopped(
        &mut bench,
        &queue,
        &endpoints,
        &mut live,
        flash.as_mut(),
        options.run_for,
    );
    flash
        .as_mut()
        .map_or(Ok(()), |file| file.keep(&bench.board))
}

/// The board, over the flash that a file held, with the image written over its own pages of it.
fn fitted(
    layout: &'static Layout,
    options: &Options,
    stored: Option<Vec<u8>>,
) -> Result<Board, String> {
    let elf = options.elf.as_deref().ok_or(
        "no image to run: give one with --elf FILE, or use `cargo xtask sim`, which builds one",
    )?;
    let image = image(elf)?;
    let mut flash = stored.unwrap_or_else(|| vec![0xFF; layout.part.flash_size]);
    let mut config = Config {
        layout,
        dip: options.dip,
        module: options.module,
        slots: options.slots.clone(),
        corner: options.corner.parse()?,
        ..Config::default()
    };
    if options.preset() {
        write_preset(&config, &mut flash);
    }
    config.flash = Some(flash);
    Board::new(&image, config).map_err(|error| match error {
        sim::Error::Slot(_) => format!("{}: {error}", options.board),
        _ => format!("{}: {error}", elf.display()),
    })
}

fn image(elf: &Path) -> Result<Image, String> {
    Image::read(elf).map_err(|error| format!("cannot run the image {error}"))
}

/// Stores a configuration that knows which modules are plugged, when nothing is stored.
fn write_preset(config: &Config, flash: &mut [u8]) {
    if config.layout.stores_nothing(flash) {
        // One setting for each port: they fit.
        let settings: Vec<_> = configuration::modules(config.plugged()).collect();
        config.layout.store(flash, &settings);
    }
}

#[cfg(test)]
mod tests {
    use register_map::{Module, record};
    use sim::machine::memory::FLASH_BASE;

    use super::*;

    #[test]
    fn a_preset_names_every_plugged_module_and_is_stored_only_where_nothing_is() {
        for layout in Layout::ALL {
            let fitted = |module| Config {
                layout,
                slots: layout
                    .slots
                    .iter()
                    .map(|slot| (slot.port, module))
                    .collect(),
                ..Config::default()
            };
            let mut flash = vec![0xFF; layout.part.flash_size];
            write_preset(&fitted(Module::Do4), &mut flash);
            let at = (layout.board.store.first - FLASH_BASE) as usize;
            let page = at..at + layout.board.store.bytes as usize;
            let (_, record) = record::records(&flash[page]).next().unwrap();
            let modules = layout.board.ports().map(|port| (0x010F + port, 2));
            assert!(record.pairs().eq(modules), "{}", layout.board);
            let before = flash.clone();
            write_preset(&fitted(Module::Di4), &mut flash);
            assert_eq!(flash, before, "what is stored stays");

            let mut flash = vec![0xFF; layout.part.flash_size];
            let [_, second] = layout.board.store.addresses();
            flash[(second - FLASH_BASE) as usize + 500] = 0;
            let before = flash.clone();
            write_preset(&fitted(Module::Di4), &mut flash);
            assert_eq!(flash, before, "even what is damaged");
        }
    }

    #[test]
    fn a_broken_image_is_told_with_its_path() {
        let directory = tempfile::tempdir().unwrap();
        let elf = directory.path().join("modio");
        assert!(image(&elf).unwrap_err().contains("modio"), "missing");
        std::fs::write(&elf, b"#!/bin/sh\n").unwrap();
        let text = image(&elf).unwrap_err();
        assert!(
            text.contains("modio") && text.contains("ELF") && !text.contains('\n'),
            "{text}"
        );
    }
}
