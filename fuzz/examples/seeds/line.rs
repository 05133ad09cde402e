//! Seeds with line traffic for the receivers. `modio_fuzz::receiver` describes the format.

use modbus_reference::{UNIT, framed};

use crate::{Seed, string};

const T15: u8 = 3;
const CLOSE_AND_KEEP: u8 = 4;
const GIVE_BACK: u8 = 5;
const HAS_SENT: u8 = 6;
const T35: u8 = 7;

/// Frames from the manuals of other devices.
const PRINTED: &str = include_str!("../../../tools/conformance/data/frames.txt");

fn characters(bytes: &[u8]) -> Vec<u8> {
    bytes
        .chunks(255)
        .flat_map(|some| [vec![0], string(some)].concat())
        .collect()
}

/// Returns a valid frame. In a script unit 0 is this unit and 1 is a broadcast.
fn good(unit: u8, pdu: &[u8]) -> Vec<u8> {
    [vec![1, unit], string(pdu)].concat()
}

fn faulty(byte: u8, faults: u8) -> Vec<u8> {
    vec![2, byte, faults]
}

/// Returns the frames from manuals, some of which have a wrong CRC.
fn printed() -> impl Iterator<Item = Vec<u8>> {
    PRINTED.lines().filter_map(|line| {
        let digits = line.rsplit('|').next()?.split_whitespace();
        let bytes: Result<Vec<u8>, _> = digits
            .map(|digits| u8::from_str_radix(digits, 16))
            .collect();
        bytes.ok().filter(|bytes| !bytes.is_empty())
    })
}

/// Returns the seeds for both modes.
fn both(delimiter: Option<u8>) -> Vec<(String, Vec<u8>)> {
    let read = [0x03, 0, 0, 0, 1];
    let frame = framed(delimiter, UNIT, &read);
    let (front, back) = frame.split_at(frame.len() / 2);
    let longest = [&[0x08, 0, 0][..], &[0x55; 250]].concat();
    let mut damaged = frame.clone();
    damaged[3] ^= 1;
    let mut seeds: Vec<(String, Vec<u8>)> = vec![
        (
            "a-request".into(),
            [vec![T35], good(0, &read), vec![T35]].concat(),
        ),
        (
            "to-all".into(),
            [vec![T35], good(1, &read), vec![T35]].concat(),
        ),
        (
            "to-another".into(),
            [
                vec![T35],
                good(9, &read),
                vec![T35],
                good(0, &read),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "the-longest".into(),
            [vec![T35], good(0, &longest), vec![T35]].concat(),
        ),
        (
            "too-long".into(),
            [
                vec![T35],
                characters(&frame.repeat(40)),
                vec![T35],
                good(0, &read),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "damaged".into(),
            [
                vec![T35],
                characters(&damaged),
                vec![T35],
                good(0, &read),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "cut-short".into(),
            [
                vec![T35],
                characters(front),
                vec![T35],
                good(0, &read),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "a-gap-within".into(),
            [
                vec![T35],
                characters(front),
                vec![T15],
                characters(back),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "a-silence-within".into(),
            [
                vec![T35],
                characters(front),
                vec![T35],
                characters(back),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "joined".into(),
            [vec![T35], good(0, &read), good(0, &read), vec![T35]].concat(),
        ),
        (
            "in-the-middle".into(),
            [characters(back), vec![T35], good(0, &read), vec![T35]].concat(),
        ),
        (
            "three-in-a-row".into(),
            [
                vec![T35],
                [good(0, &read), vec![CLOSE_AND_KEEP]].concat().repeat(3),
                vec![GIVE_BACK],
                good(0, &read),
                vec![T35, HAS_SENT],
            ]
            .concat(),
        ),
        (
            "sent-meanwhile".into(),
            [
                vec![T35],
                characters(front),
                vec![HAS_SENT],
                characters(back),
                vec![T35],
            ]
            .concat(),
        ),
        (
            "a-stray-zero".into(),
            [
                vec![T35],
                characters(&[0]),
                characters(&frame),
                vec![T35],
                good(0, &read),
                vec![T35],
            ]
            .concat(),
        ),
    ];
    for bit in 0..4 {
        let fault = [
            vec![T35],
            characters(front),
            faulty(back[0], 1 << bit),
            characters(&back[1..]),
            vec![T35],
            good(0, &read),
            vec![T35],
        ];
        seeds.push((format!("a-fault-{bit}"), fault.concat()));
    }
    for length in [0, 1, 2, 3, 252, 253] {
        let pdu: Vec<u8> = (0..length).collect();
        let whole = [vec![T35], good(0, &pdu), vec![T35]].concat();
        seeds.push((format!("a-pdu-of-{length}"), whole));
    }
    seeds
}

/// Returns the seeds of target `receiver_rtu`.
pub fn rtu() -> Vec<Seed> {
    let mut seeds: Vec<Seed> = Vec::new();
    for (name, events) in both(None) {
        if ["a-gap-within", "joined"].contains(&name.as_str()) {
            seeds.push((format!("strict-{name}"), [&[1], &events[..]].concat()));
        }
        seeds.push((name, [&[0], &events[..]].concat()));
    }
    let all = printed().flat_map(|frame| [characters(&frame), vec![T35]].concat());
    seeds.push(("printed".into(), [0, T35].into_iter().chain(all).collect()));
    seeds
}

/// Returns the seeds of target `receiver_ascii`.
pub fn ascii() -> Vec<Seed> {
    let mut seeds: Vec<Seed> = Vec::new();
    for (name, events) in both(Some(b'\n')) {
        seeds.push((name, [&[1, 0], &events[..]].concat()));
    }
    let frame = framed(Some(b'\n'), UNIT, &[0x03, 0, 0, 0, 1]);
    let lower = frame.to_ascii_lowercase();
    let high: Vec<u8> = frame.iter().map(|byte| byte | 0x80).collect();
    for (name, settings, text) in [
        ("lower-case", [0, 0], &lower),
        ("high-bits-of-seven", [1, 0], &high),
        ("high-bits-of-eight", [0, 0], &high),
        ("another-delimiter", [1, b'@'], &frame),
        ("a-digit-as-delimiter", [1, b'A'], &frame),
    ] {
        let events = [characters(text), vec![T35]].concat();
        seeds.push((name.into(), [&settings, &events[..]].concat()));
    }
    let delimiter = framed(Some(b'@'), UNIT, &[0x07]);
    let events = [vec![1, b'@'], characters(&delimiter), vec![T35]].concat();
    seeds.push(("its-own-delimiter".into(), events));
    let two_colons = [b"::", &frame[1..]].concat();
    let events = [vec![1, 0], characters(&two_colons), vec![T35]].concat();
    seeds.push(("two-colons".into(), events));
    let all = printed().flat_map(|rtu| {
        let body = &rtu[..rtu.len() - 2];
        let text = framed(Some(b'\n'), body[0], &body[1..]);
        [characters(&text), vec![T35]].concat()
    });
    seeds.push(("printed".into(), [1, 0].into_iter().chain(all).collect()));
    seeds
}
