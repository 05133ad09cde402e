//! Tests of `modioctl monitor` in a pseudo-terminal, with a unit that this test serves over TCP.

#![cfg(unix)]

mod terminal;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use modio_description::{checksum, describe};
use modioctl::bus::adu::Framing;
use register_map::board::MODIO_02;
use register_map::state::{
    BOARD, DESCRIPTION_CRC, FIRMWARE_VERSION, MODULE_IN_FORCE, PRODUCT, PRODUCT_CODE,
};
use register_map::{Module, configuration::MODULE};

use crate::terminal::{Terminal, wait};

/// Length of every request of the monitor except function 10: unit, function, two words, CRC.
const REQUEST: usize = 8;

/// The registers and bits of a modio-02 with a 4do.
struct Tables {
    words: Vec<u16>,
    bits: Vec<bool>,
}

impl Tables {
    fn new() -> Self {
        let mut words = vec![0; 0x400];
        let mut set = |address: u16, word: u16| words[usize::from(address)] = word;
        set(PRODUCT_CODE, (PRODUCT >> 16) as u16);
        set(PRODUCT_CODE + 1, PRODUCT as u16);
        set(FIRMWARE_VERSION, 0x0001);
        set(BOARD, 1);
        let mut tables = Self {
            words,
            bits: vec![false; 0x20],
        };
        tables.plug(Module::Do4);
        tables
    }

    /// Sets a module in the slot, which is also in force.
    fn plug(&mut self, module: Module) {
        // The program knows this unit's description and does not read it.
        let description = describe(&MODIO_02, "0.1.0", |_| module);
        let crc = checksum(&description.encode());
        let words = [
            (MODULE + 4, module.code()),
            (MODULE_IN_FORCE + 4, module.code()),
            (DESCRIPTION_CRC, crc),
        ];
        for (address, word) in words {
            self.words[usize::from(address)] = word;
        }
    }

    /// Returns the PDU of the response to a request of function 01, 03 or 05.
    fn answer(&mut self, pdu: &[u8]) -> Vec<u8> {
        let word = |at: usize| usize::from(pdu[at]) << 8 | usize::from(pdu[at + 1]);
        let (first, second) = (word(1), word(3));
        match pdu[0] {
            1 => {
                let bits = &self.bits[first..first + second];
                let mut bytes = vec![0; second.div_ceil(8)];
                for (n, bit) in bits.iter().enumerate() {
                    bytes[n / 8] |= u8::from(*bit) << (n % 8);
                }
                [vec![1, bytes.len() as u8], bytes].concat()
            }
            3 => {
                let words = &self.words[first..first + second];
                let bytes: Vec<_> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
                [vec![3, bytes.len() as u8], bytes].concat()
            }
            5 => {
                self.bits[first] = second == 0xFF00;
                pdu.to_vec()
            }
            code => vec![code | 0x80, 1],
        }
    }
}

/// A unit that is served over TCP with RTU frames.
struct Unit {
    address: String,
    tables: Arc<Mutex<Tables>>,
    faults: Arc<Faults>,
}

/// Faults of the unit.
#[derive(Default)]
struct Faults {
    /// It answers no requests.
    silent: AtomicBool,
    /// It neither answers nor executes requests of function 05.
    ignores_writes: AtomicBool,
    /// It closes every connection at the next request.
    hangs_up: AtomicBool,
}

impl Unit {
    fn serve() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let unit = Self {
            address: listener.local_addr().unwrap().to_string(),
            tables: Arc::new(Mutex::new(Tables::new())),
            faults: Arc::default(),
        };
        let (tables, faults) = (Arc::clone(&unit.tables), Arc::clone(&unit.faults));
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (tables, faults) = (Arc::clone(&tables), Arc::clone(&faults));
                std::thread::spawn(move || connection(stream, &tables, &faults));
            }
        });
        unit
    }

    fn bit(&self, address: usize) -> bool {
        self.tables.lock().unwrap().bits[address]
    }
}

fn connection(mut stream: TcpStream, tables: &Mutex<Tables>, faults: &Faults) {
    let mut request = [0; REQUEST];
    while stream.read_exact(&mut request).is_ok() {
        let is = |fault: &AtomicBool| fault.load(Ordering::SeqCst);
        if is(&faults.hangs_up) {
            return;
        }
        let (unit, pdu) = Framing::Rtu.open(&request).expect("a complete request");
        if is(&faults.silent) || (pdu[0] == 5 && is(&faults.ignores_writes)) {
            continue;
        }
        let answer = tables.lock().unwrap().answer(&pdu);
        if stream
            .write_all(&Framing::Rtu.frame(0, unit, &answer))
            .is_err()
        {
            return;
        }
    }
}

