//! ASCII mode (V1.02 2.5.2): valid and damaged frames. Everything above the framing is the same as in RTU mode; the
//! property tests run in both modes.

mod common;

use common::{Points, UNIT, Unit, ascii_frame, pdu, port};
use modbus_server::line::{Faults, Framing, Port, Receiver, Width};

fn unit() -> Unit {
    Unit::ascii(Width::Eight, Points::new(0x100, 0x100))
}

/// A read of one word.
fn request() -> Vec<u8> {
    ascii_frame(UNIT, &pdu(0x03, &[0, 1]), b'\n')
}

/// Sends characters that must be ignored and counted as one error, at the latest with the next frame.
fn is_an_error(unit: &mut Unit, characters: &[u8]) {
    let before = unit.counters().communication_errors;
    assert_eq!(unit.raw(characters), None, "{characters:02X?}");
    unit.must_answer();
    assert_eq!(
        unit.counters().communication_errors,
        before + 1,
        "{characters:02X?}"
    );
}

#[test]
fn an_ascii_request_gets_an_ascii_reply() {
    let mut unit = unit();
    unit.points.words[0x6B..0x6E].copy_from_slice(&[0x022B, 0x0000, 0x0063]);
    // The example of the first protocol description, here for unit 17: read 3 words from 006B.
    let reply = unit.raw(b":1103006B00037E\r\n");
    assert_eq!(reply.as_deref(), Some(&b":110306022B0000006356\r\n"[..]));
    // A rejected request: 11 + 83 + 03 = 97, and 69 makes it 100.
    let reply = unit.raw(b":110300000000EC\r\n");
    assert_eq!(reply.as_deref(), Some(&b":11830369\r\n"[..]));
}

#[test]
fn small_letters_and_other_characters_damage_a_frame() {
    let good = request();
    for at in 1..good.len() - 2 {
        for character in (0..=255_u8).filter(|c| !c.is_ascii_hexdigit() || c.is_ascii_lowercase()) {
            if character == b':' || character == b'\r' {
                continue;
            }
            let mut bad = good.clone();
            bad[at] = character;
            let mut unit = unit();
            assert_eq!(unit.raw(&bad), None);
            assert_eq!(unit.counters().communication_errors, 1, "{character:02X}");
            assert_eq!(unit.raw(&good).map(|reply| reply.len()), Some(15));
        }
    }
}

#[test]
fn a_frame_with_a_wrong_lrc_gets_silence() {
    let mut unit = unit();
    let good = request();
    for at in 1..good.len() - 2 {
        for digit in b"0123456789ABCDEF" {
            if good[at] != *digit {
                let mut bad = good.clone();
                bad[at] = *digit;
                is_an_error(&mut unit, &bad);
            }
        }
    }
}

#[test]
fn a_colon_inside_a_frame_starts_a_new_frame() {
    for at in 1..request().len() {
        let mut unit = unit();
        let joined = [&request()[..at], &request()].concat();
        assert!(unit.raw(&joined).is_some(), "{at}");
        let counters = unit.counters();
        assert_eq!(
            (counters.communication_errors, counters.unit_messages),
            (1, 1)
        );
    }
}

#[test]
fn characters_before_a_colon_are_ignored() {
    let mut unit = unit();
    for noise in [
        &b"0123456789"[..],
        b"\r\n\r\n",
        &[0x00, 0xFF, 0x3B],
        b"11030000",
    ] {
        assert!(unit.raw(&[noise, &request()].concat()).is_some());
    }
    assert_eq!(unit.counters().communication_errors, 0);
}

#[test]
fn at_power_up_no_silence_is_needed() {
    // Even after the second half of another frame the next colon starts a frame.
    let mut unit = unit();
    unit.characters(&request()[7..]);
    assert!(unit.raw(&request()).is_some());
}

