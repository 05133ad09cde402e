//! The command `modio-sim`: the board between its endpoints, in step with the wall clock, or with
//! `--exact-line` in virtual time.
//!
//! ```text
//! pty, TCP ──bytes──┐                     ┌──> bytes to pty and TCP
//! exact line ───────┤                     ├──> bytes and times to the exact line
//! HTTP ───request───┼─> one queue ─> run ─┼──> reply to HTTP
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
use register_map::{Module, record};
use sim::board::{Layout, MODIO_02};
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

/// Where the flash begins.
const FLASH_BASE: u32 = 0x0800_0000;

/// So long the board has been on when the endpoints are announced: its start-up and the first silence on
/// the line are over then, and it answers.
const START_UP: Time = Time::from_ms(100);

/// What wakes the thread that has the board.
enum Event {
    /// Bytes from a master, to go out on the line.
    Bytes(Vec<u8>),
    /// A request to the HTTP interface, and where its reply goes.
    Request(api::Request, mpsc::Sender<api::Reply>),
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
    let layout = Layout::named(&options.board).ok_or("the simulator does not know this board")?;
    let opened = options
        .flash
        .as_deref()
        .map(|path| FlashFile::open(path, layout.part.flash_size));
    let (mut flash, stored) = match opened {
        Some(opened) => opened.map(|(file, stored)| (Some(file), stored))?,
        None => (None, None),
    };
    let mut bench = Bench::new(board(layout, options, stored)?);
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
    let http = http::listen(options.http, events.clone())?;
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
        flash.as_mut(),
        options.run_for,
    );
    flash
        .as_mut()
        .map_or(Ok(()), |file| file.keep(&bench.board))
}

/// The board, over the flash that a file held, with the image written over its own pages of it.
fn board(
    layout: &'static Layout,
    options: &Options,
    stored: Option<Vec<u8>>,
) -> Result<Board, String> {
    let elf = options.elf.as_deref().ok_or(
        "no image to run: give one with --elf FILE, or use `cargo xtask sim`, which builds one",
    )?;
    let image = image(elf)?;
    let mut flash = stored.unwrap_or_else(|| vec![0xFF; layout.part.flash_size]);
    let first = layout.slots[0].port;
    let named = options.slots.iter().rfind(|(port, _)| *port == first);
    let module = named.map_or(options.module, |&(_, module)| module);
    // Where the configuration of another board is stored is not defined yet.
    if options.preset() && layout.name == MODIO_02.name {
        write_preset(&mut flash, module);
    }
    let config = Config {
        layout,
        dip: options.dip,
        module,
        slots: options.slots.clone(),
        corner: options.corner.parse()?,
        flash: Some(flash),
        ..Config::default()
    };
    Board::new(&image, config).map_err(|error| match error {
        sim::Error::Slot(_) => format!("{}: {error}", layout.name),
        _ => format!("{}: {error}", elf.display()),
    })
}

fn image(elf: &Path) -> Result<Image, String> {
    Image::read(elf).map_err(|error| format!("cannot run the image {error}"))
}

/// Stores a configuration that knows which module is plugged, when nothing is stored.
fn write_preset(flash: &mut [u8], module: Module) {
    let start = |address| (address - FLASH_BASE) as usize;
    let page = |address| start(address)..start(address) + record::PAGE_SIZE;
    let vacant = |address| record::is_vacant(&flash[page(address)]);
    let [first, second] = record::PAGE_ADDRESSES;
    if vacant(first) && vacant(second) {
        let page = &mut flash[page(first)];
        page.fill(0xFF);
        page[..record::PRESET_LEN].copy_from_slice(&record::module_in_slot(module));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLASH_SIZE: usize = MODIO_02.part.flash_size;

    #[test]
    fn a_preset_is_stored_only_where_nothing_is() {
        let mut flash = vec![0xFF; FLASH_SIZE];
        write_preset(&mut flash, Module::Do4);
        let at = (record::PAGE_ADDRESSES[0] - FLASH_BASE) as usize;
        let stored = record::module_in_slot(Module::Do4);
        assert_eq!(flash[at..at + stored.len()], stored);
        let written = flash.iter().filter(|byte| **byte != 0xFF).count();
        assert!(written <= stored.len(), "nothing else is written");
        let before = flash.clone();
        write_preset(&mut flash, Module::Di4);
        assert_eq!(flash, before, "what is stored stays");
        let mut flash = vec![0xFF; FLASH_SIZE];
        flash[(record::PAGE_ADDRESSES[1] - FLASH_BASE) as usize + 500] = 0;
        let before = flash.clone();
        write_preset(&mut flash, Module::Di4);
        assert_eq!(flash, before, "even what is damaged");
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
