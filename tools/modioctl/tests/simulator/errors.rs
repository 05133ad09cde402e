//! Tests of each exit status.

use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::PathBuf;

use modioctl::bus::adu::Framing;

use crate::ordinary::Ordinary;
use crate::program::{At, Ran, has, modioctl};
use crate::served::serve_requests;
use crate::unit::Unit;

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_module_that_is_not_plugged_in_is_status_1() {
    let unit = Unit::with(1, &["--module", "4ao"]);
    unit.post("/api/power", r#"{"on":false}"#);
    unit.post("/api/module", r#"{"name":"4di"}"#);
    unit.post("/api/power", r#"{"on":true}"#);
    unit.wait(500);
    let at = At::tcp(unit.tcp);
    let text = at.run("write p5.1=100").failed(1);
    has(&text, &["exception 04", "plugged in"]);
    let text = at.run("read p5.module_state").fine();
    assert_eq!(text, "p5.module_state  not answering\n");
}

#[test]
fn wrong_usage_is_status_2_and_reports_what_is_allowed() {
    let nowhere = At::tcp("127.0.0.1:1");
    for (words, part) in [
        ("read", "NAME"),
        ("write p5.1", "NAME=VALUE"),
        ("frobnicate", "frobnicate"),
        ("--port x info", "cannot be used with"),
        ("scan --units 0-5", "1 to 247"),
        ("scan --rates 9600", "over TCP"),
        ("module set 9 4di", "1 to 8, such as p5 or 5"),
    ] {
        let text = nowhere.run(words).failed(2);
        assert!(text.contains(part), "{words}: {text}");
    }
    let output = modioctl(&["info"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "no endpoint");
    assert!(String::from_utf8(output.stderr).unwrap().contains("--port"));
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn wrong_names_and_values_are_status_2_and_nothing_is_written() {
    let unit = Unit::with(1, &["--module", "4do"]);
    let at = At::tcp(unit.tcp);
    for (words, part) in [
        ("write p5.1=on p5.2=maybe", "on or off"),
        ("write p5.1=on uptime=0", "only be read"),
        ("module set 1 4di", "port 1 has no slot"),
        ("module set 5 5di", "4di"),
        ("config import /nowhere.toml", "/nowhere.toml"),
        ("raw 0", "hexadecimal"),
    ] {
        let text = at.run(words).failed(2);
        assert!(text.contains(part), "{words}: {text}");
    }
    assert_eq!(at.run("read p5.1").fine(), "p5.1  off\n");
}

/// Two units with address 1: their answers collide on the line, where a 0 overrides a 1.
fn two_units_with_one_address() -> SocketAddr {
    serve_requests(|unit, pdu| {
        // Their replies to function 11 are equal, because they are of one kind; all others differ.
        let differs = pdu[0] != 0x11;
        let answer = |unit: u8| [pdu[0], 2, 0x55, if differs { unit } else { 0xFF }];
        let [one, other] = [1, 2].map(|unit| Framing::Rtu.frame(0, 1, &answer(unit)));
        let both = one.iter().zip(other).map(|(one, other)| one & other);
        Some(both.filter(|_| unit == 1).collect())
    })
}

#[test]
fn two_units_with_one_address_are_status_4() {
    let at = At::tcp(two_units_with_one_address());
    let text = at.run("--timeout 200ms info").failed(4);
    has(&text, &["garbled", "two units"]);
    let ran = at.run("scan --units 1-3");
    assert_eq!(ran.status, 4, "{ran:?}");
    let told = "something answers, but garbled, at address 1";
    assert!(ran.out.contains(told), "{ran:?}");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_port_that_cannot_be_opened_is_status_5() {
    let text = At::port("/dev/nowhere").run("info").failed(5);
    has(&text, &["there is no port /dev/nowhere; this computer has"]);
    // A free port that nobody listens on.
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let text = At::tcp(free).run("info").failed(5);
    assert!(text.contains("no connection"), "{text}");

    let unit = Unit::with(1, &["--module", "4di"]);
    let at = At::port(unit.pty.display());
    let mut holder = at.start("watch");
    holder.out.wait_for("p5.1");
    let text = at.run("info").failed(5);
    assert!(text.contains("is in use"), "{text}");
    drop(holder);
    at.run("info").fine();
}

/// Returns a pseudo-terminal and the path of the end that programs open.
fn pseudo_terminal() -> (portable_pty::PtyPair, PathBuf) {
    let pair = portable_pty::native_pty_system()
        .openpty(portable_pty::PtySize::default())
        .unwrap();
    let port = pair.master.tty_name().unwrap();
    (pair, port)
}

#[test]
fn a_port_without_permission_is_status_5_and_names_the_group() {
    const ROOT: u32 = 0;
    const DAEMON: u32 = 1;
    let (_open, port) = pseudo_terminal();
    std::fs::set_permissions(&port, PermissionsExt::from_mode(0o000)).unwrap();
    let user = Ordinary::new();
    let refused = |group: u32| {
        if user.is_root {
            chown(&port, None, Some(group)).unwrap();
        }
        let mut command = user.modioctl(&["--port", port.to_str().unwrap(), "info"]);
        let text = Ran::of(&command.output().unwrap()).failed(5);
        assert!(text.contains("no permission for /dev/pts/"), "{text}");
        text
    };
    let (of_daemon, of_root) = (refused(DAEMON), refused(ROOT));
    if user.is_root {
        let joins = of_daemon.contains("sudo usermod -aG daemon $USER");
        assert!(joins, "{of_daemon}");
        let takes = of_root.contains("sudo chown $USER /dev/pts/");
        assert!(takes, "{of_root}");
    }
}

/// The other end of the pseudo-terminal stays open, as that of a simulator does.
#[test]
fn a_pseudo_terminal_is_free_for_every_program_when_the_program_has_ended() {
    let (_open, port) = pseudo_terminal();
    let user = Ordinary::new();
    user.give(&port);
    let port = port.to_str().unwrap();
    for _ in 0..2 {
        let words = ["--port", port, "--timeout", "10ms", "read", "0"];
        let text = Ran::of(&user.modioctl(&words).output().unwrap()).failed(3);
        assert!(text.contains("does not answer"), "{text}");
        let mut other = user.command("sh", &["-c", "exec 3<>$0", port]);
        assert!(other.status().unwrap().success());
    }
}