fn monitor(unit: &Unit) -> Terminal {
    let terminal = Terminal::run(&["--tcp", &unit.address, "--baud", "115200", "monitor"]);
    // On a machine that stalls, the value may be old for a moment; the test continues when it is fresh.
    terminal.wait_for("p5.1 digital output      [□ off] good");
    terminal
}

#[test]
fn output_is_switched_by_key_and_by_click_and_a_silent_unit_is_shown() {
    let unit = Unit::serve();
    let mut terminal = monitor(&unit);
    assert!(terminal.text().contains("modio-02 0.1.0, unit 1"));

    let before = "p5.1 digital output      [□ off] good";
    terminal.switch(" ", before, "p5.1 digital output       [■ on] good");
    assert!(unit.bit(0x10));

    // A click on the value of p5.3: column 30, row 7, counted from 1.
    let click = "\x1b[<0;30;7M\x1b[<0;30;7m";
    let before = "p5.3 digital output      [□ off] good";
    terminal.switch(click, before, "p5.3 digital output       [■ on] good");
    assert!(unit.bit(0x12));

    unit.faults.silent.store(true, Ordering::SeqCst);
    terminal.wait_for("× no answer since");
    terminal.wait_for("p5.3 digital output       [■ on] old:");
    terminal.press(" ");
    terminal.wait_for("p5.3 is not switched: its present value is not known");
    assert!(unit.bit(0x12));

    // The unit returns with another module.
    unit.tables.lock().unwrap().plug(Module::Di4);
    unit.faults.silent.store(false, Ordering::SeqCst);
    terminal.wait_for("● answers");
    terminal.wait_for("p5.3 digital input         ■ on  good");

    terminal.press("q");
    assert!(terminal.wait_for_end().success());
    wait(
        || terminal.is_restored(),
        || "the terminal is not restored".to_owned(),
    );
}

#[test]
fn write_without_an_answer_is_repeated_only_when_asked() {
    let unit = Unit::serve();
    let mut terminal = monitor(&unit);
    unit.faults.ignores_writes.store(true, Ordering::SeqCst);
    let before = "p5.1 digital output      [□ off] good";
    terminal.switch(" ", before, "[r: try again]");
    assert!(terminal.text().contains("may have executed it"));
    unit.faults.ignores_writes.store(false, Ordering::SeqCst);
    terminal.wait_for(before);
    assert!(
        !unit.bit(0x10),
        "the program repeated the write without an order"
    );
    terminal.press("r");
    terminal.wait_for("p5.1 digital output       [■ on] good");
    assert!(unit.bit(0x10));
}

#[test]
fn lost_connection_is_opened_again() {
    let unit = Unit::serve();
    let terminal = monitor(&unit);
    unit.faults.hangs_up.store(true, Ordering::SeqCst);
    terminal.wait_for("× port lost, no answer since");
    unit.faults.hangs_up.store(false, Ordering::SeqCst);
    terminal.wait_for("● answers");
    terminal.wait_for("p5.1 digital output      [□ off] good");
}

#[test]
fn ctrl_c_restores_the_terminal_with_status_0() {
    let unit = Unit::serve();
    let mut terminal = monitor(&unit);
    terminal.press("\x03");
    assert!(terminal.wait_for_end().success());
    wait(
        || terminal.is_restored(),
        || "the terminal is not restored".to_owned(),
    );
}

#[test]
fn unit_that_is_not_a_modio_ends_with_status_1() {
    let unit = Unit::serve();
    unit.tables.lock().unwrap().words[usize::from(PRODUCT_CODE)] = 0;
    let mut terminal = Terminal::run(&["--tcp", &unit.address, "monitor"]);
    assert_eq!(terminal.wait_for_end().exit_code(), 1);
    terminal.wait_for("not a modio");
}

#[test]
fn monitor_without_a_terminal_ends_with_status_2() {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_modioctl"));
    let output = command
        .args(["--port", "none", "monitor"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("needs a terminal") && text.lines().count() == 1);
}
