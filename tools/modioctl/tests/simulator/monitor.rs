//! Tests of `modioctl monitor` in a pseudo-terminal, with a unit that this test serves over TCP.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use modioctl::bus::adu::Framing;
use register_map::Module;
use register_map::state::PRODUCT_CODE;

use crate::served::{Answers, Modio, serve_requests};
use crate::terminal::Terminal;

/// A unit that is served over TCP with RTU frames.
struct Unit {
    address: SocketAddr,
    modio: Arc<Mutex<Modio>>,
    faults: Arc<Faults>,
}

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
    /// Starts a modio-02 with a 4do.
    fn serve() -> Self {
        let modio = Arc::new(Mutex::new(Modio::modio_02(Module::Do4)));
        let faults = Arc::<Faults>::default();
        let (served, of_served) = (Arc::clone(&modio), Arc::clone(&faults));
        let address = serve_requests(move |unit, pdu| {
            let is = |fault: &AtomicBool| fault.load(Ordering::SeqCst);
            if is(&of_served.hangs_up) {
                return None;
            }
            let ignores = pdu[0] == 5 && is(&of_served.ignores_writes);
            if is(&of_served.silent) || ignores {
                return Some(Vec::new());
            }
            Some(served.lock().unwrap().response(unit, pdu))
        });
        Self {
            address,
            modio,
            faults,
        }
    }

    fn bit(&self, address: usize) -> bool {
        self.modio.lock().unwrap().modio.bits[address]
    }
}

fn monitor(unit: &Unit) -> Terminal {
    let terminal = Terminal::run(&[
        "--tcp",
        &unit.address.to_string(),
        "--baud",
        "115200",
        "monitor",
    ]);
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
    let mut other = Modio::modio_02(Module::Di4);
    other.modio.bits[0x12] = true;
    *unit.modio.lock().unwrap() = other;
    unit.faults.silent.store(false, Ordering::SeqCst);
    terminal.wait_for("● answers");
    terminal.wait_for("p5.3 digital input         ■ on  good");

    terminal.press("q");
    terminal.wait_for_success();
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
fn edges_of_the_selected_input_are_read() {
    let mut unit = Modio::modio_02(Module::Di4);
    unit.modio.now = Duration::from_secs(5);
    let address = serve_requests(move |address, pdu| {
        // The newest 20 edges: the last one is p5.1 on, 2 s before the uptime.
        const LOG: &[u8] = &[0x14, 7, 6, 0, 3, 0, 133, 0, 60];
        const EDGE: [u8; 6] = [0x01, 0x10, 0, 0, 0x0B, 0xB8];
        let edges = [&[0x14, 122, 121, 6][..], &[0; 114], &EDGE].concat();
        Some(match pdu {
            LOG => Framing::Rtu.frame(0, address, &edges),
            _ => unit.response(address, pdu),
        })
    });
    let mut terminal = Terminal::run(&["--tcp", &address.to_string(), "monitor"]);
    terminal.wait_for("p5.1 digital input");
    terminal.wait_for("Last edges:");
    let text = terminal.text();
    let line = text.split("Last edges:").nth(1).unwrap().lines().nth(1);
    let line = line.unwrap();
    assert!(line.contains("on  ") && line.ends_with(" s ago"), "{text}");
    terminal.press("q");
    assert!(terminal.wait_for_end().success());
}

#[test]
fn ctrl_c_restores_the_terminal_with_status_0() {
    let unit = Unit::serve();
    let mut terminal = monitor(&unit);
    terminal.press("\x03");
    terminal.wait_for_success();
}

#[test]
fn unit_that_is_not_a_modio_ends_with_status_1() {
    let unit = Unit::serve();
    let product = (PRODUCT_CODE, 0);
    unit.modio.lock().unwrap().modio.fixed.extend([product]);
    let mut terminal = Terminal::run(&["--tcp", &unit.address.to_string(), "monitor"]);
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
