//! The terminal as a master sees it.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::sync::mpsc::{self, Receiver};
use std::time::Instant;

use super::*;

fn open(path: &Path) -> File {
    OpenOptions::new()
        .read(true)
        .write(true)
        .open(path)
        .unwrap()
}

/// Bytes as they came to the line, as many as are wanted.
fn came(queue: &Receiver<Event>, wanted: usize) -> Vec<u8> {
    let mut all = Vec::new();
    while all.len() < wanted {
        match queue.recv_timeout(Duration::from_secs(20)) {
            Ok(Event::Bytes(bytes)) => all.extend(bytes),
            _ => panic!("only {all:?} came"),
        }
    }
    all
}

fn eventually(what: &str, mut is: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !is() {
        assert!(Instant::now() < end, "{what}");
        thread::sleep(Duration::from_millis(1));
    }
}

fn is_open(pty: &Pty) -> bool {
    !state(&pty.master, PollFlags::OUT, Some(Duration::ZERO)).contains(PollFlags::HUP)
}

#[test]
fn every_byte_passes_both_ways_as_it_is() {
    let (events, queue) = mpsc::channel();
    let pty = Pty::open(None, events).unwrap();
    let mut master = open(pty.path().unwrap());
    let all: Vec<u8> = (0..=255).collect();
    master.write_all(&all).unwrap();
    assert_eq!(came(&queue, 256), all);
    pty.write(&all);
    let mut heard = vec![0; 256];
    master.read_exact(&mut heard).unwrap();
    assert_eq!(heard, all, "no byte is echoed, swallowed or translated");
}

#[test]
fn it_outlives_its_masters_and_keeps_nothing_for_the_next() {
    let (events, queue) = mpsc::channel();
    let pty = Pty::open(None, events).unwrap();
    for round in 0..3_u8 {
        let mut master = open(pty.path().unwrap());
        master.write_all(&[round, 0x0A, 0x0D, 0x03]).unwrap();
        assert_eq!(came(&queue, 4), [round, 0x0A, 0x0D, 0x03]);
        pty.write(&[round]);
        let mut heard = [0];
        master.read_exact(&mut heard).unwrap();
        assert_eq!(heard, [round]);
        drop(master);
        eventually("closed", || !is_open(&pty));
        pty.write(&[0xEE; 10]);
    }
}

#[test]
fn a_master_that_does_not_read_stops_nothing() {
    let (events, _queue) = mpsc::channel();
    let pty = Pty::open(None, events).unwrap();
    let _master = open(pty.path().unwrap());
    for _ in 0..1000 {
        pty.write(&[0x55; 256]);
    }
}

#[test]
fn the_link_is_there_while_it_is() {
    let directory = tempfile::tempdir().unwrap();
    let link = directory.path().join("line");
    let pty = Pty::open(Some(&link), mpsc::channel().0).unwrap();
    assert_eq!(fs::read_link(&link).unwrap(), pty.path().unwrap());
    let newer = Pty::open(Some(&link), mpsc::channel().0).unwrap();
    drop(pty);
    assert_eq!(
        fs::read_link(&link).unwrap(),
        newer.path().unwrap(),
        "a newer one's link stays"
    );
    drop(newer);
    assert!(fs::symlink_metadata(&link).is_err());
}

#[test]
fn a_file_in_the_links_place_is_not_touched() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("line");
    fs::write(&file, "precious").unwrap();
    let text = Pty::open(Some(&file), mpsc::channel().0).err().unwrap();
    assert!(text.contains("line") && !text.contains('\n'), "{text}");
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");

    let link = directory.path().join("link");
    std::os::unix::fs::symlink(&file, &link).unwrap();
    assert!(Pty::open(Some(&link), mpsc::channel().0).is_err());
    assert_eq!(fs::read_link(&link).unwrap(), file);
}

#[test]
fn the_rate_that_a_master_sets_counts_only_where_it_is_to() {
    let mut pty = Pty::open(None, mpsc::channel().0).unwrap();
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
    assert_eq!(pty.take_rate(), None, "told once");
}
