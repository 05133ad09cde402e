//! Silences in and between frames, damaged characters, glitches, and the echo of a reply. Damaged frames, and frames of
//! other units, are cases of the conformance suite.

use register_map::configuration::FORMAT;
use sim::{
    Module, Time,
    line::{Character, Settings},
};

use crate::bench::{Bench, FIRST, adu};

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
