//! Tests of a restart after which the unit has other line settings, or not.

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use modioctl::bus::adu::Framing;
use register_map::configuration::{BAUD, COMMAND, KEY, MODE, UNIT};
use register_map::second::BUS_MESSAGES;
use register_map::state::{UNIQUE_ID, UPTIME};

use crate::program::At;
use crate::served::{answer, response, serve, serve_requests, server};
use crate::unit::Unit;

/// What a restart does.
#[derive(Clone, Copy)]
enum Restart {
    /// The values of the registers are saved.
    Saved,
    /// They are not, and a restart loses them.
    Unsaved,
    /// They are saved, and the gateway does not follow.
    Gateway,
}

/// A unit over TCP in RTU mode whose registers announce ASCII mode.
fn unit(mode: Restart) -> SocketAddr {
    let framing = Arc::new(Mutex::new(Framing::Rtu));
    serve(move |mut master| {
        let mut server = server([(UPTIME + 1, 1000), (BAUD, 96), (MODE, 1)]);
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let mut framing = framing.lock().unwrap();
            let Some((unit, pdu)) = framing.open(&bytes[..count]) else {
                continue;
            };
            let answer = answer(&mut server, &pdu);
            master.write_all(&framing.frame(0, unit, &answer)).unwrap();
            if pdu[0] == 6 && pdu[1..3] == COMMAND.to_be_bytes() {
                server.device.words[usize::from(UPTIME) + 1] = 0;
                *framing = match mode {
                    Restart::Saved => Framing::Ascii,
                    Restart::Unsaved => Framing::Rtu,
                    // Nothing more is answered.
                    Restart::Gateway => Framing::Mbap,
                };
            } else if pdu[0] == 6 {
                assert_eq!(pdu[1..3], KEY.to_be_bytes());
            }
        }
    })
}

#[test]
fn a_restart_is_followed_by_the_settings_with_which_the_unit_answers() {
    for (mode, wanted) in [
        (Restart::Saved, "now answers with ASCII"),
        (Restart::Unsaved, "still answers with RTU"),
    ] {
        let text = At::tcp(unit(mode)).run("--timeout 200ms reboot").fine();
        assert!(text.contains(wanted), "{text}");
        assert!(text.ends_with("restarted\n"), "{text}");
    }
    let lost = At::tcp(unit(Restart::Gateway)).run("--timeout 200ms reboot");
    let text = lost.failed(3);
    let both = "neither with the RTU that it had nor with the ASCII that it announced";
    assert!(text.contains(both) && text.contains("gateway"), "{text}");
}

/// Settings of the first line, the cable, do not concern a gateway radio.
#[test]
fn restart_over_the_second_line_announces_no_settings_of_the_first() {
    let mut unit = server([(UPTIME + 1, 1000), (BAUD, 192), (MODE, 1)]);
    let at = At::tcp(serve_requests(move |address, pdu| {
        let words = &mut unit.device.words;
        words[usize::from(BUS_MESSAGES)] += 1;
        if pdu[0] == 6 && pdu[1..3] == COMMAND.to_be_bytes() {
            words[usize::from(UPTIME) + 1] = 0;
        }
        Some(response(&mut unit, address, pdu))
    }));
    let text = at.run("--timeout 200ms reboot").fine();
    assert_eq!(text, "restarted\n");
}

#[test]
fn a_unit_that_is_busy_while_it_starts_is_waited_for() {
    let mut unit = server([(UPTIME + 1, 1000)]);
    let mut busy = 0;
    let at = At::tcp(serve_requests(move |address, pdu| {
        if busy > 0 {
            busy -= 1;
            return Some(Framing::Rtu.frame(0, address, &[pdu[0] | 0x80, 6]));
        }
        if pdu[0] == 6 && pdu[1..3] == COMMAND.to_be_bytes() {
            unit.device.words[usize::from(UPTIME) + 1] = 0;
            busy = 5;
        }
        Some(response(&mut unit, address, pdu))
    }));
    assert_eq!(at.run("--timeout 200ms reboot").fine(), "restarted\n");
}

