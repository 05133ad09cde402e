//! Boards in one simulator, on its line, with wires between them.

mod http;

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

    /// From an analog output of unit 1 to one of its analog inputs.
    pub const fn analog(output: u8, input: u8, gain: f64) -> Self {
        Self {
            from: (1, output),
            to: (1, input),
            kind: Kind::Analog(gain),
        }
    }
}

struct Simulator {
    child: Child,
    /// Where its HTTP interface listens, HOST:PORT.
    address: String,
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // A failure means that the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Simulator {
    /// Starts boards with these addresses and modules, and their line at `port`.
    fn start(port: &Path, units: &[(u8, &str)]) -> Self {
        let variable = |name| PathBuf::from(env::var_os(name).expect("cargo xtask test sets it"));
        let images = variable("MODIO_IMAGES_MODIO_02");
        let mut command = Command::new(variable("MODIO_SIM"));
        command.arg("--loader").arg(images.join("loader"));
        command.arg("--image").arg(images.join("modio-a.image"));
        command.arg("--pty").arg(port);
        command.args(["--http", "127.0.0.1:0"]);
        for (unit, module) in units {
            command.args(["--unit", &format!("{unit}:{module}")]);
        }
        let mut child = command
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
            child,
            address: address.trim_end_matches('/').to_owned(),
        }
    }

    /// Sends a request about a board. Returns the reply's body.
    fn request(&self, unit: u8, path: &str, body: Option<&Value>) -> Value {
        let path = format!("/api/boards/unit-{unit}/{path}");
        http::request(&self.address, &path, body)
    }

    /// Sets inputs to the values of their outputs.
    fn carry(&self, wires: &[Loop]) {
        for Loop { from, to, kind } in wires {
            let state = self.request(from.0, "state", None);
            let output = &state["channels"][usize::from(from.1) - 1];
            let level = match kind {
                Kind::Digital => json!({ "energised": output["on"] == true }),
                Kind::Analog(gain) => {
                    let code = output["code"].as_f64().unwrap_or_default();
                    let millivolts = (code / 4095.0 * FULL_SCALE * gain).round() as u16;
                    json!({ "millivolts": millivolts })
                }
            };
            self.request(to.0, &format!("channels/{}", to.1), Some(&level));
        }
    }

    /// Switches the power of a board when the power command has written its file.
    fn switch(&self, unit: u8, file: &Path) {
        if let Ok(state) = fs::read_to_string(file) {
            let on = state.trim() == "on";
            self.request(unit, "power", Some(&json!({ "on": on })));
            fs::remove_file(file).expect("the file can be removed");
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
        let port = directory.path().join("line");
        let simulator = Simulator::start(&port, units);
        let first = units[0].0;
        let wires = Arc::new(Mutex::new(Vec::new()));
        let stop = Arc::new(AtomicBool::new(false));
        let carrier = {
            let (wires, stop) = (Arc::clone(&wires), Arc::clone(&stop));
            let power = directory.path().join("power");
            thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    simulator.switch(first, &power);
                    let wires = wires.lock().expect("no test fails with the lock").clone();
                    simulator.carry(&wires);
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
