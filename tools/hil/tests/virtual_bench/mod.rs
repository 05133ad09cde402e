//! Boards in the simulator on one line, with wires between them.

mod http;
mod line;

use std::env;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::{Value, json};

/// Interval at which inputs are set to the values of their outputs.
const CARRY: Duration = Duration::from_millis(20);

/// Duration of each level of a contact that bounces, in ms of the board's time. The factory's debounce is 5 ms.
const BOUNCE: f64 = 8.0;

/// Highest voltage at the pin of an analog input, in mV, which gives code 4095.
const FULL_SCALE: f64 = 3300.0;

/// A wire between two channels. A channel is a unit address and a number from 1 to 4.
#[derive(Clone, Debug)]
pub struct Loop {
    from: (u8, u8),
    to: (u8, u8),
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Digital,
    /// The input switches on twice when the output switches on.
    Bouncing,
    /// The input is the output multiplied by this factor.
    Analog(f64),
}

impl Loop {
    /// From a channel of a 4DO to one of a 4DI.
    pub const fn digital(unit: u8, output: u8, other: u8, input: u8) -> Self {
        Self {
            from: (unit, output),
            to: (other, input),
            kind: Kind::Digital,
        }
    }

    /// From a channel of a 4DO to one of a 4DI, with a contact that bounces.
    pub const fn bouncing(unit: u8, output: u8, other: u8, input: u8) -> Self {
        let mut wire = Self::digital(unit, output, other, input);
        wire.kind = Kind::Bouncing;
        wire
    }

    /// From an analog output of unit 1 to one of its analog inputs.
    pub const fn analog(output: u8, input: u8, gain: f64) -> Self {
        Self {
            from: (1, output),
            to: (1, input),
            kind: Kind::Analog(gain),
        }
    }
}

/// A board.
struct Board {
    unit: u8,
    child: Child,
    /// Where its HTTP interface listens, HOST:PORT.
    address: String,
}

