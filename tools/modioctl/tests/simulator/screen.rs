//! Tests of `modioctl monitor` with the release image.

use crate::gateway;
use crate::terminal::{Terminal, wait};
use crate::unit::Unit;

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn the_monitor_switches_an_output_and_shows_a_returning_unit_on_every_line() {
    let unit = Unit::with(1, &["--module", "4do"]);
    let [pty, tcp, modbus_tcp] = [
        unit.pty.display().to_string(),
        unit.tcp.to_string(),
        gateway::before(unit.tcp).to_string(),
    ];
    for (option, place) in [
        ("--port", pty),
        ("--tcp", tcp),
        ("--modbus-tcp", modbus_tcp),
    ] {
        let mut terminal = Terminal::run(&[option, &place, "--timeout", "200ms", "monitor"]);
        let off = "p5.2 digital output      [□ off] good";
        let on = "p5.2 digital output       [■ on] good";
        terminal.wait_for(off);
        terminal.press("j");
        terminal.switch(" ", off, on);
        unit.post("/api/power", r#"{"on":false}"#);
        terminal.wait_for("old:");
        unit.post("/api/power", r#"{"on":true}"#);
        // The unit starts with its outputs off.
        terminal.wait_for(off);
        terminal.press("q");
        assert!(terminal.wait_for_end().success(), "{option}");
        wait(
            || terminal.is_restored(),
            || "the terminal is not restored".to_owned(),
        );
    }
}
