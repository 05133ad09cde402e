//! Name, log and flash file of a board.

use std::collections::VecDeque;

use modbus_line::decode;
use sim::Board;

use super::flash_file::FlashFile;

/// Lines of the log that the HTTP interface shows.
const TAIL: usize = 50;

/// Name, log and flash file of a board.
#[derive(Debug)]
pub struct Unit {
    /// Name of the board in the HTTP interface.
    pub name: String,
    /// The flash file, with `--flash`.
    pub flash: Option<FlashFile>,
    /// Whether the fault `i2c_absent` is in force: the DACs do not answer.
    pub i2c_absent: bool,
    log: VecDeque<String>,
    /// A line of the log that has not ended yet.
    unfinished: String,
    /// Number of findings that were returned.
    findings: usize,
}

impl Unit {
    /// Returns a unit without any log yet.
    pub fn new(name: String, flash: Option<FlashFile>) -> Self {
        Self {
            name,
            flash,
            i2c_absent: false,
            log: VecDeque::new(),
            unfinished: String::new(),
            findings: 0,
        }
    }

    /// Returns the last lines of the firmware's log, oldest first.
    pub fn log_tail(&self) -> impl Iterator<Item = &str> {
        self.log.iter().map(String::as_str)
    }

    /// Returns the lines that the firmware has logged since the last call, with control characters escaped.
    pub fn take_log(&mut self, board: &mut Board) -> Vec<String> {
        self.unfinished += &board.take_log();
        let Some(end) = self.unfinished.rfind('\n') else {
            return Vec::new();
        };
        let rest = self.unfinished.split_off(end + 1);
        let text = std::mem::replace(&mut self.unfinished, rest);
        let lines: Vec<String> = text.lines().map(escaped).collect();
        self.log.extend(lines.iter().cloned());
        self.log.drain(..self.log.len().saturating_sub(TAIL));
        lines
    }

    /// Returns the findings since the last call.
    pub fn take_findings(&mut self, board: &Board) -> Vec<String> {
        let found = board.findings();
        let new = found
            .iter()
            .skip(self.findings)
            .map(ToString::to_string)
            .collect();
        self.findings = found.len();
        new
    }
}

/// Returns a line of the log with escapes for every character that is not visible. The firmware may log bytes that it
/// has received from the line.
fn escaped(line: &str) -> String {
    decode::text(line.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_in_the_log_are_escaped() {
        assert_eq!(escaped("[1.000] saved, Größe 5"), "[1.000] saved, Größe 5");
        assert_eq!(
            escaped("a\x1b[2J\x7f\u{9b}31m\u{202e}b\t"),
            r"a\u{1b}[2J\u{7f}\u{9b}31m\u{202e}b\t"
        );
    }
}
