//! The monitor in a terminal, for the tests with and without the simulator.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, ExitStatus, MasterPty, PtySize, native_pty_system};

/// Time limit for an expected text on the screen. Only a failing test reaches it.
const PATIENCE: Duration = Duration::from_secs(60);

/// The monitor in a terminal of 80 by 24.
pub struct Terminal {
    parser: Arc<Mutex<vt100::Parser>>,
    keys: Box<dyn Write + Send>,
    child: Box<dyn Child + Send + Sync>,
    _pty: Box<dyn MasterPty + Send>,
}

impl Terminal {
    pub fn run(arguments: &[&str]) -> Self {
        let size = PtySize {
            rows: 24,
            cols: 80,
            pixel_width: 0,
            pixel_height: 0,
        };
        let pty = native_pty_system().openpty(size).unwrap();
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_modioctl"));
        command.args(arguments);
        command.env("TERM", "xterm-256color");
        let child = pty.slave.spawn_command(command).unwrap();
        let parser = Arc::new(Mutex::new(parser()));
        let mut output = pty.master.try_clone_reader().unwrap();
        let keys = pty.master.take_writer().unwrap();
        let into = Arc::clone(&parser);
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                into.lock().unwrap().process(&bytes[..count]);
            }
        });
        Self {
            parser,
            keys,
            child,
            _pty: pty.master,
        }
    }

    pub fn text(&self) -> String {
        self.parser.lock().unwrap().screen().contents()
    }

    pub fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    pub fn wait_for(&self, text: &str) {
        wait(
            || self.text().contains(text),
            || format!("{text:?} is not on the screen:\n{}", self.text()),
        );
    }

    /// Presses keys that change the screen from one text to another. The monitor ignores them while a value is old,
    /// which can happen on a machine that stalls: then they are pressed again.
    pub fn switch(&mut self, keys: &str, before: &str, after: &str) {
        const REFUSED: &str = "is not switched";
        loop {
            self.wait_for(before);
            self.press(keys);
            let refused = || self.text().contains(REFUSED);
            wait(
                || self.text().contains(after) || refused(),
                || format!("{after:?} is not on the screen:\n{}", self.text()),
            );
            if self.text().contains(after) {
                return;
            }
            wait(|| !refused(), || "the notice does not disappear".to_owned());
        }
    }

    pub fn wait_for_end(&mut self) -> ExitStatus {
        let until = Instant::now() + PATIENCE;
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(Instant::now() < until, "still running:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for the end of the program with status 0, after which the terminal is as before.
    pub fn wait_for_success(&mut self) {
        assert!(self.wait_for_end().success());
        let is_restored = || {
            let parser = self.parser.lock().unwrap();
            let screen = parser.screen();
            !screen.alternate_screen()
                && !screen.hide_cursor()
                && screen.mouse_protocol_mode() == vt100::MouseProtocolMode::None
        };
        wait(is_restored, || "the terminal is not restored".to_owned());
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A screen of 80 by 24.
fn parser() -> vt100::Parser {
    let [rows, columns] = [24, 80].map(|size| NonZeroU16::new(size).unwrap());
    vt100::Parser::new(rows, columns, 0)
}

/// Waits until `done` returns true, and fails with this text when it never does.
fn wait(mut done: impl FnMut() -> bool, what: impl Fn() -> String) {
    let until = Instant::now() + PATIENCE;
    while !done() {
        assert!(Instant::now() < until, "{}", what());
        std::thread::sleep(Duration::from_millis(10));
    }
}
