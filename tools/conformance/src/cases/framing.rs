//! RTU framing, as far as every endpoint can test it.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::cases::dispatch::with_data;
use crate::frame::{Reply, rtu};
use crate::tester::{Tester, apart};

const N: &[Need] = &[Need::Rtu];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("framing/bad-crc", "V1.02 2.5.1.2", "a frame with a wrong bit anywhere gets silence", N, bad_crc),
    case("framing/swapped-crc", "V1.02 2.5.1.2", "a CRC with its bytes exchanged gets silence", N, swapped_crc),
    case("framing/unknown-function-bad-crc", "V1.02 2.5.1.2",
        "an unknown function with a wrong CRC gets silence, not exception 01", N, unknown_bad_crc),
    case("framing/bad-crc-writes-nothing", "V1.02 2.5.1.2", "a write with a wrong CRC is not done",
        &[Need::Rtu, Need::Bits, Need::Function(1), Need::Function(5)], bad_crc_write),
    case("framing/short-noise", "V1.02 2.5.1.1", "1 to 3 bytes get silence, with a CRC of nothing too", N,
        short_noise),
    case("framing/longest", "V1.02 2.5.1", "a frame of 256 bytes is processed", N, longest),
    case("framing/too-long", "V1.02 2.5.1", "frames of 257 bytes and more are dropped up to the next silence", N,
        too_long),
    case("framing/good-request-at-the-end-of-noise", "V1.02 2.5.1.1",
        "a good request that follows other bytes without a silence is part of their frame", N, joined),
    case("framing/truncated", "V1.02 2.5.1.1", "a request cut anywhere gets silence and is forgotten", N, truncated),
    case("framing/two-at-once", "V1.02 2.5.1.1", "two requests without a silence between them are both lost", N,
        two_at_once),
    case("framing/no-byte-around-the-reply", "V1.02 2.5.1",
        "the unit sends nothing before the reply and nothing after it", N, nothing_else),
    case("framing/trailing-byte", "V1.02 2.5.1.1",
        "a byte after a good frame, without a silence, belongs to it and is never ignored", N, trailing),
];

/// Returns the bits to invert, one at a time: all bits where time is exact, elsewhere every ninth.
fn bits(tester: &Tester<'_>, frame: &[u8]) -> Vec<usize> {
    let step = tester.exact(1, 9);
    (0..frame.len() * 8).step_by(step).collect()
}

fn bad_crc(tester: &mut Tester<'_>) -> Check {
    let good = tester.ping();
    for bit in bits(tester, &good) {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        tester.silence_to(&bad, format!("bit {bit} is wrong"))?;
    }
    tester.alive("frames with a wrong CRC")
}

fn swapped_crc(tester: &mut Tester<'_>) -> Check {
    let mut bad = tester.ping();
    let length = bad.len();
    bad.swap(length - 1, length - 2);
    tester.silence_to(&bad, "the CRC's bytes are exchanged")?;
    tester.alive("a frame with a wrong CRC")
}

fn unknown_bad_crc(tester: &mut Tester<'_>) -> Check {
    for function in [0x66, 0x41, 0x00, 0x80] {
        let mut bad = tester.frame(&[function, 0, 0, 0, 1]);
        bad[6] ^= 0x10;
        tester.silence_to(&bad, "the CRC is wrong")?;
    }
    tester.alive("a frame with a wrong CRC")
}

fn bad_crc_write(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    let [high, low] = span.first.to_be_bytes();
    for unit in [tester.unit(), 0] {
        for bit in 0..16 {
            let mut bad = rtu(&[unit, 5, high, low, 0xFF, 0]);
            bad[6 + bit / 8] ^= 1 << (bit % 8);
            tester.silence_to(&bad, "the CRC is wrong")?;
        }
    }
    tester.is_off(span)
}

