//! The board in a Renode of its own: in virtual time for the conformance suite, with its line on a TCP
//! socket for a person.

use std::fs::{self, File};
use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use register_map::Module;

use super::Bench;
use super::processes::Group;
use crate::workspace::Workspace;
use crate::{Failure, Result, command};

/// What follows the board's name in that of the script that serves the line by the exact-line protocol, and of the one
/// that offers it to a person.
const EXACT: &str = "-exact.resc";
const SOCKET: &str = ".resc";

/// How long Renode may take to load the platform, start the board and open the socket.
const START: Duration = Duration::from_secs(180);

/// Builds the conformance suite and tells where it is.
///
/// # Errors
///
/// When it does not build.
pub(super) fn suite(workspace: &Workspace) -> Result<PathBuf> {
    let mut cargo = workspace.cargo("build");
    cargo.args([
        "--quiet",
        "--package",
        "conformance",
        "--bin",
        "modio-conformance",
    ]);
    command::run(&mut cargo)?;
    let name = format!("modio-conformance{}", std::env::consts::EXE_SUFFIX);
    Ok(workspace.target().join("debug").join(name))
}

/// Runs the conformance suite against the board in Renode with this module; results go to
/// `conformance-MODULE.*` in the output directory.
///
/// # Errors
///
/// When Renode does not start, or a case failed.
pub(super) fn conformance(bench: &Bench, module: Module, suite: &Path) -> Result<()> {
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
    let status = Group::start(&mut command)?.wait()?;
    let died = renode.has_ended();
    quit(monitor);
    drop(renode);
    match status.code() {
        _ if died => Err(Failure::new(format!(
            "Renode ended before the conformance suite did: {}",
            last_line(&log)
        ))),
        Some(0) => Ok(()),
        Some(1) => Err(Failure::new("cases failed")),
        Some(2) => Err(Failure::new("nothing could be tested")),
        _ => Err(Failure::new(format!(
            "the conformance suite was ended ({status})"
        ))),
    }
}

/// Starts the board for a person, with Renode's monitor on the terminal.
///
/// # Errors
///
/// When Renode cannot be run or ends with a status other than 0.
pub(super) fn interact(bench: &Bench, module: Module, dip: u8, port: u16) -> Result<()> {
    fs::create_dir_all(&bench.output).map_err(|error| {
        Failure::new(format!("cannot make {}: {error}", bench.output.display()))
    })?;
    let script = write_script(bench, SOCKET, module, dip, port)?;
    say!("the line: 127.0.0.1:{port}, raw bytes; unit {dip}, {module} in the first slot");
    say!("in the monitor: modio_log shows the firmware's log, quit ends it all");
    let mut command = bench.renode.command();
    command.arg("--console").arg(script);
    // On the terminal's own input, where Ctrl-C reaches it as well.
    command::run(&mut command)
}

fn start(bench: &Bench, script: &Path, monitor: u16, log: &Path) -> Result<Group> {
    let failed = |error: std::io::Error| Failure::new(format!("{}: {error}", log.display()));
    let output = File::create(log).map_err(failed)?;
    let errors = output.try_clone().map_err(failed)?;
    let mut command = bench.renode.command();
    // The monitor on a socket: it needs no terminal, of which there may be none.
    command.args(["--disable-gui", "--plain", "--port", &monitor.to_string()]);
    command.arg(script);
    Group::start(
        command
            .stdout(Stdio::from(output))
            .stderr(Stdio::from(errors)),
    )
}

/// Tells Renode to end. One that does not listen is ended all the same, when its group is.
fn quit(monitor: u16) {
    if let Ok(mut socket) = TcpStream::connect((Ipv4Addr::LOCALHOST, monitor)) {
        // On a line of its own: what comes first after the connection may be lost.
        let _ = socket.write_all(b"\r\nquit\r\n");
    }
}

/// Waits until the line's server answers.
fn await_line(renode: &mut Group, port: u16, log: &Path) -> Result<()> {
    let end = Instant::now() + START;
    loop {
        if greets(port) {
            return Ok(());
        }
        if renode.has_ended() {
            let what = format!("Renode does not start the board: {}", last_line(log));
            return Err(Failure::new(what));
        }
        if Instant::now() > end {
            let (seconds, log) = (START.as_secs(), log.display());
            let what = format!("the line did not answer after {seconds} s, see {log}");
            return Err(Failure::new(what));
        }
        thread::sleep(Duration::from_millis(100));
    }
}

/// Whether a server of the exact-line protocol answers on this port.
fn greets(port: u16) -> bool {
    let Ok(mut socket) = TcpStream::connect((Ipv4Addr::LOCALHOST, port)) else {
        return false;
    };
    let mut reply = String::new();
    let asked = socket
        .set_read_timeout(Some(START))
        .and_then(|()| socket.write_all(b"hello 1\n"))
        .and_then(|()| BufReader::new(socket).read_line(&mut reply));
    asked.is_ok() && reply.starts_with("ok ")
}

/// The last error in a log, or its last line.
fn last_line(log: &Path) -> String {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let is_error = |line: &&str| line.to_lowercase().contains("error");
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines()
        .rfind(is_error)
        .or_else(|| lines().next_back())
        .unwrap_or("it said nothing")
        .to_owned()
}

/// Writes the script that sets image and board, and then includes another one.
fn write_script(bench: &Bench, kind: &str, module: Module, dip: u8, port: u16) -> Result<PathBuf> {
    let script = bench.output.join("run.resc");
    let text = format!(
        "$elf={}\n$dip={dip}\n$module=\"{module}\"\n$port={port}\ninclude {}\n",
        token(&bench.elf),
        token(&bench.directory.join(format!("{}{kind}", bench.board))),
    );
    fs::write(&script, text)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", script.display())))?;
    Ok(script)
}

/// A path as Renode's monitor takes it on every system.
pub(super) fn token(path: &Path) -> String {
    let text = path.to_string_lossy();
    let text = if cfg!(windows) {
        text.replace('\\', "/")
    } else {
        text.into_owned()
    };
    format!("@{}", text.replace(' ', "\\ "))
}

fn free_port() -> Result<u16> {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
        .and_then(|listener| listener.local_addr())
        .map(|address| address.port())
        .map_err(|error| Failure::new(format!("no free TCP port: {error}")))
}