impl Drop for Board {
    fn drop(&mut self) {
        // A failure means that the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Board {
    fn start(directory: &Path, unit: u8, module: &str) -> Self {
        let variable = |name| env::var_os(name).expect("MODIO_ELF and MODIO_SIM: cargo xtask test");
        let mut child = Command::new(variable("MODIO_SIM"))
            .arg("--elf")
            .arg(variable("MODIO_ELF"))
            .arg("--pty")
            .arg(directory.join(format!("unit{unit}")))
            .args(["--http", "127.0.0.1:0", "--module", module])
            .args(["--dip", &unit.to_string()])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the simulator starts");
        let stdout = child.stdout.take().expect("its output is a pipe");
        let mut lines = BufReader::new(stdout).lines().map_while(Result::ok);
        let address = lines
            .find_map(|line| Some(line.strip_prefix("http: http://")?.to_owned()))
            .expect("the simulator says where it listens");
        // A full pipe would stop the simulator.
        thread::spawn(move || lines.for_each(drop));
        Self {
            unit,
            child,
            address: address.trim_end_matches('/').to_owned(),
        }
    }

    /// Reads the outside state of a channel, 1 to 4.
    fn channel(&self, number: u8) -> Value {
        let state = http::request(&self.address, "/api/state", None);
        state["channels"][usize::from(number) - 1].clone()
    }

    /// Sets the outside state of a channel, 1 to 4.
    fn set(&self, number: u8, level: &Value) {
        let path = format!("/api/channels/{number}");
        http::request(&self.address, &path, Some(level));
    }

    /// Waits until this time, in ms, has passed on the board.
    fn wait(&self, time: f64) {
        let now = || {
            let state = http::request(&self.address, "/api/state", None);
            state["virtual_ms"].as_f64().expect("the board has a time")
        };
        let end = now() + time;
        while now() < end {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Boards on one line, and the wires between them.
pub struct Bench {
    port: PathBuf,
    wires: Arc<Mutex<Vec<Loop>>>,
    stop: Arc<AtomicBool>,
    carrier: Option<JoinHandle<()>>,
    directory: tempfile::TempDir,
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(carrier) = self.carrier.take() {
            // A panic of the thread has already been reported.
            let _ = carrier.join();
        }
    }
}

/// The result of a run of modio-hil.
pub struct Run {
    /// Its exit status.
    pub status: Option<i32>,
    /// Its output.
    pub text: String,
    /// Its report; null when it did not write one.
    pub report: Value,
}

impl Bench {
    /// Boards with these addresses and modules.
    pub fn new(units: &[(u8, &str)]) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let boards: Vec<Board> = units
            .iter()
            .map(|(unit, module)| Board::start(directory.path(), *unit, module))
            .collect();
        let ports: Vec<PathBuf> = units
            .iter()
            .map(|(unit, _)| directory.path().join(format!("unit{unit}")))
            .collect();
        let port = match &ports[..] {
            [one] => one.clone(),
            all => line::join(all),
        };
        let wires = Arc::new(Mutex::new(Vec::new()));
        let stop = Arc::new(AtomicBool::new(false));
        let carrier = {
            let (wires, stop) = (Arc::clone(&wires), Arc::clone(&stop));
            let power = directory.path().join("power");
            thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    switch(&boards[0], &power);
                    let wires = wires.lock().expect("no test fails with the lock").clone();
                    carry(&boards, &wires);
                    thread::sleep(CARRY);
                }
            })
        };
        Self {
            port,
            wires,
            stop,
            carrier: Some(carrier),
            directory,
        }
    }

    /// Removes all wires, and connects these.
    pub fn wire(&self, wires: impl IntoIterator<Item = Loop>) {
        *self.wires.lock().expect("no test fails with the lock") = wires.into_iter().collect();
    }

    /// A command that switches the power of the first board: it writes a file, and waits until the file is
    /// removed.
    pub fn power_command(&self) -> String {
        let script = self.directory.path().join("switch");
        let power = self.directory.path().join("power");
        let power = power.display();
        let text = format!(
            "echo $1 > '{power}.new'; mv '{power}.new' '{power}'; while [ -e '{power}' ]; do sleep 0.02; done"
        );
        fs::write(&script, text).expect("the script can be written");
        format!("sh {}", script.display())
    }

    /// Runs modio-hil until the result is as wanted, three times at most. On a busy machine the simulator may pause in
    /// the middle of a reply, which then counts as lost. Returns the last run.
    pub fn hil_until(
        &self,
        file: &str,
        arguments: &[&str],
        as_wanted: impl Fn(&Run) -> bool,
    ) -> Run {
        let mut run = self.hil(file, arguments);
        for _ in 1..3 {
            if as_wanted(&run) {
                break;
            }
            run = self.hil(file, arguments);
        }
        run
    }

    /// Runs modio-hil with this bench file and the port of the line.
    fn hil(&self, file: &str, arguments: &[&str]) -> Run {
        let (path, json) = ["bench.toml", "report.json"]
            .map(|name| self.directory.path().join(name))
            .into();
        let file = format!("port = {:?}\n{file}", self.port.display().to_string());
        fs::write(&path, file).expect("the bench file can be written");
        // Remove the report of an earlier run, if there is one.
        let _ = fs::remove_file(&json);
        let output = Command::new(env!("CARGO_BIN_EXE_modio-hil"))
            .arg("--bench")
            .arg(&path)
            .arg("--json")
            .arg(&json)
            .args(arguments)
            .output()
            .expect("modio-hil runs");
        let report = fs::read_to_string(&json).unwrap_or_default();
        Run {
            status: output.status.code(),
            text: [output.stdout, output.stderr]
                .map(|text| String::from_utf8_lossy(&text).into_owned())
                .concat(),
            report: serde_json::from_str(&report).unwrap_or(Value::Null),
        }
    }
}

/// Switches the power of a board when the power command has written its file.
fn switch(board: &Board, file: &Path) {
    if let Ok(state) = fs::read_to_string(file) {
        let on = state.trim() == "on";
        http::request(&board.address, "/api/power", Some(&json!({ "on": on })));
        fs::remove_file(file).expect("the file can be removed");
    }
}

/// Sets inputs to the values of their outputs.
fn carry(boards: &[Board], wires: &[Loop]) {
    let board = |unit| {
        let mut boards = boards.iter();
        boards.find(|board| board.unit == unit).expect("a board")
    };
    for Loop { from, to, kind } in wires {
        let output = board(from.0).channel(from.1);
        let other = board(to.0);
        match kind {
            Kind::Bouncing if output["on"] == true && other.channel(to.1)["energised"] == false => {
                for on in [true, false, true] {
                    other.set(to.1, &json!({ "energised": on }));
                    other.wait(BOUNCE);
                }
            }
            Kind::Digital | Kind::Bouncing => {
                other.set(to.1, &json!({ "energised": output["on"] == true }));
            }
            Kind::Analog(gain) => {
                let code = output["code"].as_f64().unwrap_or_default();
                let millivolts = (code / 4095.0 * FULL_SCALE * gain).round() as u16;
                other.set(to.1, &json!({ "millivolts": millivolts }));
            }
        }
    }
}
