//! Tests of a restart after which the unit has other line settings, or not.

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use modioctl::bus::adu::Framing;
use register_map::Module;
use register_map::board::FX3U_14;
use register_map::configuration::{BAUD, COMMAND, MODE, UNIT};
use register_map::second::BUS_MESSAGES;
use register_map::state::UNIQUE_ID;

use crate::program::At;
use crate::served::{Answers, Modio, serve, serve_requests};
use crate::unit::Unit;

/// Returns a modio whose MODE is ASCII, which is not saved.
fn in_ascii_mode() -> Modio {
    let mut unit = Modio::modio_02(Module::Di4);
    unit.modio.edited.insert(MODE, 1);
    unit
}

fn is_command(pdu: &[u8]) -> bool {
    pdu[0] == 6 && pdu[1..3] == COMMAND.to_be_bytes()
}

/// A unit over TCP in RTU mode whose registers announce ASCII mode, which may be saved. After a restart nothing answers
/// behind a gateway that does not follow.
fn unit(is_saved: bool, gateway_follows: bool) -> SocketAddr {
    let mut modio = in_ascii_mode();
    if is_saved {
        modio.modio.saved.insert(MODE, 1);
    }
    let unit = Arc::new(Mutex::new((modio, Framing::Rtu)));
    serve(move |mut master| {
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = master.read(&mut bytes) {
            let (modio, framing) = &mut *unit.lock().unwrap();
            let Some((address, pdu)) = framing.open(&bytes[..count]) else {
                continue;
            };
            let answer = modio.answer(&pdu);
            let frame = framing.frame(0, address, &answer);
            master.write_all(&frame).unwrap();
            if is_command(&pdu) {
                *framing = match modio.modio.edited[&MODE] {
                    _ if !gateway_follows => Framing::Mbap,
                    0 => Framing::Rtu,
                    _ => Framing::Ascii,
                };
            }
        }
    })
}

#[test]
fn a_restart_is_followed_by_the_settings_with_which_the_unit_answers() {
    for (is_saved, wanted) in [
        (true, "now answers with ASCII"),
        (false, "still answers with RTU"),
    ] {
        let text = At::tcp(unit(is_saved, true))
            .run("--timeout 200ms reboot")
            .fine();
        assert!(text.contains(wanted), "{text}");
        assert!(text.ends_with("restarted\n"), "{text}");
    }
    let lost = At::tcp(unit(true, false)).run("--timeout 200ms reboot");
    let text = lost.failed(3);
    let both = "neither with the RTU that it had nor with the ASCII that it announced";
    assert!(text.contains(both) && text.contains("gateway"), "{text}");
}

/// Settings of the first line, the cable, do not concern a gateway radio.
#[test]
fn restart_over_the_second_line_announces_no_settings_of_the_first() {
    let mut unit = in_ascii_mode();
    unit.modio.edited.insert(BAUD, 192);
    let at = At::tcp(serve_requests(move |address, pdu| {
        *unit.modio.fixed.entry(BUS_MESSAGES).or_default() += 1;
        Some(unit.response(address, pdu))
    }));
    let text = at.run("--timeout 200ms reboot").fine();
    assert_eq!(text, "restarted\n");
}

#[test]
fn a_unit_that_is_busy_while_it_starts_is_waited_for() {
    let mut unit = Modio::modio_02(Module::Di4);
    let mut busy = 0;
    let at = At::tcp(serve_requests(move |address, pdu| {
        if busy > 0 {
            busy -= 1;
            return Some(Framing::Rtu.frame(0, address, &[pdu[0] | 0x80, 6]));
        }
        if is_command(pdu) {
            busy = 5;
        }
        Some(unit.response(address, pdu))
    }));
    assert_eq!(at.run("--timeout 200ms reboot").fine(), "restarted\n");
}

/// A unit over TCP with address 1, which misses one request while it restarts. Its UNIT announces 17. If that is not
/// saved, another unit, which has just started, has address 17.
fn moving_unit(is_saved: bool) -> SocketAddr {
    let fx3u = |identity| Modio::of(&FX3U_14, |_| Module::None).with([(UNIQUE_ID, identity)]);
    let (mut unit, mut other) = (fx3u(0xA), fx3u(0xB));
    other.modio.start(other.modio.now, true);
    unit.modio.edited.insert(UNIT, 17);
    if is_saved {
        unit.modio.saved.insert(UNIT, 17);
    }
    let mut own = 1;
    let mut is_starting = false;
    serve_requests(move |address, pdu| {
        let unit = match address {
            17 if !is_saved => &mut other,
            _ if u16::from(address) == own && !std::mem::take(&mut is_starting) => &mut unit,
            _ => return Some(Vec::new()),
        };
        let response = unit.response(address, pdu);
        if is_command(pdu) {
            own = unit.modio.edited[&UNIT];
            is_starting = true;
        }
        Some(response)
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
