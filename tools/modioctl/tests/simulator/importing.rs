//! Tests of `modioctl config import` with a unit that this test serves.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::thread;

use modio_description::{checksum, describe};
use modioctl::bus::adu::Framing;
use register_map::Module;
use register_map::board::MODIO_02;
use register_map::configuration::{COMM_TIMEOUT, LORA_ADDRESS, MODULE};
use register_map::state::{BOARD, DESCRIPTION_CRC, MODULE_IN_FORCE, PRODUCT, PRODUCT_CODE};

use crate::program::At;
use crate::terminal::Terminal;

type Words = Arc<Mutex<Vec<u16>>>;

/// Returns a modio-02 with a 4do, and its registers. It does not answer a write to `silent_at`.
fn unit(silent_at: u16) -> (SocketAddr, Words) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let mut words = vec![0_u16; 0x400];
    let description = describe(&MODIO_02, "0.0.0", |_| Module::Do4);
    for (at, word) in [
        (PRODUCT_CODE, (PRODUCT >> 16) as u16),
        (PRODUCT_CODE + 1, PRODUCT as u16),
        (BOARD, 1),
        (DESCRIPTION_CRC, checksum(&description.encode())),
        (MODULE + 4, Module::Do4.code()),
        (MODULE_IN_FORCE + 4, Module::Do4.code()),
    ] {
        words[usize::from(at)] = word;
    }
    let words = Arc::new(Mutex::new(words));
    let served = Arc::clone(&words);
    thread::spawn(move || {
        for mut master in listener.incoming().flatten() {
            let mut bytes = [0; 512];
            while let Ok(count @ 1..) = master.read(&mut bytes) {
                let (unit, pdu) = Framing::Rtu.open(&bytes[..count]).unwrap();
                let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
                let first = usize::from(word(1));
                let mut words = served.lock().unwrap();
                let answer = match pdu[0] {
                    3 => {
                        let words = &words[first..][..word(3).into()];
                        let bytes: Vec<_> = words.iter().flat_map(|w| w.to_be_bytes()).collect();
                        [vec![3, bytes.len() as u8], bytes].concat()
                    }
                    6 if word(1) == silent_at => continue,
                    6 => {
                        words[first] = word(3);
                        pdu.clone()
                    }
                    function => vec![function | 0x80, 1],
                };
                master
                    .write_all(&Framing::Rtu.frame(0, unit, &answer))
                    .unwrap();
            }
        }
    });
    (address, words)
}

/// Returns a file with this text, and its folder.
fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn word(words: &Words, address: u16) -> u16 {
    words.lock().unwrap()[usize::from(address)]
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
    let told = "modioctl: stopped: 2 of 3 settings are written and nothing is saved";
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
