//! Tests of `modioctl sniff` next to a master.

use std::io::Write;
use std::net::TcpListener;
use std::sync::mpsc::channel;
use std::time::Duration;

use portable_pty::{PtySize, native_pty_system};

use crate::bus;
use crate::program::At;
use crate::unit::Unit;

/// A master writes and reads an output twice, and the bytes on the line are passed to the listener.
fn both_directions_are_shown(listener: &At, mut carry: impl FnMut(&[u8])) {
    let unit = Unit::with(1, &["--module", "4do"]);
    let (heard, hear) = channel();
    let line = bus::of(&[unit.tcp], move |bytes| {
        let _ = heard.send(bytes.to_vec());
    });
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("line.pcapng");
    let mut listener = listener.start(&format!("sniff --record {}", capture.display()));
    listener.err.wait_for("listening at");
    let master = At::tcp(line);
    let text = master.run("raw 05 0010 FF00").fine();
    assert_eq!(text.lines().count(), 2);
    master.run("raw 01 0010 0004").fine();
    while let Ok(bytes) = hear.recv_timeout(Duration::from_millis(500)) {
        carry(&bytes);
    }
    for part in [
        "write single coil 0x0010",
        "write single coil 0x0010",
        "read coils 0x0010",
        "read coils",
    ] {
        listener.out.wait_for(part);
    }
    let capture = std::fs::read(capture).unwrap();
    let section_header = [0x0A, 0x0D, 0x0D, 0x0A];
    assert!(capture.starts_with(&section_header));
    // Each frame is in the file as it was on the line.
    let write = [1, 5, 0, 0x10, 0xFF, 0];
    let times = capture.windows(6).filter(|bytes| *bytes == write).count();
    assert_eq!(times, 2);
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn sniff_over_tcp_shows_and_records_both_directions() {
    let socket = TcpListener::bind("127.0.0.1:0").unwrap();
    let listener = At::tcp(socket.local_addr().unwrap());
    let mut stream = None;
    both_directions_are_shown(&listener, |bytes| {
        let stream = stream.get_or_insert_with(|| socket.accept().unwrap().0);
        stream.write_all(bytes).unwrap();
    });
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn sniff_on_a_pseudo_terminal_shows_and_records_both_directions() {
    let pty = native_pty_system().openpty(PtySize::default()).unwrap();
    let listener = At::port(pty.master.tty_name().unwrap().display());
    let mut wire = pty.master.take_writer().unwrap();
    both_directions_are_shown(&listener, |bytes| {
        wire.write_all(bytes).unwrap();
        wire.flush().unwrap();
    });
}
