//! The board in Renode: in virtual time for the conformance suite, or with its line on a TCP socket for a
//! person.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{Ipv4Addr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use fs_err::{self as fs, File};
use register_map::Module;

use super::Bench;
use crate::command;
use crate::debug::free_port;
use crate::group::Group;

/// A script of a board has the board's name and one of these ends. `EXACT` serves the line by the exact-line protocol,
/// `SOCKET` offers the line to a person.
const EXACT: &str = "-exact.resc";
const SOCKET: &str = ".resc";

/// Time for Renode to load the platform, start the board and open the socket.
const START: Duration = Duration::from_secs(180);

/// Time for a server of the line to answer.
const ANSWER: Duration = Duration::from_secs(5);

/// Runs the conformance suite against the board in Renode with this module. The results are in `conformance-MODULE.*`
/// in the output directory.
pub fn conformance(bench: &Bench, module: Module, suite: &Path) -> Result<()> {
    let (port, monitor) = (free_port()?, free_port()?);
    let script = write_script(bench, EXACT, module, 1, port)?;
    let log = bench.output.join(format!("renode-{module}.log"));
    let mut renode = start(bench, &script, monitor, &log)?;
    await_line(&mut renode, port, &log)?;
    let mut command = Command::new(suite);
    command.args(["--exact-line", &format!("127.0.0.1:{port}")]);
    command.args(["--unit", "1", "--allow-config"]);
    for (option, extension) in [("--junit", "xml"), ("--json", "json")] {
        let name = format!("conformance-{module}.{extension}");
        command.arg(option).arg(bench.output.join(name));
    }
    let status = Group::start(command)?.wait()?;
    let died = renode.has_ended()?;
    quit(monitor);
    drop(renode);
    ensure!(
        !died,
        "Renode ended before the conformance suite did: {}",
        last_line(&log)
    );
    match status.code() {
        Some(0) => Ok(()),
        Some(1) => bail!("cases failed"),
        Some(2) => bail!("nothing could be tested"),
        _ => bail!("the conformance suite was ended ({status})"),
    }
}

/// Starts the board for a person, with Renode's monitor on the terminal.
pub fn interact(bench: &Bench, module: Module, dip: u8, port: u16) -> Result<()> {
    fs::create_dir_all(&bench.output)?;
    let script = write_script(bench, SOCKET, module, dip, port)?;
    say!("the line: 127.0.0.1:{port}, raw bytes; unit {dip}, {module} in the first slot");
    say!("in the monitor: modio_log shows the firmware's log, quit ends Renode");
    let mut renode = Command::new(&bench.renode.program);
    // The terminal is the input, from which Renode also receives Ctrl-C.
    command::run(renode.arg("--console").arg(script))
}

fn start(bench: &Bench, script: &Path, monitor: u16, log: &Path) -> Result<Group> {
    let log = File::create(log)?.into_file();
    let mut renode = Command::new(&bench.renode.program);
    // The monitor on a socket needs no terminal.
    renode.args(["--disable-gui", "--plain", "--port", &monitor.to_string()]);
    renode.arg(script).stdout(log.try_clone()?).stderr(log);
    Group::start(renode)
}

/// Requests Renode to end. A Renode that does not answer is ended with its group.
fn quit(monitor: u16) {
    if let Ok(mut socket) = TcpStream::connect((Ipv4Addr::LOCALHOST, monitor)) {
        // In a separate line, because the first bytes after the connection may be lost.
        let _ = socket.write_all(b"\r\nquit\r\n");
    }
}

/// Waits until the server of the line answers.
fn await_line(renode: &mut Group, port: u16, log: &Path) -> Result<()> {
    let end = Instant::now() + START;
    while !greets(port) {
        ensure!(
            !renode.has_ended()?,
            "Renode does not start the board: {}",
            last_line(log)
        );
        ensure!(
            Instant::now() < end,
            "the line did not answer after {} s, see {}",
            START.as_secs(),
            log.display()
        );
        thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}

/// Returns whether a server of the exact-line protocol answers at this port.
fn greets(port: u16) -> bool {
    let Ok(mut socket) = TcpStream::connect((Ipv4Addr::LOCALHOST, port)) else {
        return false;
    };
    let mut reply = String::new();
    let asked = socket
        .set_read_timeout(Some(ANSWER))
        .and_then(|()| socket.write_all(b"hello 1\n"))
        .and_then(|()| BufReader::new(socket).read_line(&mut reply));
    asked.is_ok() && reply.starts_with("ok ")
}

/// Returns the last error in a log, or its last line.
fn last_line(log: &Path) -> String {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let is_error = |line: &&str| line.to_lowercase().contains("error");
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    let line = lines().rfind(is_error).or_else(|| lines().next_back());
    line.unwrap_or("its log is empty").to_owned()
}

/// Writes the script that sets image and board, and then includes another script.
fn write_script(bench: &Bench, kind: &str, module: Module, dip: u8, port: u16) -> Result<PathBuf> {
    let script = bench.output.join("run.resc");
    let text = format!(
        "$elf={}\n$dip={dip}\n$module=\"{module}\"\n$port={port}\ninclude {}\n",
        token(&bench.elf),
        token(&bench.directory.join(format!("{}{kind}", bench.board))),
    );
    fs::write(&script, text)?;
    Ok(script)
}

/// Returns a path in the form that Renode's monitor accepts on every system.
pub fn token(path: &Path) -> String {
    let text = path.to_string_lossy();
    let text = if cfg!(windows) {
        text.replace('\\', "/")
    } else {
        text.into_owned()
    };
    format!("@{}", text.replace(' ', "\\ "))
}
