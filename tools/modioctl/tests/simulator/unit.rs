//! A simulated unit.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// A unit in the simulator, which ends when this value is dropped.
pub struct Unit {
    simulator: Child,
    /// The line's pseudo-terminal.
    pub pty: PathBuf,
    /// The line over TCP.
    pub tcp: SocketAddr,
    http: SocketAddr,
}

fn path(variable: &str) -> PathBuf {
    std::env::var_os(variable)
        .unwrap_or_else(|| panic!("{variable} is not set: run `cargo xtask test`"))
        .into()
}

/// Returns a file of the modio-02's firmware.
fn file(name: &str) -> PathBuf {
    path("MODIO_IMAGES_MODIO_02").join(name)
}

/// Returns the path of the file of an update.
pub fn update_file() -> PathBuf {
    file("modio-02.modio")
}

impl Unit {
    /// Starts a modio-02 with this address and these options of the simulator.
    pub fn with(address: u8, options: &[&str]) -> Self {
        Self::run(&[&["--dip", &address.to_string()], options].concat())
    }

    /// Starts modio-02 boards on one line, each given as `ADDRESS:MODULE`.
    pub fn several(boards: &[&str]) -> Self {
        let options: Vec<_> = boards.iter().flat_map(|board| ["--unit", board]).collect();
        Self::run(&options)
    }

    /// Starts the boards of a file for `--bus` on one line.
    pub fn bus(boards: &str) -> Self {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), boards).unwrap();
        let images = path("MODIO_IMAGES_MODIO_08");
        let of_08 = |name| format!("modio-08={}", images.join(name).display());
        let (loader, image) = (of_08("loader"), of_08("modio-08.modio"));
        let boards = file.path().to_str().unwrap();
        Self::run(&["--loader", &loader, "--image", &image, "--bus", boards])
    }

    fn run(options: &[&str]) -> Self {
        let mut simulator = Command::new(path("MODIO_SIM"));
        simulator.arg("--loader").arg(file("loader"));
        simulator.arg("--image").arg(update_file());
        let mut simulator = simulator
            .args(["--tcp", "127.0.0.1:0", "--http", "127.0.0.1:0"])
            .args(options)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(simulator.stdout.take().unwrap()).lines();
        let mut after = |name: &str| {
            let line = lines.next().unwrap().unwrap();
            let value = line.strip_prefix(name);
            value
                .unwrap_or_else(|| panic!("{line:?}, not {name}"))
                .to_owned()
        };
        let pty = after("pty: ").into();
        let tcp = after("tcp: ").parse().unwrap();
        let http = after("http: http://");
        let http = http.trim_end_matches('/').parse().unwrap();
        // The simulator prints the firmware's log, which must be read so that the pipe does not fill up.
        std::thread::spawn(move || lines.for_each(drop));
        let unit = Self {
            simulator,
            pty,
            tcp,
            http,
        };
        // The unit answers some milliseconds after its start; a test with a single request must not be too early.
        unit.wait(300);
        unit
    }

    /// Changes something with the simulator's HTTP interface.
    pub fn post(&self, path: &str, body: &str) {
        self.request("POST", path, body);
    }

    /// Waits until this many milliseconds have passed for the unit, however slow this computer is.
    pub fn wait(&self, milliseconds: u64) {
        let now = || {
            let state: serde_json::Value =
                serde_json::from_str(&self.request("GET", "/api/state", "")).unwrap();
            state["virtual_ms"].as_u64().unwrap()
        };
        let end = now() + milliseconds;
        while now() < end {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }

    fn request(&self, method: &str, path: &str, body: &str) -> String {
        let mut stream = TcpStream::connect(self.http).unwrap();
        let length = body.len();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}",
            self.http
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 2"), "{answer}");
        answer.split_once("\r\n\r\n").unwrap().1.to_owned()
    }
}

impl Drop for Unit {
    fn drop(&mut self) {
        let _ = self.simulator.kill();
        let _ = self.simulator.wait();
    }
}
