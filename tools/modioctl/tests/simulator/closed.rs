//! Tests of a standard error and of a terminal that are closed while the program runs.

use std::io::{Read, pipe};
use std::net::SocketAddr;

use portable_pty::{CommandBuilder, PtySize, native_pty_system};
use register_map::Module;

use crate::program::At;
use crate::served::{Answers, Modio, serve_requests};

/// Serves a modio-02 with digital inputs at address 1.
fn unit() -> SocketAddr {
    let mut server = Modio::modio_02(Module::Di4);
    serve_requests(move |unit, pdu| {
        Some(match unit {
            1 => server.response(unit, pdu),
            _ => Vec::new(),
        })
    })
}

#[test]
fn closed_standard_error_keeps_the_exit_status() {
    let at = At::tcp(unit());
    for (words, status) in [
        ("--trace read p5.1", 0),
        ("frobnicate", 2),
        ("read BUAD", 2),
        ("--unit 9 --timeout 20ms read 0", 3),
    ] {
        let (reader, writer) = pipe().unwrap();
        drop(reader);
        let ended = at.command(words).stderr(writer).output().unwrap();
        assert_eq!(ended.status.code(), Some(status), "{words}");
    }
}

#[test]
fn monitor_ends_with_status_0_when_its_terminal_is_closed() {
    let pty = native_pty_system().openpty(PtySize::default()).unwrap();
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_modioctl"));
    command.args(["--tcp", &unit().to_string(), "monitor"]);
    let mut child = pty.slave.spawn_command(command).unwrap();
    drop(pty.slave);
    let mut output = pty.master.try_clone_reader().unwrap();
    let mut shown = Vec::new();
    while !String::from_utf8_lossy(&shown).contains("p5.1") {
        let mut bytes = [0; 4096];
        let count = output.read(&mut bytes).unwrap();
        shown.extend(&bytes[..count]);
    }
    drop(output);
    drop(pty.master);
    let status = child.wait().unwrap();
    assert!(status.success(), "{status:?}");
}
