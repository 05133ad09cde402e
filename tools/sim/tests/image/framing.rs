//! Frames that are damaged, cut short, joined, or addressed to other units.

use register_map::configuration::FORMAT;
use sim::{
    Config, Module, Time,
    line::{Character, Settings},
};

use crate::bench::{Bench, FIRST, adu, flash_with};

const READ: [u8; 6] = [1, 1, 0, FIRST, 0, 4];

/// Sends `bytes` with a silence in front of the byte at `index`. Returns the bytes of the reply.
fn with_gap(bench: &mut Bench, bytes: &[u8], index: usize, gap: Time) -> Vec<u8> {
    let (first, rest) = bytes.split_at(index);
    let now = bench.board.now();
    let end = bench.board.line().send(now, first);
    let end = bench.board.line().send(end + gap, rest);
    bench.answer_after(end)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn frame_with_a_wrong_crc_gets_no_reply() {
    let mut bench = Bench::new(Module::Di4, 1);
    let good = adu(&READ);
    for bit in 0..good.len() * 8 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(bench.exchange(&bad), [], "bit {bit}");
    }
    let mut swapped = good.clone();
    swapped.swap(6, 7);
    assert_eq!(bench.exchange(&swapped), []);
    let mut unknown = adu(&[1, 0x55, 0, 0]);
    unknown[4] ^= 0x40;
    assert_eq!(
        bench.exchange(&unknown),
        [],
        "a wrong function and a wrong CRC"
    );
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn short_noise_gets_no_reply() {
    let mut bench = Bench::new(Module::Di4, 1);
    for length in 1..=3 {
        for byte in [0x00, 0x01, 0xFF] {
            assert_eq!(bench.exchange(&vec![byte; length]), []);
            bench.assert_answers(1);
        }
    }
    // A unit address with a valid CRC, but no PDU between them.
    assert_eq!(bench.exchange(&adu(&[1])), []);
    assert_eq!(bench.exchange(&adu(&[])), []);
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn frame_of_256_bytes_is_accepted_and_a_longer_one_is_discarded_completely() {
    let mut bench = Bench::new(Module::Di4, 1);
    let longest = adu(&[&[1, 0x41][..], &[0x33; 252]].concat());
    assert_eq!(longest.len(), 256);
    assert_eq!(bench.exchange(&longest), adu(&[1, 0xC1, 1]));
    for length in [257, 258, 300, 512, 1000] {
        let long = adu(&[&[1, 0x41][..], &vec![0x33; length - 4]].concat());
        assert_eq!(long.len(), length);
        assert_eq!(bench.exchange(&long), [], "{length} bytes");
        bench.assert_answers(1);
    }
    // 300 bytes directly in front of a valid request, without a gap: 44 more than a frame may have.
    let joined = [&[0x33; 300][..], &adu(&READ)].concat();
    assert_eq!(bench.exchange(&joined), []);
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn gaps_inside_a_frame_are_accepted_up_to_t35_and_split_it_beyond() {
    let mut bench = Bench::new(Module::Di4, 1);
    let request = adu(&READ);
    let reply = adu(&[1, 1, 1, 0]);
    let character = bench.characters(1);
    for index in [1, 2, 4, 7] {
        for tenths in [1, 5, 10, 14, 16, 20, 25, 27, 30, 33, 34] {
            let gap = Time::from_ps(character.as_ps() * tenths / 10);
            let received = with_gap(&mut bench, &request, index, gap);
            assert_eq!(
                received, reply,
                "{tenths}/10 characters before byte {index}"
            );
        }
        for tenths in [37, 40, 50, 80, 300] {
            let gap = Time::from_ps(character.as_ps() * tenths / 10);
            let received = with_gap(&mut bench, &request, index, gap);
            assert_eq!(received, [], "{tenths}/10 characters before byte {index}");
        }
    }
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_request_too_soon_after_another_joins_it_and_both_are_lost() {
    let mut bench = Bench::new(Module::Di4, 1);
    let two = [adu(&READ), adu(&READ)].concat();
    let gap = bench.characters(3);
    assert_eq!(with_gap(&mut bench, &two, 8, gap), []);
    assert_eq!(with_gap(&mut bench, &two, 8, Time::ZERO), []);
    // The first request is for another unit, the second for this one.
    let other = [adu(&[2, 1, 0, FIRST, 0, 4]), adu(&READ)].concat();
    assert_eq!(with_gap(&mut bench, &other, 8, gap), []);
    // With t3.5 between them the second request is answered.
    let gap = bench.t35() + bench.bit();
    assert_eq!(with_gap(&mut bench, &other, 8, gap), adu(&[1, 1, 1, 0]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn t35_of_8n1_characters_ends_a_frame_for_the_unit_and_the_recording() {
    let mut bench = Bench::set_up(Module::Di4, &[(FORMAT, 3)]);
    let other = adu(&[2, 1, 0, FIRST, 0, 4]);
    let two = [other.clone(), adu(&READ)].concat();
    // 36 bits: more than 3.5 characters of 10 bits, less than 3.5 of 11.
    let gap = bench.bit() * 36;
    let before = bench.board.line().frames().count();
    assert_eq!(with_gap(&mut bench, &two, 8, gap), adu(&[1, 1, 1, 0]));
    let line = bench.board.line();
    let frames: Vec<_> = line
        .frames()
        .skip(before)
        .map(|f| f.bytes.clone())
        .collect();
    assert_eq!(frames, [other, adu(&READ), adu(&[1, 1, 1, 0])]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn request_directly_after_the_units_reply_is_answered() {
    let mut bench = Bench::new(Module::Di4, 1);
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&READ));
    bench
        .board
        .run_until(end + bench.t35() + bench.characters(1));
    while bench.board.driver_enable() {
        bench.board.run_for(Time::from_us(10));
    }
    // The next request begins two bits after the reply's last stop bit.
    let start = bench.board.now() + bench.bit() * 2;
    let end = bench.board.line().send(start, &adu(&READ));
    let received = bench.answer_after(end);
    let reply = adu(&[1, 1, 1, 0]);
    assert_eq!(received, [reply.clone(), reply].concat());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn character_with_a_framing_error_invalidates_its_frame() {
    let mut bench = Bench::new(Module::Di4, 1);
    let request = adu(&READ);
    for index in 0..request.len() {
        let now = bench.board.now();
        let line = bench.board.line();
        let mut end = line.send(now, &request[..index]);
        // The stop bits are low: a framing error, but the data bits are right.
        let mut character = Character::new(Settings::default(), request[index]);
        character.levels &= (1 << 9) - 1;
        character.levels |= 1 << 10;
        end = line.send_character(end, character);
        end = line.send(end, &request[index + 1..]);
        assert_eq!(bench.answer_after(end), [], "byte {index}");
        bench.assert_answers(1);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn break_or_stray_zero_invalidates_at_most_one_frame() {
    let mut bench = Bench::new(Module::Di4, 1);
    let now = bench.board.now();
    let long = Character::line_break(Settings::default().rate(), 15);
    let end = bench.board.line().send_character(now, long);
    assert_eq!(bench.answer_after(end), []);
    bench.assert_answers(1);
    let stray = [&[0][..], &adu(&READ)].concat();
    assert_eq!(bench.exchange(&stray), []);
    bench.assert_answers(1);
    // With enough distance, a break has no effect on the next request.
    let gap = bench.characters(5);
    assert_eq!(with_gap(&mut bench, &stray, 1, gap), adu(&[1, 1, 1, 0]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn traffic_of_other_units_gets_no_reply_and_own_requests_do() {
    let mut bench = Bench::new(Module::Di4, 1);
    let others: [&[u8]; 6] = [
        &adu(&[2, 3, 0, 0, 0, 2]),
        &adu(&[2, 3, 4, 1, 1, 0, FIRST]),
        &adu(&[2, 0x83, 2]),
        &adu(&[17, 0x41, 9, 9]),
        &[2, 3, 4, 1],
        &[2],
    ];
    for round in 0..30 {
        for other in others {
            assert_eq!(bench.exchange(other), []);
        }
        let other = others[round % others.len()];
        let now = bench.board.now();
        let end = bench.board.line().send(now, other);
        let gap = bench.t35() + bench.bit();
        let end = bench.board.line().send(end + gap, &adu(&READ));
        assert_eq!(
            bench.answer_after(end),
            adu(&[1, 1, 1, 0]),
            "after {other:02X?}"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_that_starts_during_traffic_waits_for_a_silence() {
    let mut bench = Bench::cold(Config {
        flash: Some(flash_with(Module::Di4)),
        ..Config::default()
    });
    // The traffic begins before the start, lasts well beyond it, and ends with bytes that look like a valid request.
    let traffic = [vec![0x55; 300], adu(&READ)].concat();
    let end = bench.board.line().send(Time::from_us(1), &traffic);
    assert!(end > Time::from_ms(300));
    assert_eq!(bench.answer_after(end), []);
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn truncated_request_is_discarded() {
    let mut bench = Bench::new(Module::Di4, 1);
    let request = adu(&READ);
    for length in 1..request.len() {
        assert_eq!(bench.exchange(&request[..length]), []);
        bench.assert_answers(1);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn echo_of_a_reply_is_not_treated_as_a_request() {
    let mut bench = Bench::new(Module::Do4, 1);
    bench.board.line().set_echo(true);
    // The reply to a write equals the request. If the unit took its echo for a request, it would answer without end.
    let request = adu(&[1, 5, 0, FIRST, 0xFF, 0]);
    for _ in 0..20 {
        assert_eq!(bench.exchange(&request), request);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn idle_line_glitches_do_not_disturb_the_next_request() {
    let mut bench = Bench::new(Module::Di4, 1);
    for us in [1, 5, 20, 40] {
        let now = bench.board.now();
        bench.board.line().noise(now, Time::from_us(us));
        let end = bench
            .board
            .line()
            .send(now + Time::from_ms(10), &adu(&READ));
        assert_eq!(bench.answer_after(end), adu(&[1, 1, 1, 0]), "{us} us");
    }
}
