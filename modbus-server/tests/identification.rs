//! Function 2B/0E, read device identification (V1.1b3 6.21).

mod common;

use common::{Points, Unit};

fn unit() -> Unit {
    Unit::new(Points::new(4, 4))
}

/// Returns the objects of a reply by their numbers, and the next object if more follow.
fn stream(unit: &mut Unit, code: u8, first: u8) -> (Vec<(u8, Vec<u8>)>, Option<u8>) {
    let reply = unit.request(&[0x2B, 0x0E, code, first]).expect("a reply");
    assert_eq!(reply[..4], [0x2B, 0x0E, code, 0x83]);
    let more = match (reply[4], reply[5]) {
        (0xFF, next) => Some(next),
        (0x00, 0) => None,
        other => panic!("{other:02X?}"),
    };
    let mut rest = &reply[7..];
    let mut objects = Vec::new();
    while let [id, len, tail @ ..] = rest {
        let (value, tail) = tail.split_at((*len).into());
        objects.push((*id, value.to_vec()));
        rest = tail;
    }
    assert!(rest.is_empty());
    assert_eq!(objects.len(), usize::from(reply[6]));
    (objects, more)
}

fn numbers(objects: &[(u8, Vec<u8>)]) -> Vec<u8> {
    objects.iter().map(|(id, _)| *id).collect()
}

#[test]
fn the_reply_matches_the_standards_example_except_for_the_conformity() {
    let reply = unit().request(&[0x2B, 0x0E, 0x01, 0x00]).unwrap();
    let expected = [
        &[0x2B, 0x0E, 0x01, 0x83, 0x00, 0x00, 0x03][..],
        &[0x00, 0x16],
        b"Company identification",
        &[0x01, 0x0F],
        b"Product code XX",
        &[0x02, 0x05],
        b"V2.11",
    ];
    assert_eq!(reply, expected.concat());
}

#[test]
fn each_stream_contains_its_objects() {
    let mut unit = unit();
    let (basic, more) = stream(&mut unit, 1, 0);
    assert_eq!((numbers(&basic), more), (vec![0, 1, 2], None));
    let (regular, more) = stream(&mut unit, 2, 0);
    assert_eq!((numbers(&regular), more), ((0..=6).collect(), None));
    assert_eq!(regular[6], (6, vec![]), "an empty value is an object, too");
    for first in 0..=6 {
        let (objects, _) = stream(&mut unit, 2, first);
        assert_eq!(objects, regular[usize::from(first)..]);
    }
}

#[test]
fn a_long_stream_is_split_between_objects() {
    let mut unit = unit();
    let (mut all, mut first, mut replies) = (Vec::new(), 0, 0);
    loop {
        let (objects, more) = stream(&mut unit, 3, first);
        assert!(!objects.is_empty());
        all.extend(objects);
        replies += 1;
        match more {
            Some(next) => first = next,
            None => break,
        }
    }
    let ids: Vec<u8> = (0..=6).chain(0x80..=0x84).collect();
    assert_eq!(numbers(&all), ids);
    for (id, value) in all {
        let whole = common::object(id).unwrap();
        assert_eq!(value, whole[..whole.len().min(244)], "{id:02X}");
    }
    assert_eq!(replies, 5);
}

#[test]
fn a_reply_may_be_exactly_full() {
    let mut unit = unit();
    // Objects 83 and 84 have 120 and 122 bytes, in total 253 with the other fields.
    let reply = unit.request(&[0x2B, 0x0E, 0x03, 0x83]).unwrap();
    assert_eq!((reply.len(), reply[4], reply[6]), (253, 0, 2));
    unit.points.objects[0x84].as_mut().unwrap().push(b'!');
    let reply = unit.request(&[0x2B, 0x0E, 0x03, 0x83]).unwrap();
    assert_eq!(reply[4..7], [0xFF, 0x84, 1]);
}

#[test]
fn a_stream_with_an_unknown_first_object_begins_with_object_0() {
    let mut unit = unit();
    for (code, first) in [
        (1, 3),
        (1, 0x80),
        (2, 7),
        (2, 0x7F),
        (2, 0x80),
        (3, 7),
        (3, 0x85),
        (3, 0xFF),
    ] {
        let restarted = stream(&mut unit, code, first);
        assert_eq!(restarted, stream(&mut unit, code, 0), "{code} {first:02X}");
    }
}

#[test]
fn a_single_object_can_be_read() {
    let mut unit = unit();
    for id in 0..=255 {
        let request = [0x2B, 0x0E, 0x04, id];
        match common::object(id) {
            Some(value) => {
                let value = &value[..value.len().min(244)];
                let head = [0x2B, 0x0E, 0x04, 0x83, 0, 0, 1, id, value.len() as u8];
                assert_eq!(unit.request(&request), Some([&head, value].concat()));
            }
            None => assert_eq!(unit.refused(&request), 2, "{id:02X}"),
        }
    }
}

#[test]
fn unknown_objects_codes_and_lengths_are_rejected() {
    let mut unit = unit();
    for mei in (0..=255).filter(|mei| *mei != 0x0E) {
        assert_eq!(unit.refused(&[0x2B, mei, 0x01, 0x00]), 1);
        assert_eq!(unit.refused(&[0x2B, mei]), 1);
    }
    for code in (0..=255).filter(|code| !(1..=4).contains(code)) {
        assert_eq!(unit.refused(&[0x2B, 0x0E, code, 0x00]), 3);
        assert_eq!(unit.refused(&[0x2B, 0x0E, code, 0x20]), 3);
    }
    for request in [
        &[0x2B][..],
        &[0x2B, 0x0E],
        &[0x2B, 0x0E, 1],
        &[0x2B, 0x0E, 1, 0, 0],
    ] {
        assert_eq!(unit.refused(request), 3);
    }
}

#[test]
fn the_conformity_matches_the_existing_objects() {
    let mut unit = unit();
    let mut conformity = |without: std::ops::Range<usize>| {
        unit.points.objects[without].fill(None);
        unit.request(&[0x2B, 0x0E, 0x03, 0x00])
            .map(|reply| reply[3])
    };
    assert_eq!(conformity(0x81..256), Some(0x83));
    assert_eq!(conformity(0x80..256), Some(0x82));
    assert_eq!(conformity(4..256), Some(0x82));
    assert_eq!(conformity(3..256), Some(0x81));
}

#[test]
fn function_2b_without_identification_returns_illegal_function() {
    let mut unit = unit();
    unit.points.objects.fill(None);
    for request in [
        &[0x2B][..],
        &[0x2B, 0x0E],
        &[0x2B, 0x0E, 1],
        &[0x2B, 0x0E, 1, 0],
        &[0x2B, 0x0E, 1, 0, 0],
        &[0x2B, 0x0E, 0, 0],
        &[0x2B, 0x0E, 4, 7],
        &[0x2B, 0x0D],
        &[0x2B, 0x0D, 1, 0],
    ] {
        assert_eq!(unit.refused(request), 1, "{request:02X?}");
    }
}