#[test]
fn half_bytes_and_too_few_or_too_many_of_them_are_errors() {
    let mut unit = unit();
    is_an_error(&mut unit, b":\r\n");
    is_an_error(&mut unit, b":1\r\n");
    is_an_error(&mut unit, b":00\r\n");
    is_an_error(&mut unit, b":11EF\r\n");
    is_an_error(&mut unit, b":110300000001E\r\n");
    assert_eq!(unit.raw(b":1107E8\r\n"), Some(b":11076D7B\r\n".to_vec()));
    for len in [254, 255, 256, 300, 1000] {
        let pdu = [&[0x63][..], &vec![0; len - 1]].concat();
        is_an_error(&mut unit, &ascii_frame(UNIT, &pdu, b'\n'));
    }
    let longest = [&[0x63][..], &[0; 252]].concat();
    let frame = ascii_frame(UNIT, &longest, b'\n');
    assert_eq!(frame.len(), 513);
    assert_eq!(unit.raw(&frame), Some(b":11E3010B\r\n".to_vec()));
}

#[test]
fn a_second_of_silence_inside_a_frame_damages_it() {
    for len in 1..request().len() {
        let mut unit = unit();
        assert_eq!(unit.raw(&request()[..len]), None);
        assert_eq!(unit.counters().communication_errors, 1);
        assert_eq!(
            unit.raw(&request()[len..]),
            None,
            "the rest of the frame has no start"
        );
        assert_eq!(unit.counters().communication_errors, 1);
        unit.must_answer();
    }
}

#[test]
fn short_silences_are_ignored() {
    let mut unit = unit();
    for character in request() {
        unit.pause();
        unit.character(character, Faults::NONE);
    }
    assert!(unit.silence().is_some());
    assert_eq!(unit.counters().gaps, 0);
}

#[test]
fn a_faulty_character_anywhere_damages_its_frame() {
    for at in 0..request().len() {
        let mut unit = unit();
        for (index, character) in request().into_iter().enumerate() {
            let faults = match index == at {
                true => Faults::PARITY | Faults::OVERRUN,
                false => Faults::NONE,
            };
            unit.character(character, faults);
        }
        assert_eq!(unit.silence(), None);
        let counters = unit.counters();
        assert_eq!((counters.communication_errors, counters.overruns), (1, 1));
        unit.must_answer();
    }
}

#[test]
fn noise_flag_alone_does_not_damage_a_frame_with_a_valid_lrc() {
    for width in [Width::Seven, Width::Eight] {
        for at in 0..=request().len() {
            let mut unit = Unit::ascii(width, Points::new(4, 4));
            for (index, character) in request().into_iter().enumerate() {
                // In the last round every character has the noise flag.
                let noisy = index == at || at == request().len();
                let faults = if noisy { Faults::NOISE } else { Faults::NONE };
                unit.character(character, faults);
            }
            assert!(unit.silence().is_some(), "noise at {at}");
            let words = unit.counters().as_words();
            assert_eq!(words, [1, 0, 0, 1, 0, 0, 0, 0, 0], "noise at {at}");
        }
    }
}

#[test]
fn colon_with_noise_flag_inside_a_frame_starts_a_frame() {
    let mut unit = unit();
    unit.characters(&request()[..7]);
    unit.character(b':', Faults::NOISE);
    assert!(unit.raw(&request()[1..]).is_some());
    assert_eq!(unit.counters().communication_errors, 1);
}

#[test]
fn with_seven_data_bits_the_highest_bit_is_ignored() {
    let with_parity = |characters: Vec<u8>| -> Vec<u8> {
        let even = |c: u8| c | (c.count_ones() as u8 & 1) << 7;
        characters.into_iter().map(even).collect()
    };
    let mut seven = Unit::ascii(Width::Seven, Points::new(4, 4));
    let reply = seven.raw(&with_parity(request())).expect("a reply");
    assert!(reply.is_ascii(), "the UART adds the parity bit");
    assert_eq!(unit().raw(&with_parity(request())), None);
}

