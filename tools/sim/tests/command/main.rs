//! The command `modio-sim` as a process: its output, its exit status, the options it refuses. Where the simulator has
//! no pseudo-terminals, the tests reach its line over TCP.

mod exact_line;
mod gateway;
mod gdb;
mod radio;
mod record;
mod running;
mod several;
mod unit;

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};

use modbus_line::adu::Framing;
use running::*;

#[test]
fn slot_that_the_board_does_not_have_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    let elf = elf.to_str().unwrap();
    refused(&["--elf", elf, "--slot", "1=4do"], &["modio-02", "port 1"]);
    let larger = ["--elf", elf, "--board", "modio-08", "--slot", "5=4do"];
    refused(&larger, &["modio-08", "port 5"]);
}

#[test]
fn without_pseudo_terminals_the_error_names_the_missing_option() {
    let mut bare = Command::new(env!("CARGO_BIN_EXE_modio-sim"));
    let output = bare.args(["--http", "127.0.0.1:0"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert_eq!(said.contains("--tcp"), !sim::options::PTY, "{said}");
}

#[cfg(unix)]
#[test]
fn signals_end_the_simulator_with_success_and_remove_the_link() {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    for signal in ["-INT", "-TERM"] {
        let link = directory.path().join("line");
        let pty = ["--pty", link.to_str().unwrap()];
        let more = if sim::options::PTY { &pty[..] } else { &[] };
        let mut running = Running::start_image(elf.to_str().unwrap(), more);
        let pty = running.line();
        if sim::options::PTY {
            assert_eq!(fs::read_link(&link).unwrap(), std::path::Path::new(&pty));
        }
        running.endpoint("http: http://127.0.0.1:");
        running.signal(signal);
        assert_eq!(running.end(), (Some(0), String::new()), "{signal}");
        assert!(
            fs::symlink_metadata(&link).is_err(),
            "{signal}: the link still exists"
        );
    }
}

#[test]
fn simulator_ends_after_the_given_time() {
    let begin = Instant::now();
    let mut running = Running::start_loop(&["--for", "300ms"]);
    assert_eq!(running.end().0, Some(0));
    assert!(begin.elapsed() >= Duration::from_millis(300));
}

#[test]
fn every_endpoint_is_announced_and_answers() {
    let fitting = ["--dip", "17", "--module", "2relay"];
    let mut running = Running::start_loop(&[&["--tcp", "127.0.0.1:0"][..], &fitting].concat());
    if sim::options::PTY {
        running.endpoint("pty: /");
    }
    let mut line = TcpStream::connect(running.endpoint("tcp: ")).unwrap();
    let url = running.endpoint("http: http://");
    let before = state(&url);
    assert_eq!(
        (&before["dip"], &before["module"]),
        (&17.into(), &"2relay".into())
    );
    line.write_all(&[1, 2, 3]).unwrap();
    eventually("the bytes did not arrive", || {
        state(&url)["line"]["rx_frames"] == 1
    });
}

#[test]
fn client_of_the_line_receives_the_bytes_of_other_clients_and_no_echo() {
    let endpoints = ["--tcp", "127.0.0.1:0", "--modbus-tcp", "127.0.0.1:0"];
    let mut running = Running::start_loop(&endpoints);
    running.skip_pty();
    let tcp = running.endpoint("tcp: ");
    let mut gateway = connect(&running.endpoint("modbus-tcp: "));
    let (mut master, mut observer) = (connect(&tcp), connect(&tcp));
    // Makes sure that the simulator has accepted both connections.
    observer.write_all(&[9]).unwrap();
    let mut received = [0; 3];
    master.read_exact(&mut received[..1]).unwrap();
    assert_eq!(received[0], 9);
    master.write_all(&[1, 2, 3]).unwrap();
    observer.read_exact(&mut received).unwrap();
    assert_eq!(received, [1, 2, 3]);
    let pdu = [3, 2, 0, 0, 1];
    gateway
        .write_all(&Framing::Mbap.frame(1, 17, &pdu))
        .unwrap();
    for client in [&mut master, &mut observer] {
        let mut request = [0; 8];
        client.read_exact(&mut request).unwrap();
        let text = "no echo in front of the request of the gateway";
        assert_eq!(request[..], Framing::Rtu.frame(0, 17, &pdu), "{text}");
    }
}

#[test]
fn an_image_that_is_missing_or_broken_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let broken = directory.path().join("modio");
    let broken = broken.to_str().unwrap();
    refused(&[], &["--elf", "cargo xtask sim"]);
    refused(&["--elf", broken], &[broken, NO_FILE]);
    fs::write(broken, "#!/bin/sh\n").unwrap();
    refused(&["--elf", broken], &[broken, "ELF"]);
    let whole = fs::read(endless_loop(directory.path())).unwrap();
    fs::write(broken, &whole[..whole.len() - 2]).unwrap();
    refused(&["--elf", broken], &[broken, "cut short"]);
}

#[test]
fn port_or_link_in_use_or_flash_file_that_cannot_be_written_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    let elf = elf.to_str().unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let http = ["--elf", elf, "--http", &address];
    refused(&http, &["--http", &address, IN_USE]);
    let refused = |option, value: &str, parts: &[&str]| {
        let arguments = ["--elf", elf, "--http", "127.0.0.1:0", option, value];
        refused(&arguments, parts);
    };
    refused("--tcp", &address, &[&address, IN_USE]);
    refused("--gdb", &address, &[&address, IN_USE]);
    refused("--modbus-tcp", &address, &["Modbus TCP", &address, IN_USE]);
    let part = if sim::options::PTY { elf } else { "--tcp" };
    refused("--pty", elf, &[part]);
    refused("--flash", "/nowhere/flash", &[NO_DIRECTORY]);
}