/// A unit over TCP with address 1, which misses one request while it restarts. Its UNIT announces 17. If that is not
/// saved, another unit, which has just started, has address 17.
fn moving_unit(is_saved: bool) -> SocketAddr {
    let mut unit = server([(UPTIME + 1, 1000), (UNIT, 17), (UNIQUE_ID, 0xA)]);
    let mut other = server([(UNIQUE_ID, 0xB)]);
    let mut own = 1;
    let mut is_starting = false;
    serve_requests(move |address, pdu| {
        let server = match address {
            17 if !is_saved => &mut other,
            _ if address == own && !std::mem::take(&mut is_starting) => &mut unit,
            _ => return Some(Vec::new()),
        };
        if pdu[0] == 6 && pdu[1..3] == COMMAND.to_be_bytes() {
            server.device.words[usize::from(UPTIME) + 1] = 0;
            own = if is_saved { 17 } else { 1 };
            is_starting = true;
        }
        Some(response(server, address, pdu))
    })
}

#[test]
fn a_unit_is_found_at_the_address_that_it_has_after_a_restart() {
    for (is_saved, wanted) in [
        (true, "now answers with address 17, RTU"),
        (false, "still answers with address 1, RTU"),
    ] {
        let at = At::tcp(moving_unit(is_saved));
        let text = at.run("--timeout 200ms reboot").fine();
        assert!(text.contains(wanted), "{text}");
    }
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_line_setting_that_is_not_saved_is_lost_by_a_restart_and_the_unit_is_still_found() {
    let unit = Unit::start(1, "4di");
    let at = At::port(unit.pty.display());
    at.run("config set MODE=ASCII").fine();
    let text = at.run("reboot").fine();
    let still = "the unit still answers with 9600 bit/s 8N2 RTU";
    assert!(text.contains(still), "{text}");
    at.run("config set MODE=ASCII").fine();
    at.run("config save").fine();
    let text = at.run("reboot").fine();
    let now = "the unit now answers with 9600 bit/s 8N2 ASCII";
    assert!(text.contains(now), "{text}");
}

/// The cable's settings do not concern the gateway's port.
#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_restart_over_the_air_keeps_the_settings_of_the_gateway() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("gateway");
    let options = ["--module", "4di", "--lora", link.to_str().unwrap()];
    let unit = Unit::with(1, &options);
    unit.wait(2500);
    let cable = At::tcp(unit.tcp);
    // The simulator stores LORA 2, which takes no command over the air.
    cable.run("config set LORA=1").fine();
    cable.run("config save").fine();
    cable.run("reboot").fine();
    unit.wait(2500);
    cable.run("config set BAUD=19200 MODE=ASCII").fine();
    cable.run("config save").fine();
    let air = At::port(link.display());
    let text = air.run("--format 8N1 --timeout 3s reboot").fine();
    assert_eq!(text, "restarted\n");
}

#[test]
#[ignore = "needs the simulator: cargo xtask test"]
fn a_change_of_the_line_behind_a_gateway_is_warned_of_before_it_is_in_force() {
    let unit = Unit::with(1, &["--module", "4di", "--fixed-line"]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("unit.toml");
    std::fs::write(&file, "FORMAT = \"8E1\"\n").unwrap();
    let warning = |ran: crate::program::Ran| {
        assert_eq!(ran.status, 0, "{ran:?}");
        ran.err.contains("the gateway at")
    };
    let serial = At::port(unit.pty.display());
    assert!(!warning(serial.run("config set BAUD=19200")));
    let at = At::tcp(unit.tcp);
    assert!(!warning(at.run("config set COMM_TIMEOUT=1")));
    for words in [
        "config set BAUD=19200".to_owned(),
        "write FORMAT=8E1".to_owned(),
        "config reset".to_owned(),
        format!("config import {}", file.display()),
    ] {
        assert!(warning(at.run(&words)), "{words}");
    }
    let text = at.run("--timeout 300ms reboot").err;
    assert!(text.contains("the gateway at"), "{text}");
}
