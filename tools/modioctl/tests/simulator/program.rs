//! Runs the program.

use std::fmt::Display;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Output, Stdio};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, channel};

/// Result of a run of the program.
#[derive(Debug)]
pub struct Ran {
    pub status: i32,
    pub out: String,
    pub err: String,
}

impl Ran {
    pub fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self {
            status: output.status.code().unwrap(),
            out: text(&output.stdout),
            err: text(&output.stderr),
        }
    }

    /// Returns the standard output of a run that succeeded.
    #[track_caller]
    pub fn fine(self) -> String {
        assert_eq!(self.status, 0, "{self:#?}");
        self.out
    }

    /// Returns the standard error of a run that ended with this status and one line of text.
    #[track_caller]
    pub fn failed(self, status: i32) -> String {
        assert_eq!(self.status, status, "{self:#?}");
        assert_eq!(self.err.trim_end().lines().count(), 1, "{self:#?}");
        self.err
    }
}

/// Asserts that a text has these parts.
#[track_caller]
pub fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// Returns the program, without the settings of this machine's user.
pub fn modioctl(endpoint: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_modioctl"));
    for name in "PORT TCP MODBUS_TCP BAUD FORMAT MODE UNIT TIMEOUT RETRIES AT".split(' ') {
        command.env_remove(format!("MODIO_{name}"));
    }
    command.args(endpoint);
    command
}

/// The endpoint of a unit, for runs of the program that share a cache.
pub struct At(Vec<String>, Rc<tempfile::TempDir>);

impl At {
    pub fn port(path: impl Display) -> Self {
        Self::new("--port", path)
    }

    pub fn tcp(address: impl Display) -> Self {
        Self::new("--tcp", address)
    }

    pub fn modbus_tcp(address: impl Display) -> Self {
        Self::new("--modbus-tcp", address)
    }

    fn new(option: &str, place: impl Display) -> Self {
        Self(
            vec![option.to_owned(), place.to_string()],
            Rc::new(tempfile::tempdir().unwrap()),
        )
    }

    /// Returns another TCP endpoint that shares the cache.
    pub fn elsewhere(&self, address: impl Display) -> Self {
        Self(
            vec!["--tcp".to_owned(), address.to_string()],
            Rc::clone(&self.1),
        )
    }

    /// Returns the number of files in the cache.
    pub fn stored(&self) -> usize {
        let cache = std::fs::read_dir(self.1.path().join("modio"));
        cache.map_or(0, Iterator::count)
    }

    /// Returns the program with the words of this command.
    pub fn command(&self, words: &str) -> Command {
        let endpoint: Vec<_> = self.0.iter().map(String::as_str).collect();
        let mut command = modioctl(&endpoint);
        command.env("XDG_CACHE_HOME", self.1.path());
        command.args(words.split_whitespace());
        command
    }

    /// Runs the words of a command.
    pub fn run(&self, words: &str) -> Ran {
        Ran::of(&self.command(words).output().unwrap())
    }

    /// Starts the words of a command.
    pub fn start(&self, words: &str) -> Running {
        let mut child = self
            .command(words)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Running {
            out: Text::of(child.stdout.take().unwrap()),
            err: Text::of(child.stderr.take().unwrap()),
            child,
        }
    }
}

/// A run of the program that has not been waited for. The program ends when this value is dropped.
pub struct Running {
    pub child: Child,
    pub out: Text,
    pub err: Text,
}

impl Running {
    /// Presses Ctrl-C.
    pub fn interrupt(&self) {
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args(["-INT", &id]).status();
        assert!(sent.unwrap().success());
    }

    /// Waits for the end of the program.
    pub fn end(mut self) -> Ran {
        let status = self.child.wait().unwrap().code().unwrap();
        let [out, err] = [&mut self.out, &mut self.err].map(Text::rest);
        Ran { status, out, err }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a running program prints.
pub struct Text {
    lines: Receiver<String>,
    seen: String,
}

impl Text {
    fn of(stream: impl Read + Send + 'static) -> Self {
        let (tell, lines) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stream).lines() {
                let _ = tell.send(line.unwrap() + "\n");
            }
        });
        let seen = String::new();
        Self { lines, seen }
    }

    /// Waits for a line that contains this.
    #[track_caller]
    pub fn wait_for(&mut self, part: &str) {
        loop {
            let line = self.lines.recv();
            let line = line.unwrap_or_else(|_| panic!("no {part:?} in {:?}", self.seen));
            self.seen += &line;
            if line.contains(part) {
                return;
            }
        }
    }

    fn rest(&mut self) -> String {
        self.seen.extend(self.lines.iter());
        std::mem::take(&mut self.seen)
    }
}
