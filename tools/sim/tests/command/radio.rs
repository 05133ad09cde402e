//! `--lora`: the gateway radio on a separate pseudo-terminal.

use std::fs::{self, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;

use crate::running::*;

#[allow(dead_code, reason = "the tests of the core use all of the assembler")]
#[path = "../../../f103/tests/machine/asm.rs"]
mod asm;
#[path = "../board/echo.rs"]
mod echo;
#[allow(dead_code, reason = "the tests of the core use all of the registers")]
#[path = "../../../f103/tests/machine/regs.rs"]
mod regs;

/// Writes an ELF file whose firmware sends each byte from the air back, plus one.
fn echoing(directory: &Path) -> String {
    let mut program = echo::set_up();
    echo::select_normal_mode(&mut program);
    echo::echo(&mut program);
    let bytes = program.bytes();
    let halves = bytes
        .chunks(2)
        .map(|half| u16::from_le_bytes([half[0], half[1]]));
    let elf = elf(directory, &halves.collect::<Vec<_>>());
    elf.to_str().unwrap().to_owned()
}

#[test]
fn gateway_is_the_last_endpoint_and_its_link_is_removed_at_the_end() {
    if !sim::options::PTY {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let elf = echoing(directory.path());
    let link = directory.path().join("radio");
    let more = ["--gdb", "127.0.0.1:0", "--lora", link.to_str().unwrap()];
    let mut running = Running::start_image(&elf, &more);
    let line = running.line();
    running.endpoint("http: http://");
    running.endpoint("gdb: ");
    let path = running.endpoint("lora: ");
    assert_ne!(path, line);
    assert_eq!(fs::read_link(&link).unwrap(), Path::new(&path));
    running.signal("-TERM");
    assert_eq!(running.end(), (Some(0), String::new()));
    assert!(
        fs::symlink_metadata(&link).is_err(),
        "the link still exists"
    );
}

#[test]
fn bytes_at_the_gateway_reach_the_board_and_its_answer_comes_back() {
    if !sim::options::PTY {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let elf = echoing(directory.path());
    let link = directory.path().join("radio");
    let link = link.to_str().unwrap();
    for boards in [
        &[][..],
        &["--board", "modio-08"],
        &["--unit", "1", "--unit", "2"],
    ] {
        let mut running = Running::start_image(&elf, &[&["--lora", link][..], boards].concat());
        running.line();
        let http = running.endpoint("http: http://");
        running.endpoint("lora: ");
        let before = state(&http);
        assert_eq!(
            before["radio"]["mode"], "normal",
            "it is ready when it is announced"
        );
        let file = OpenOptions::new().read(true).write(true).open(link);
        let mut gateway = file.unwrap();
        gateway.write_all(b"HAL").unwrap();
        // The answers of two boards destroy each other.
        let single = !boards.contains(&"--unit");
        if single {
            let mut answer = [0; 3];
            gateway.read_exact(&mut answer).unwrap();
            assert_eq!(&answer, b"IBM");
        }
        eventually("no answer was sent", || {
            state(&http)["radio"]["packets_sent"] == 1
        });
        let radio = state(&http)["radio"].take();
        assert_eq!(radio["packets_received"], 1, "{radio}");
        assert_eq!(
            (&radio["channel_mhz"], &radio["air_rate"]),
            (&433.into(), &2400.into())
        );
        running.signal("-TERM");
        assert_eq!(running.end(), (Some(0), String::new()));
    }
}
