//! One line made of several pseudo-terminals.

use std::fs;
use std::os::fd::AsRawFd as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use serial2::SerialPort;

/// Joins the lines at these ports to one line. Bytes sent on one port are received on all others. Returns an additional
/// port of the line. The line lasts as long as the process.
pub fn join(ports: &[PathBuf]) -> PathBuf {
    let (master, far) = SerialPort::pair().expect("the system has pseudo-terminals");
    let path = fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd()))
        .expect("the terminal has a path");
    let opened = ports
        .iter()
        .map(|port| SerialPort::open(port, 9600).expect("a simulator's line"));
    let all: Vec<SerialPort> = std::iter::once(master).chain(opened).collect();
    let all = Arc::new(all);
    for from in 0..all.len() {
        let all = Arc::clone(&all);
        thread::spawn(move || copy(&all, from));
    }
    // Keep the terminal while no program has it open.
    std::mem::forget(far);
    path
}

/// Copies bytes from one line to all others, until a line is closed.
fn copy(all: &[SerialPort], from: usize) {
    let mut buffer = [0; 512];
    loop {
        match all[from].read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => {
                for (number, to) in all.iter().enumerate() {
                    if number != from && to.write_all(&buffer[..length]).is_err() {
                        return;
                    }
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
            Err(_) => return,
        }
    }
}
