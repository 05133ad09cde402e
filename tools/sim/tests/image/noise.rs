//! Endurance: whatever is on the line, the device answers the next good request, and never answers a
//! damaged one.

use fastrand::Rng;
use sim::{Channel, Module};

use crate::bench::{Bench, adu, crc};

/// Frames of each kind, by the issue this suite belongs to.
const FRAMES: usize = 10_000;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn ten_thousand_random_frames_leave_it_answering() {
    let mut rng = Rng::with_seed(0x6D6F_6469_6F01);
    let mut bench = Bench::new(Module::Do4, 1);
    for number in 0..FRAMES {
        // Mostly short, some up to and beyond the longest there can be.
        let length = match rng.u8(0..20) {
            0 => rng.usize(200..320),
            1..=4 => rng.usize(20..60),
            _ => rng.usize(1..20),
        };
        let mut frame: Vec<u8> = (0..length).map(|_| rng.u8(..)).collect();
        // Half of them begin as if they were for this unit, with a function there is.
        if rng.bool() {
            frame[0] = 1;
            if let Some(function) = frame.get_mut(1) {
                *function = *rng.choice(&[1, 2, 3, 4, 5, 6, 15, 16]).unwrap();
            }
        }
        let split = frame.len().saturating_sub(2);
        let good = frame.len() >= 4 && frame[split..] == crc(&frame[..split]);
        let reply = bench.exchange(&frame);
        assert!(
            good || reply.is_empty(),
            "frame {number} {frame:02X?} got {reply:02X?}"
        );
        if number % 50 == 0 {
            bench.assert_answers(1);
        }
    }
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn ten_thousand_requests_with_bit_errors_are_not_answered_and_do_nothing() {
    let mut rng = Rng::with_seed(0x6D6F_6469_6F02);
    let mut bench = Bench::new(Module::Do4, 1);
    let mut undetectable = 0;
    for number in 0..FRAMES {
        let request = match rng.u8(0..4) {
            0 => adu(&[1, 5, 0, 0x10 + rng.u8(0..4), 0xFF, 0]),
            1 => adu(&[1, 15, 0, 0x10, 0, 4, 1, 0x0F]),
            2 => adu(&[1, 1, 0, 0x10, 0, 4]),
            _ => adu(&[0, 5, 0, 0x10 + rng.u8(0..4), 0xFF, 0]),
        };
        let mut damaged = request.clone();
        for _ in 0..rng.usize(1..=8) {
            let bit = rng.usize(0..damaged.len() * 8);
            damaged[bit / 8] ^= 1 << (bit % 8);
        }
        let (body, check) = damaged.split_at(damaged.len() - 2);
        if check == crc(body) {
            // No error left, or one that CRC-16 cannot see: that is no damaged frame.
            undetectable += 1;
            continue;
        }
        assert_eq!(
            bench.exchange(&damaged),
            [],
            "request {number} {damaged:02X?}"
        );
        if number % 50 == 0 {
            bench.assert_answers(1);
        }
    }
    for channel in 1..=4 {
        assert_eq!(
            bench.board.channel(channel),
            Channel::Do { on: false },
            "a damaged write was done"
        );
    }
    assert!(
        undetectable < FRAMES / 20,
        "{undetectable} were not damaged after all"
    );
    bench.assert_answers(1);
}
