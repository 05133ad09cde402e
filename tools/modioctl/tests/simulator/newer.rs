//! A unit that is newer than this program: only its own description contains its board, firmware and registers.

use std::net::SocketAddr;

use modio_description::{Description, Register, Scope, Unit, Value, Values, describe};
use register_map::Module;
use register_map::board::MODIO_02;
use register_map::points::first;
use register_map::state::{BOARD, FIRMWARE_PATCH, FIRMWARE_VERSION, UNIQUE_ID};

use crate::program::{At, Ran, has};
use crate::served::{Answers, Modio, serve_requests};

/// A register that only this unit has.
const PRESSURE_LIMIT: u16 = 0x0500;

/// Returns the description: that of a modio-02 with new parts.
fn description() -> Description {
    let mut description = describe(&MODIO_02, "9.9.9", |_| Module::Ai4);
    description.board = "modio-99".to_owned();
    description.registers.push(Register {
        address: PRESSURE_LIMIT,
        count: 1,
        name: "PRESSURE_LIMIT".to_owned(),
        scope: Scope::Unit,
        value: Value::Number(Unit {
            code: "kPa".to_owned(),
            exponent: -1,
            offset: 0,
        }),
        writable: false,
        restart: false,
        values: Values::Range(0, 1000),
        default: 0,
        narrower: None,
        about: "Where the valve opens".to_owned(),
    });
    description
}

/// Serves the registers of a unit with this description, its file and this identity, at every address but
/// [`MISSING`].
fn unit(description: &Description, identity: u16) -> SocketAddr {
    let identity = (UNIQUE_ID..UNIQUE_ID + 6).map(|register| (register, identity));
    let registers = [
        (FIRMWARE_VERSION, 0x0909),
        (FIRMWARE_PATCH, 9),
        (BOARD, 99),
        (PRESSURE_LIMIT, 1234),
    ];
    let mut modio = Modio::modio_02(Module::Ai4).with(registers.into_iter().chain(identity));
    modio.modio.describe(description);
    modio.modio.words[usize::from(first(5))] = 7;
    serve_requests(move |unit, pdu| {
        Some(match unit {
            MISSING => Vec::new(),
            unit => modio.response(unit, pdu),
        })
    })
}

/// Address without a unit.
const MISSING: u8 = 9;

#[test]
fn a_unit_without_identification_is_listed_with_the_reason() {
    let at = At::tcp(unit(&description(), 1));
    let text = at.run("scan --units 3").fine();
    assert_eq!(
        text,
        "3     no identification: exception 01, illegal function\n"
    );
}

#[test]
fn a_newer_unit_is_read_by_its_own_description() {
    let at = At::tcp(unit(&description(), 1));
    let first = at.run("read PRESSURE_LIMIT p5.1");
    assert!(
        first.err.contains("reading the unit's description"),
        "{first:?}"
    );
    assert_eq!(
        first.fine(),
        "PRESSURE_LIMIT  123.4 kPa\np5.1            7\n"
    );
    let again = at.run("describe");
    assert!(again.err.is_empty(), "stored before: {again:?}");
    let text = again.fine();
    has(&text, &["modio-99", "Where the valve opens"]);
    let text = at.run("read PRESURE_LIMIT").failed(2);
    assert!(text.contains("PRESSURE_LIMIT"), "{text}");
}

#[test]
fn refresh_reads_the_description_again_with_every_command() {
    let at = At::tcp(unit(&description(), 1));
    for (words, is_read) in [
        ("read PRESSURE_LIMIT", true),
        ("read PRESSURE_LIMIT", false),
        ("read --refresh PRESSURE_LIMIT", true),
        ("--refresh export csv", true),
        ("describe --refresh", true),
    ] {
        let ran = at.run(words);
        assert_eq!(ran.err.contains("reading"), is_read, "{words}: {ran:?}");
        ran.fine();
    }
}

#[test]
fn description_that_cannot_be_stored_is_reported() {
    let at = At::tcp(unit(&description(), 1));
    let mut command = at.command("read PRESSURE_LIMIT");
    // A folder cannot be created in a file.
    let output = command.env("XDG_CACHE_HOME", "/dev/null").output();
    let ran = Ran::of(&output.unwrap());
    has(&ran.err, &["is not stored", "/dev/null"]);
    assert!(!ran.err.contains("stored for"), "{ran:?}");
    ran.fine();
    let ran = at.run("read PRESSURE_LIMIT");
    assert!(!ran.err.contains("is not stored"), "{ran:?}");
}

#[test]
fn a_description_that_cannot_be_used_is_not_stored() {
    let mut hostile = description();
    // 65535 items, each with a copy of this text, were 980 MB.
    let mut last = hostile.registers.pop().unwrap();
    (last.count, last.about) = (0xFFFF, "x".repeat(14_000));
    hostile.registers.push(last);
    let at = At::tcp(unit(&hostile, 1));
    for _ in 0..2 {
        let ran = at.run("read BAUD");
        assert!(ran.err.contains("reading"), "{ran:?}");
        assert_eq!(ran.status, 1);
        assert!(ran.err.contains("a text of 14000 bytes"), "{ran:?}");
    }
    assert_eq!(at.stored(), 0);
}

#[test]
fn a_stored_description_is_not_that_of_another_unit() {
    let at = At::tcp(unit(&description(), 1));
    at.run("describe").fine();
    // The same registers and the same CRC, but another identity.
    let other = at.elsewhere(unit(&description(), 2));
    let ran = other.run("describe");
    assert!(ran.err.contains("reading"), "{ran:?}");
    let again = at.run("describe");
    assert!(again.err.is_empty(), "{again:?}");
    assert_eq!(at.stored(), 2);
}

#[test]
fn an_export_of_several_units_needs_all_of_them() {
    let at = At::tcp(unit(&description(), 1));
    let rows = at.run("export --units 1-2 csv").fine();
    let of = |unit: &str| rows.lines().filter(|row| row.ends_with(unit)).count();
    assert!(of(",1") > 50 && of(",1") == of(",2"), "{rows}");
    let error = at
        .run("--timeout 50ms --retries 0 export --units 1,9 csv")
        .failed(3);
    has(&error, &["without unit 9", "--units"]);
}
