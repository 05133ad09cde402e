//! Tests of the terminal from the side of a master.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::sync::mpsc::{self, Receiver};

use super::*;
use crate::app::testing::eventually;

fn open(path: &Path) -> File {
    OpenOptions::new()
        .read(true)
        .write(true)
        .open(path)
        .unwrap()
}

/// Receives bytes for the line, at least `wanted`.
fn received(queue: &Receiver<Event>, wanted: usize) -> Vec<u8> {
    let mut all = Vec::new();
    while all.len() < wanted {
        match queue.recv_timeout(Duration::from_secs(20)) {
            Ok(Event::Bytes(bytes, _)) => all.extend(bytes),
            _ => panic!("only {all:?} was received, {wanted} bytes expected"),
        }
    }
    all
}

fn is_open(pty: &Pty) -> bool {
    !state(&pty.master, PollFlags::OUT, Some(Duration::ZERO)).contains(PollFlags::HUP)
}

#[test]
fn every_byte_value_passes_unchanged_in_both_directions() {
    let (events, queue) = mpsc::channel();
    let pty = Pty::open(None, events, Event::Bytes).unwrap();
    let mut master = open(pty.path().unwrap());
    let all: Vec<u8> = (0..=255).collect();
    master.write_all(&all).unwrap();
    assert_eq!(received(&queue, 256), all);
    pty.write(&all);
    let mut read = vec![0; 256];
    master.read_exact(&mut read).unwrap();
    assert_eq!(read, all, "no byte is echoed, lost or translated");
}

#[test]
fn next_master_can_open_the_terminal_and_receives_no_old_bytes() {
    let (events, queue) = mpsc::channel();
    let pty = Pty::open(None, events, Event::Bytes).unwrap();
    for round in 0..3_u8 {
        let mut master = open(pty.path().unwrap());
        master.write_all(&[round, 0x0A, 0x0D, 0x03]).unwrap();
        assert_eq!(received(&queue, 4), [round, 0x0A, 0x0D, 0x03]);
        pty.write(&[round]);
        let mut read = [0];
        master.read_exact(&mut read).unwrap();
        assert_eq!(read, [round]);
        drop(master);
        eventually("the terminal is not closed", || !is_open(&pty));
        pty.write(&[0xEE; 10]);
    }
}

#[test]
fn writing_does_not_wait_for_a_master_that_does_not_read() {
    let (events, _queue) = mpsc::channel();
    let pty = Pty::open(None, events, Event::Bytes).unwrap();
    let _master = open(pty.path().unwrap());
    let (done, is_done) = mpsc::channel();
    thread::spawn(move || {
        for _ in 0..1000 {
            pty.write(&[0x55; 256]);
        }
        done.send(())
    });
    let ended = is_done.recv_timeout(Duration::from_secs(20));
    assert!(ended.is_ok(), "a write waits for the master");
}

#[test]
fn no_more_bytes_are_read_while_the_last_ones_are_held() {
    let (events, queue) = mpsc::channel();
    let pty = Pty::open(None, events, Event::Bytes).unwrap();
    let mut master = open(pty.path().unwrap());
    master.write_all(&[1]).unwrap();
    let hold = match queue.recv_timeout(Duration::from_secs(20)) {
        Ok(Event::Bytes(_, hold)) => hold,
        _ => panic!("no byte was received"),
    };
    master.write_all(&[2]).unwrap();
    assert!(queue.recv_timeout(Duration::from_millis(50)).is_err());
    drop(hold);
    assert_eq!(received(&queue, 1), [2]);
}

#[test]
fn symlink_exists_as_long_as_its_terminal() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("line");
    let pty = Pty::open(Some(&link), mpsc::channel().0, Event::Bytes).unwrap();
    assert_eq!(fs::read_link(&link).unwrap(), pty.path().unwrap());
    let newer = Pty::open(Some(&link), mpsc::channel().0, Event::Bytes).unwrap();
    drop(pty);
    assert_eq!(
        fs::read_link(&link).unwrap(),
        newer.path().unwrap(),
        "the symlink of a newer terminal is not removed"
    );
    drop(newer);
    assert!(fs::symlink_metadata(&link).is_err());
}

#[test]
fn file_or_foreign_symlink_at_the_path_is_not_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("line");
    fs::write(&file, "precious").unwrap();
    let text = Pty::open(Some(&file), mpsc::channel().0, Event::Bytes)
        .err()
        .unwrap();
    assert!(text.contains("line") && !text.contains('\n'), "{text}");
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");

    let link = directory.path().join("link");
    std::os::unix::fs::symlink(&file, &link).unwrap();
    assert!(Pty::open(Some(&link), mpsc::channel().0, Event::Bytes).is_err());
    assert_eq!(fs::read_link(&link).unwrap(), file);
}

#[test]
fn rate_of_the_master_is_returned_only_after_keep_own_rate() {
    let mut pty = Pty::open(None, mpsc::channel().0, Event::Bytes).unwrap();
    let master = open(pty.path().unwrap());
    let set = |baud| {
        let mut settings = tcgetattr(&master).unwrap();
        settings.set_speed(baud).unwrap();
        tcsetattr(&master, OptionalActions::Now, &settings).unwrap();
    };
    set(19_200);
    assert_eq!(pty.take_rate(), None, "the client follows the unit");
    pty.keep_own_rate(9600).unwrap();
    assert_eq!(tcgetattr(&master).unwrap().output_speed(), 9600);
    assert_eq!(pty.take_rate(), None);
    set(115_200);
    assert_eq!(pty.take_rate(), Some(115_200));
    assert_eq!(pty.take_rate(), None, "a change is returned once");
}
