//! The simulator as a running command: starts it, reads what it prints, asks it over HTTP, and ends it.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Part of the message about an address in use. The text of Windows depends on its language.
pub const IN_USE: &str = if cfg!(windows) {
    "(os error 10048)"
} else {
    "in use"
};
/// Part of the message about a missing file.
pub const NO_FILE: &str = "(os error 2)";
/// Part of the message about a missing directory.
pub const NO_DIRECTORY: &str = if cfg!(windows) {
    "(os error 3)"
} else {
    NO_FILE
};

/// Signals that end the simulator, each with the exit status that follows.
pub const ENDS: &[(&str, Option<i32>)] = if cfg!(unix) {
    &[("-TERM", Some(0)), ("-INT", Some(0)), ("-KILL", None)]
} else {
    &[("-KILL", Some(1))]
};

/// Writes an ELF file whose firmware is an endless loop.
pub fn endless_loop(directory: &Path) -> PathBuf {
    elf(directory, &[0xE7FE])
}

/// Writes an ELF file with `program` after a vector table: one load segment at the start of flash.
pub fn elf(directory: &Path, program: &[u16]) -> PathBuf {
    let mut code = vec![0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0x00, 0x08];
    code.extend(program.iter().flat_map(|half| half.to_le_bytes()));
    let mut elf = b"\x7fELF\x01\x01\x01".to_vec();
    elf.resize(16, 0);
    let half = |elf: &mut Vec<u8>, value: u16| elf.extend(value.to_le_bytes());
    let word = |elf: &mut Vec<u8>, value: u32| elf.extend(value.to_le_bytes());
    half(&mut elf, 2); // ET_EXEC
    half(&mut elf, 40); // EM_ARM
    // Version, entry, program headers, section headers, flags.
    [1, 0x0800_0009, 52, 0, 0]
        .into_iter()
        .for_each(|value| word(&mut elf, value));
    // Sizes and counts: header, program headers, section headers.
    [52, 32, 1, 40, 0, 0]
        .into_iter()
        .for_each(|value| half(&mut elf, value));
    let size = code.len() as u32;
    // PT_LOAD, offset, virtual and physical address, sizes, flags, alignment.
    [1, 84, 0x0800_0000, 0x0800_0000, size, size, 5, 4]
        .into_iter()
        .for_each(|value| word(&mut elf, value));
    elf.extend(code);
    let path = directory.join("program.elf");
    fs::write(&path, elf).unwrap();
    path
}

/// Options that provide the line in addition to the pseudo-terminal.
pub const LINES: [&str; 3] = ["--tcp", "--modbus-tcp", "--exact-line"];

/// Returns the command with these arguments, and with `--tcp` where the simulator would not start without it.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_modio-sim"));
    if !sim::options::PTY && !arguments.iter().any(|name| LINES.contains(name)) {
        command.args(["--tcp", "127.0.0.1:0"]);
    }
    command
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// A running simulator, which is ended with the test.
pub struct Running {
    child: Child,
    lines: std::io::Lines<BufReader<std::process::ChildStdout>>,
    /// Holds the image of the endless loop if the simulator runs that.
    _directory: Option<tempfile::TempDir>,
}

impl Running {
    pub fn start(arguments: &[&str]) -> Self {
        let mut child = command(arguments).spawn().unwrap();
        let stdout = child.stdout.take().unwrap();
        Self {
            child,
            lines: BufReader::new(stdout).lines(),
            _directory: None,
        }
    }

    /// Starts a simulator with an image, with HTTP on a free port.
    pub fn start_image(elf: &str, more: &[&str]) -> Self {
        let first = ["--elf", elf, "--http", "127.0.0.1:0"];
        Self::start(&[&first[..], more].concat())
    }

    /// Starts a simulator with the loader and the image of the modio-02, with HTTP on a free port.
    pub fn start_firmware(more: &[&str]) -> Self {
        let images = std::env::var("MODIO_IMAGES_MODIO_02").expect("cargo xtask test sets it");
        let [loader, image] = ["loader", "modio-a.image"].map(|name| format!("{images}/{name}"));
        let first = [
            "--loader",
            &loader,
            "--image",
            &image,
            "--http",
            "127.0.0.1:0",
        ];
        Self::start(&[&first[..], more].concat())
    }

    /// Starts a simulator whose firmware is an endless loop, with HTTP on a free port.
    pub fn start_loop(more: &[&str]) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let elf = endless_loop(directory.path());
        let mut running = Self::start_image(elf.to_str().unwrap(), more);
        running._directory = Some(directory);
        running
    }

    /// Returns the text after `prefix` on the next line.
    pub fn endpoint(&mut self, prefix: &str) -> String {
        let line = self.lines.next().expect("one more line of output").unwrap();
        line.strip_prefix(prefix)
            .unwrap_or_else(|| panic!("{line:?}"))
            .to_owned()
    }

    /// Returns the path of the pseudo-terminal. On systems without one, returns the address of the line over TCP, which
    /// [`command`] has added to the arguments.
    pub fn line(&mut self) -> String {
        self.endpoint(if sim::options::PTY { "pty: " } else { "tcp: " })
    }

    /// Reads the line that announces the pseudo-terminal, where there is one.
    pub fn skip_pty(&mut self) {
        if sim::options::PTY {
            self.endpoint("pty: ");
        }
    }

    /// Sends a signal. Windows has none, so the simulator is killed there.
    pub fn signal(&mut self, name: &str) {
        if !cfg!(unix) {
            return self.child.kill().unwrap();
        }
        let id = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args([name, &id])
                .status()
                .unwrap()
                .success()
        );
    }

    /// Waits for the end. Returns the exit status and the text on stderr.
    pub fn end(&mut self) -> (Option<i32>, String) {
        eventually("the simulator does not end", || {
            self.child.try_wait().unwrap().is_some()
        });
        let mut said = String::new();
        self.child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut said)
            .unwrap();
        (self.child.wait().unwrap().code(), said)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // The simulator has already ended unless the test has failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until `is` returns true, which may take a minute.
pub fn eventually(what: &str, mut is: impl FnMut() -> bool) {
    let end = Instant::now() + Duration::from_secs(60);
    while !is() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Connects to an address of the simulator. A read waits for 60 s at most.
pub fn connect(address: &str) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    stream
}

/// Returns the body of `GET /api/state` of the simulator at `url`, given as host, port and a slash.
pub fn state(url: &str) -> serde_json::Value {
    get(url, "/api/state")
}

/// Returns the body of a reply of the simulator at `url`.
pub fn get(url: &str, path: &str) -> serde_json::Value {
    http(url, &format!("GET {path} HTTP/1.1\r\n"), "")
}

/// Returns the body of the reply to a POST.
pub fn post(url: &str, path: &str, body: &str) -> serde_json::Value {
    let head = format!("POST {path} HTTP/1.1\r\nContent-Length: {}\r\n", body.len());
    http(url, &head, body)
}

pub fn http(url: &str, head: &str, body: &str) -> serde_json::Value {
    let mut stream = TcpStream::connect(url.trim_end_matches('/')).unwrap();
    let request = format!("{head}Host: localhost\r\nConnection: close\r\n\r\n{body}");
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap()).unwrap()
}

/// Asserts that the command reports the error in one line with all of `parts` in it, and exits with status 2.
pub fn refused(arguments: &[&str], parts: &[&str]) {
    let output = command(arguments).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(output.stdout.is_empty(), "no endpoint is announced");
}