fn short_noise(tester: &mut Tester<'_>) -> Check {
    let unit = tester.unit();
    for noise in [
        &[0x00][..],
        &[0xFF],
        &[unit],
        &[unit, 3],
        &[0, 0],
        &[0xFF, 0xFF],
        &[unit, 1, 0],
        &[0xFF, 0xFF, 0xFF],
        &rtu(&[unit]),
        &rtu(&[]),
    ] {
        tester.silence_to(noise, "too short for a frame")?;
        tester.alive("short noise")?;
    }
    Ok(())
}

fn longest(tester: &mut Tester<'_>) -> Check {
    for length in [255, 256] {
        let (function, frame) = with_data(tester, length - 4);
        let right = tester.raw_due(&frame)?.exception(function) == Some(1);
        let wanted = format!("exception 01: a frame of {length} bytes is valid");
        tester.ensure(right, wanted)?;
    }
    Ok(())
}

fn too_long(tester: &mut Tester<'_>) -> Check {
    for length in [257, 258, 259, 300, 512, 513, 1000] {
        let (_, frame) = with_data(tester, length - 4);
        tester.silence_to(&frame, format!("{length} bytes are too long for a frame"))?;
        tester.alive(format!("{length} bytes"))?;
    }
    Ok(())
}

fn joined(tester: &mut Tester<'_>) -> Check {
    let ping = tester.ping();
    for length in [1, 2, 7, 248, 249, 256, 257, 300, 512] {
        let bytes = [vec![0x33; length], ping.clone()].concat();
        let why = format!("the request follows {length} bytes without a silence");
        tester.silence_to(&bytes, why)?;
        tester.alive(format!("{length} bytes and a request"))?;
    }
    Ok(())
}

fn truncated(tester: &mut Tester<'_>) -> Check {
    let ping = tester.ping();
    for length in 1..ping.len() {
        tester.silence_to(&ping[..length], "the request is cut")?;
        tester.alive("a truncated request")?;
    }
    // The second half of a request must not complete the first half.
    let half = ping.len() / 2;
    let gap = tester.endpoint.line().t35_limits().most * 2 + Duration::from_millis(20);
    let pieces = apart(&ping[..half], gap, &ping[half..]);
    let why = "a silence in the middle makes two frames of the request";
    tester.silence(&pieces, why)?;
    tester.alive("two halves")
}

fn two_at_once(tester: &mut Tester<'_>) -> Check {
    let ping = tester.ping();
    tester.silence_to(&ping.repeat(2), "they are one frame, with a wrong CRC")?;
    let other = tester
        .target
        .mode
        .frame(tester.other(), &tester.target.ping);
    tester.silence_to(&[other, ping].concat(), "they are one frame")?;
    tester.alive("joined requests")
}

fn nothing_else(tester: &mut Tester<'_>) -> Check {
    let ping = tester.target.ping.clone();
    // A read of one bit, of one register, or an echo.
    let length = match ping[0] {
        1 | 2 => 3,
        3 | 4 => 4,
        _ => ping.len(),
    };
    for _ in 0..10 {
        // A wrong CRC shows any other additional byte, but a 00 after the CRC keeps the CRC right.
        let reply = tester.reply(&ping)?;
        let wanted = format!("a PDU of {length} bytes and no byte after its CRC");
        tester.ensure(reply.len() == length, wanted)?;
        let late = tester.listen_until(usize::MAX)?;
        tester.ensure(late == Reply::Silence, "silence after the reply")?;
    }
    Ok(())
}

fn trailing(tester: &mut Tester<'_>) -> Check {
    for byte in [0xFF, 0x55, 0x01] {
        let frame = [tester.ping(), vec![byte]].concat();
        tester.silence_to(&frame, "a byte too many")?;
        tester.alive("a byte too many")?;
    }
    // The CRC over a frame and its CRC is 0, and remains 0 with a 00 after it. So the frame is good, but its PDU is one
    // byte too long.
    let frame = [tester.ping(), vec![0]].concat();
    let function = tester.target.ping[0];
    let reply = tester.raw(&frame)?;
    let right = reply == Reply::Silence || reply.exception(function) == Some(3);
    tester.ensure(right, "silence, or exception 03 for a PDU a byte too long")?;
    tester.alive("a 00 too many")
}
