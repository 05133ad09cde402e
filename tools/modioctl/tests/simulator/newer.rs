//! A unit that is newer than this program: only its own description contains its board, firmware and registers.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::thread;

use modio_description::{Description, Register, Scope, Unit, Value, Values, checksum, describe};
use modioctl::bus::adu::Framing;
use register_map::Module;
use register_map::board::MODIO_02;

use crate::program::At;

/// Returns the description: that of a modio-02 with new parts.
fn description() -> Description {
    let mut description = describe(&MODIO_02, "9.9.9", |_| Module::Ai4);
    description.board = "modio-99".to_owned();
    description.registers.push(Register {
        address: 0x0500,
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

/// Serves the registers of a unit with this description, its file and this identity over TCP, at every address but
/// [`MISSING`].
fn unit(description: &Description, identity: u16) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let file = description.file();
    let words = file
        .as_chunks::<2>()
        .0
        .iter()
        .map(|word| u16::from_be_bytes(*word))
        .collect::<Vec<_>>();
    let mut registers: BTreeMap<u16, u16> = (0x0180..0x01C0).map(|address| (address, 0)).collect();
    registers.extend([
        (0x0200, 0x2383),
        (0x0201, 0x5860),
        (0x0202, 0x0909),
        (0x0203, 9),
        (0x0204, 1),
        (0x0205, 99),
    ]);
    registers.extend((0x0220..0x0226).map(|address| (address, identity)));
    registers.extend([
        (0x020F, checksum(&description.encode())),
        (0x0500, 1234),
        (0x0010, 7),
    ]);
    thread::spawn(move || {
        for mut master in listener.incoming().flatten() {
            let mut bytes = [0; 512];
            while let Ok(count @ 1..) = master.read(&mut bytes) {
                let (unit, pdu) = Framing::Rtu.open(&bytes[..count]).unwrap();
                if unit == MISSING {
                    continue;
                }
                let answer = answer(&pdu, &registers, &words);
                master
                    .write_all(&Framing::Rtu.frame(0, unit, &answer))
                    .unwrap();
            }
        }
    });
    address
}

/// Address without a unit.
const MISSING: u8 = 9;

fn answer(pdu: &[u8], registers: &BTreeMap<u16, u16>, file: &[u16]) -> Vec<u8> {
    let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
    let bytes = |words: Vec<u16>| {
        words
            .into_iter()
            .flat_map(u16::to_be_bytes)
            .collect::<Vec<_>>()
    };
    match pdu[0] {
        3 => {
            let addresses = word(1)..word(1) + word(3);
            let words: Option<Vec<u16>> = addresses
                .map(|address| registers.get(&address).copied())
                .collect();
            words.map_or(vec![0x83, 2], |words| {
                [vec![3, words.len() as u8 * 2], bytes(words)].concat()
            })
        }
        0x14 if word(3) == 1 => {
            let first = usize::from(word(5));
            let words = bytes(file[first..first + usize::from(word(7))].to_vec());
            [
                vec![0x14, words.len() as u8 + 2, words.len() as u8 + 1, 6],
                words,
            ]
            .concat()
        }
        function => vec![function | 0x80, 1],
    }
}

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
    assert!(
        text.contains("modio-99") && text.contains("Where the valve opens"),
        "{text}"
    );
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
fn a_description_that_cannot_be_used_is_not_stored() {
    let mut hostile = description();
    // 65535 items, each with a copy of this text, were 3.9 GB.
    let mut last = hostile.registers.pop().unwrap();
    (last.count, last.about) = (0xFFFF, "x".repeat(50_000));
    hostile.registers.push(last);
    let at = At::tcp(unit(&hostile, 1));
    for _ in 0..2 {
        let ran = at.run("read BAUD");
        assert!(ran.err.contains("reading"), "{ran:?}");
        assert_eq!(ran.status, 1);
        assert!(ran.err.contains("a text of 50000 bytes"), "{ran:?}");
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
    assert!(
        error.contains("without unit 9") && error.contains("--units"),
        "{error}"
    );
}
