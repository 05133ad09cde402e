//! The board in Renode: in virtual time for the conformance suite, or with its line on a TCP socket for a
//! person.

use std::io::Write as _;
use std::net::{Ipv4Addr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Result, bail, ensure};
use fs_err::{self as fs, File};
use register_map::Module;

use super::Setup;
use crate::command;
use crate::debug::free_port;
use crate::group::Group;

/// Time for Renode to load the platform, start the board and open the socket.
const START: Duration = Duration::from_secs(180);

/// Time for Renode to end when it is asked to.
const END: Duration = Duration::from_secs(10);

/// Runs the conformance suite against the board in Renode with this module. The results are in `conformance-MODULE.*`
/// in the output directory.
pub fn conformance(setup: &Setup, module: Module, suite: &Path) -> Result<()> {
    let (port, monitor) = (free_port()?, free_port()?);
    let script = write_script(setup, "-exact", module, 1, port)?;
    let log = setup.output.join(format!("renode-{module}.log"));
    let mut renode = start(setup, &script, monitor, &log)?;
    let end = Instant::now() + START;
    while TcpStream::connect((Ipv4Addr::LOCALHOST, port)).is_err() {
        let ended = renode.wait(Duration::from_millis(100))?.is_some();
        ensure!(!ended, "Renode does not start the board: {}", reason(&log));
        let shown = log.display();
        ensure!(
            Instant::now() < end,
            "Renode takes too long to start the board, see {shown}"
        );
    }
    let mut command = Command::new(suite);
    command.args(["--exact-line", &format!("127.0.0.1:{port}")]);
    command.args(["--unit", "1", "--allow-config"]);
    for (option, extension) in [("--junit", "xml"), ("--json", "json")] {
        let name = format!("conformance-{module}.{extension}");
        command.arg(option).arg(setup.output.join(name));
    }
    let status = Group::start(command)?.wait(Duration::MAX)?;
    let died = renode.ended()?.is_some();
    // In a separate line, because the first bytes after the connection may be lost. A Renode that does not answer is
    // ended with its group.
    if let Ok(mut socket) = TcpStream::connect((Ipv4Addr::LOCALHOST, monitor)) {
        let _ = socket.write_all(b"\r\nquit\r\n");
    }
    renode.wait(END)?;
    ensure!(
        !died,
        "Renode ended before the conformance suite did: {}",
        reason(&log)
    );
    match status.and_then(|status| status.code()) {
        Some(0) => Ok(()),
        Some(1) => bail!("cases failed"),
        Some(2) => bail!("nothing could be tested"),
        _ => bail!("the conformance suite was ended"),
    }
}

/// Starts the board for a person, with Renode's monitor on the terminal.
pub fn interact(setup: &Setup, module: Module, dip: u8, port: u16) -> Result<()> {
    fs::create_dir_all(&setup.output)?;
    let script = write_script(setup, "", module, dip, port)?;
    say!("the line: 127.0.0.1:{port}, raw bytes; unit {dip}, {module} in the first slot");
    say!("in the monitor: modio_log shows the firmware's log, quit ends Renode");
    let mut renode = Command::new(&setup.renode.program);
    // The terminal is the input, from which Renode also receives Ctrl-C.
    command::run(renode.arg("--console").arg(script))
}

fn start(setup: &Setup, script: &Path, monitor: u16, log: &Path) -> Result<Group> {
    let log = File::create(log)?.into_file();
    let mut renode = Command::new(&setup.renode.program);
    // The monitor on a socket needs no terminal.
    renode.args(["--disable-gui", "--plain", "--port", &monitor.to_string()]);
    renode.arg(script).stdout(log.try_clone()?).stderr(log);
    Group::start(renode)
}

/// Returns the error in a log, or its last line.
fn reason(log: &Path) -> String {
    let text = fs::read(log).unwrap_or_default();
    let reason = command::reason(&String::from_utf8_lossy(&text));
    reason.unwrap_or_else(|| "its log is empty".to_owned())
}

/// Writes the script that sets images and board, and then includes the script of the board with this kind of line:
/// `-exact` for the exact-line protocol, or nothing for the socket of a person.
fn write_script(setup: &Setup, line: &str, module: Module, dip: u8, port: u16) -> Result<PathBuf> {
    let script = setup.output.join("run.resc");
    let image = setup.image.as_deref();
    let image = image.map_or("$plain=true".to_owned(), |image| {
        format!("$image={}", token(image))
    });
    let text = format!(
        "$elf={}\n{image}\n$dip={dip}\n$module=\"{module}\"\n$port={port}\ninclude {}\n",
        token(&setup.elf),
        token(&setup.directory.join(format!("{}{line}.resc", setup.board))),
    );
    fs::write(&script, text)?;
    Ok(script)
}

/// Returns a path in the form that Renode's monitor accepts on every system.
fn token(path: &Path) -> String {
    let text = path.to_string_lossy();
    let separator = std::path::MAIN_SEPARATOR;
    format!("@{}", text.replace(separator, "/").replace(' ', "\\ "))
}