#[test]
fn flash_file_is_created_at_the_start_with_image_and_preset() {
    assert_preset(&[], &["--module", "4do"], "modio-02", &[(0x0114, 2)]);
    let board = ["--board", "modio-08"];
    let fitting = ["--module", "4do", "--slot", "2=4ai", "--slot", "4=4di"];
    let stored = [(0x0110, 2), (0x0111, 4), (0x0113, 1)];
    assert_preset(&board, &fitting, "modio-08", &stored);
}

/// Asserts that a flash file is as large as the flash of this board, that it holds only the image without a preset, and
/// the image and these settings with a preset.
fn assert_preset(board: &[&str], fitting: &[&str], name: &str, settings: &[(u16, u16)]) {
    let directory = tempfile::tempdir().unwrap();
    let elf = endless_loop(directory.path());
    let flash = directory.path().join("flash");
    let run = |more: &[&str]| {
        let first = ["--for", "10ms", "--flash", flash.to_str().unwrap()];
        let all = [&first[..], board, more].concat();
        let mut running = Running::start_image(elf.to_str().unwrap(), &all);
        assert_eq!(running.end(), (Some(0), String::new()));
        fs::read(&flash).unwrap()
    };
    let known: &register_map::Row = name.parse().unwrap();
    let size = if name == "modio-02" { 128 } else { 256 };
    let bare = run(&["--no-preset"]);
    assert_eq!(bare.len(), size * 1024);
    assert_eq!(
        bare[..4],
        [0x00, 0x50, 0x00, 0x20],
        "the file begins with the image"
    );
    assert!(
        bare[16..].iter().all(|byte| *byte == 0xFF),
        "the rest of the file is erased"
    );
    let fitted = run(fitting);
    let page = &fitted[(known.store().first - 0x0800_0000) as usize..];
    let (_, record) = register_map::record::records(page, known).next().unwrap();
    assert!(record.pairs().eq(settings.iter().copied()), "{name}");
    assert_eq!(
        run(&["--module", "4ai"]),
        fitted,
        "a preset does not change the stored configuration"
    );
}
