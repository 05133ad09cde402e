//! The capture file of the running command.

use std::fs;
use std::io::Write;
use std::net::TcpStream;
use std::path::Path;

use modbus_line::adu::Framing;
use pcap_file::pcapng::{Block, PcapNgReader};

use super::{ENDS, Running, eventually};

/// Returns time in ns and data of each packet in a file, which must be complete.
pub fn packets(path: &Path) -> Vec<(u128, Vec<u8>)> {
    let file = fs::read(path).unwrap();
    let mut reader = PcapNgReader::new(&file[..]).unwrap();
    let mut packets = Vec::new();
    while let Some(block) = reader.next_block() {
        if let Block::EnhancedPacket(packet) = block.unwrap() {
            packets.push((packet.timestamp.as_nanos(), packet.data.into_owned()));
        }
    }
    packets
}

#[test]
fn capture_file_is_readable_while_the_simulator_runs_and_complete_at_its_end() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.pcapng");
    fs::write(&path, "an older file").unwrap();
    for (signal, status) in ENDS {
        let record = ["--record", path.to_str().unwrap()];
        let mut running = Running::start_loop(&[["--tcp", "127.0.0.1:0"], record].concat());
        running.skip_pty();
        let mut line = TcpStream::connect(running.endpoint("tcp: ")).unwrap();
        assert!(packets(&path).is_empty(), "{signal}: the new file is empty");
        let frame = Framing::Rtu.frame(0, 1, &[3, 0, 0, 0, 1]);
        for count in 1..=3 {
            line.write_all(&frame).unwrap();
            eventually("the frame is not in the file", || {
                packets(&path).len() == count
            });
        }
        running.signal(signal);
        assert_eq!(running.end().0, *status, "{signal}");
        let packets = packets(&path);
        assert_eq!(packets.len(), 3, "{signal}");
        assert!(packets.iter().all(|(_, data)| data.ends_with(&frame)));
    }
}

#[test]
fn recording_of_the_exact_line_has_the_instants_of_virtual_time() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.pcapng");
    let mut files = Vec::new();
    for _ in 0..2 {
        let record = ["--record", path.to_str().unwrap()];
        let mut running = Running::start_loop(&[["--exact-line", "127.0.0.1:0"], record].concat());
        let mut line = TcpStream::connect(running.endpoint("exact-line: ")).unwrap();
        line.write_all(b"hello 1\nrun 1000\nsend 01 07 41 E2\nrun 2000000\n")
            .unwrap();
        eventually("the frame is not in the file", || {
            !packets(&path).is_empty()
        });
        let (signal, status) = ENDS[0];
        running.signal(signal);
        assert_eq!(running.end().0, status);
        files.push(packets(&path));
    }
    assert_eq!(files[0][0].0, 501_000_000, "500 ms of start-up, and 1 ms");
    assert_eq!(files[0], files[1], "every run has the same instants");
}

#[cfg(target_os = "linux")]
#[test]
fn capture_file_that_cannot_be_written_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let elf = super::endless_loop(directory.path());
    for (path, part) in [
        ("/nowhere/line.pcapng", "No such file"),
        (directory.path().to_str().unwrap(), "directory"),
        ("/dev/full", "No space"),
    ] {
        let elf = ["--elf", elf.to_str().unwrap(), "--http", "127.0.0.1:0"];
        super::refused(&[&elf[..], &["--record", path]].concat(), &[path, part]);
    }
}
