//! The board on its bench: with what it has said so far.

use std::collections::VecDeque;
use std::io::Write;

use sim::Board;
use sim::line::Settings;

use super::gdb::Debug;

/// Lines of the log that the HTTP interface shows.
const TAIL: usize = 50;

/// The board and the end of its log.
pub struct Bench {
    /// The virtual modio-02.
    pub board: Board,
    /// What a debugger has set up.
    pub debug: Debug,
    log: VecDeque<String>,
    /// A line of the log that has not ended yet.
    unfinished: String,
    findings: usize,
}

impl Bench {
    /// A board that nobody has listened to yet.
    pub fn new(mut board: Board) -> Self {
        // A pty or socket carries no rate: a master behind it speaks at the unit's.
        board.line().set_follow(true);
        Self {
            board,
            debug: Debug::default(),
            log: VecDeque::new(),
            unfinished: String::new(),
            findings: 0,
        }
    }

    /// Sets the rate and format of the line's client, which then no longer follows the unit.
    pub fn fix_line(&mut self, settings: Settings) {
        self.board.line().set_follow(false);
        self.board.line().set_settings(settings);
    }

    /// The last lines of the firmware's log, oldest first.
    pub fn log_tail(&self) -> impl Iterator<Item = &str> {
        self.log.iter().map(String::as_str)
    }

    /// Sends bytes on the line now, or right behind those still on their way.
    pub fn send(&mut self, bytes: &[u8]) {
        let now = self.board.now();
        self.board.line().send(now, bytes);
    }

    /// What the master has heard on the line since the last call.
    pub fn heard(&mut self) -> Vec<u8> {
        let heard = self.board.line().take_received();
        heard.iter().map(|character| character.byte).collect()
    }

    /// The lines that the firmware has logged since the last call.
    pub fn take_log(&mut self) -> Vec<String> {
        self.unfinished += &self.board.take_log();
        let Some(end) = self.unfinished.rfind('\n') else {
            return Vec::new();
        };
        let rest = self.unfinished.split_off(end + 1);
        let text = std::mem::replace(&mut self.unfinished, rest);
        let lines: Vec<String> = text.lines().map(str::to_owned).collect();
        self.log.extend(lines.iter().cloned());
        self.log.drain(..self.log.len().saturating_sub(TAIL));
        lines
    }

    /// What the firmware has done since the last call that a real board would not take well; each once.
    pub fn take_findings(&mut self) -> Vec<String> {
        let found = self.board.findings();
        let new = found
            .iter()
            .skip(self.findings)
            .map(ToString::to_string)
            .collect();
        self.findings = found.len();
        new
    }

    /// Tells the log on stdout and the findings on stderr.
    pub fn tell(&mut self) {
        for line in self.take_log() {
            say(&line);
        }
        for finding in self.take_findings() {
            // That nobody reads it is no reason to stop.
            let _ = writeln!(std::io::stderr(), "modio-sim: {finding}");
        }
    }
}

/// A line on stdout. That nobody reads it (any more) is no reason to stop.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}