#[test]
fn low_stop_bit_in_the_highest_bit_damages_a_frame() {
    let with_stop = |characters: Vec<u8>| -> Vec<u8> {
        let set = |c: u8| c | 0x80;
        characters.into_iter().map(set).collect()
    };
    let good = with_stop(request());
    for at in 0..good.len() {
        let mut unit = Unit::ascii(Width::SevenAndStop, Points::new(4, 4));
        let mut bad = good.clone();
        bad[at] &= 0x7F;
        assert_eq!(unit.raw(&bad), None, "character {at}");
        assert_eq!(unit.counters().communication_errors, 1, "character {at}");
        assert!(unit.raw(&good).is_some(), "after character {at}");
    }
}

#[test]
fn the_delimiter_can_be_changed() {
    let mut unit = unit();
    let change = [0x08, 0x00, 0x03, b'#', 0x00];
    let reply = unit.raw(&ascii_frame(UNIT, &change, b'\n'));
    assert_eq!(
        reply,
        Some(ascii_frame(UNIT, &change, b'\n')),
        "the reply still has the old delimiter"
    );
    assert_eq!(unit.server.framing(), Framing::Ascii { delimiter: b'#' });
    unit.must_answer();
    assert_eq!(
        unit.raw(&request()),
        None,
        "a line feed no longer ends a frame"
    );
    unit.must_answer();

    for (character, low) in [
        (b':', 0),
        (b'\r', 0),
        (b'7', 0),
        (b'C', 0),
        (0x80, 0),
        (b'!', 1),
    ] {
        assert_eq!(unit.refused(&[0x08, 0x00, 0x03, character, low]), 3);
    }
    assert_eq!(unit.refused(&[0x08, 0x00, 0x03, b'!']), 3);

    // A restart sets the delimiter back to line feed, after its own reply.
    let restart = [0x08, 0x00, 0x01, 0x00, 0x00];
    let reply = unit.raw(&ascii_frame(UNIT, &restart, b'#'));
    assert_eq!(reply, Some(ascii_frame(UNIT, &restart, b'#')));
    assert!(unit.raw(&request()).is_some());
}

/// Returns a port whose ASCII line has received these characters and is not silent yet.
fn busy(characters: &[u8]) -> Port<'static> {
    let mut port = port(Receiver::ascii(UNIT, Width::Eight));
    receive(&mut port, characters);
    port
}

fn receive(port: &mut Port<'_>, characters: &[u8]) {
    for character in characters {
        port.received(*character, Faults::NONE);
    }
}

#[test]
fn a_complete_frame_that_was_not_taken_is_lost_only_at_the_next_colon() {
    let mut port = busy(&request());
    receive(&mut port, b"\n\r\x001");
    port.received(0, Faults::FRAMING);
    assert!(port.short_silence(0));
    receive(&mut port, b":0103");
    assert!(!port.short_silence(0) && !port.long_silence(0));
    // The colon of the next frame drops the request, and no buffer is lost.
    for _ in 0..5 {
        receive(&mut port, &request());
    }
    assert!(port.short_silence(0));
    assert_eq!(port.counters().dropped, 5);
}

#[test]
fn valid_frame_dropped_by_the_next_colon_is_counted_as_unanswered() {
    let good = [(UNIT, [1, 1]), (0, [1, 1]), (UNIT + 1, [1, 0])];
    for (to, expected) in good {
        // The frame is complete with CR LF, but the next one begins before the line is free for a reply.
        let mut port = busy(&ascii_frame(to, &pdu(0x06, &[0, 7]), b'\n'));
        receive(&mut port, b":");
        assert!(!port.long_silence(0));
        assert_eq!(port.waiting(), None);
        let counters = port.counters();
        // The frame of the second colon, which the time-out ended.
        assert_eq!(counters.communication_errors, 1);
        let counted = [counters.bus_messages, counters.dropped];
        assert_eq!(counted, expected, "to {to}");
    }
}
