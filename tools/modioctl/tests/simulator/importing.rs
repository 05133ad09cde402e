//! Tests of `modioctl config import` with a unit that this test serves.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use register_map::Module;
use register_map::configuration::{COMM_TIMEOUT, LORA_ADDRESS, MODULE};

use crate::program::At;
use crate::served::{Answers, Modio, serve_requests};
use crate::terminal::Terminal;

type Shared = Arc<Mutex<Modio>>;

/// Returns a modio-02 with a 4do. It does not answer a write to `silent_at`.
fn unit(silent_at: u16) -> (SocketAddr, Shared) {
    let server = Arc::new(Mutex::new(Modio::modio_02(Module::Do4)));
    let served = Arc::clone(&server);
    let address = serve_requests(move |unit, pdu| {
        let silent = pdu[0] == 6 && pdu[1..3] == silent_at.to_be_bytes();
        let answer = || served.lock().unwrap().response(unit, pdu);
        Some(if silent { Vec::new() } else { answer() })
    });
    (address, server)
}

fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn word(unit: &Shared, address: u16) -> u16 {
    unit.lock().unwrap().modio.edited[&address]
}

#[test]
fn ctrl_c_reports_how_many_settings_are_written_and_that_nothing_is_saved() {
    let (unit, words) = unit(LORA_ADDRESS);
    let (_folder, path) = file("LORA_ADDRESS = 7\nCOMM_TIMEOUT = 2.5\nCOMM_SOURCE = 1\n");
    let words_of = format!("--timeout 1h --trace config import {}", path.display());
    let mut import = At::tcp(unit).start(&words_of);
    import.err.wait_for(&format!("{LORA_ADDRESS:#06X} = 7"));
    import.interrupt();
    let ran = import.end();
    assert_eq!(ran.status, 130, "{ran:?}");
    let told = "modioctl: stopped: at least 2 of 3 settings are written and nothing is saved";
    assert!(ran.err.contains(told), "{ran:?}");
    assert_eq!(word(&words, COMM_TIMEOUT), 25);
}

#[test]
fn change_of_a_module_needs_a_yes() {
    let (unit, words) = unit(0xFFFF);
    let (_folder, path) = file("p5.module = \"4di\"\nCOMM_TIMEOUT = 2.5\n");
    let path = path.to_str().unwrap();
    let ran = At::tcp(unit).run(&format!("config import {path}"));
    let rows = "setting       the unit  the file\np5.module     4do       4di\nCOMM_TIMEOUT  0.0 s     2.5 s\n";
    assert_eq!(ran.out, rows);
    let text = ran.failed(2);
    assert!(text.contains("p5.module would change; --yes"), "{text}");
    let both = || [word(&words, MODULE + 4), word(&words, COMM_TIMEOUT)];
    assert_eq!(both(), [Module::Do4.code(), 0]);

    let place = unit.to_string();
    let arguments = ["--tcp", &place, "config", "import", path];
    let mut terminal = Terminal::run(&arguments);
    terminal.wait_for("[y/N]");
    terminal.press("n\r");
    assert_eq!(terminal.wait_for_end().exit_code(), 2);
    assert_eq!(both(), [Module::Do4.code(), 0]);

    let mut terminal = Terminal::run(&arguments);
    terminal.wait_for("[y/N]");
    terminal.press("y\r");
    assert!(terminal.wait_for_end().success());
    assert_eq!(both(), [Module::Di4.code(), 25]);

    let (_folder, path) = file("p5.module = \"4do\"\n");
    let words_of = format!("config import {} --yes", path.display());
    At::tcp(unit).run(&words_of).fine();
    assert_eq!(both(), [Module::Do4.code(), 25]);
}
