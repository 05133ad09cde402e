//! Damaged characters, breaks and glitches.

use std::time::Duration;

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;

const N: &[Need] = &[Need::Rtu, Need::Faults];

pub(super) const CASES: &[Case] = &[
    case(
        "damage/framing-error",
        "V1.02 2.5.1.1",
        "a character with a low stop bit spoils its frame, and that one only",
        N,
        framing_error,
    ),
    case(
        "damage/parity-error",
        "V1.02 2.5.1",
        "a character with wrong parity spoils its frame, and that one only",
        &[Need::Rtu, Need::Faults, Need::Parity],
        parity_error,
    ),
    case(
        "damage/parity-error-broadcast",
        "V1.02 2.5.1",
        "a broadcast write with a damaged character is not done",
        &[
            Need::Rtu,
            Need::Faults,
            Need::Bits,
            Need::Function(1),
            Need::Function(5),
        ],
        damaged_write,
    ),
    case(
        "damage/break",
        "V1.02 2.5.1.1",
        "a break costs no later request",
        N,
        line_break,
    ),
    case(
        "damage/glitch",
        "V1.02 2.5.1.1",
        "short glitches on the idle line cost no later request",
        N,
        glitch,
    )
    .interpretation(),
];

fn one_by_one(bench: &mut Bench<'_>, damaged: fn(u8) -> Piece) -> Check {
    let frame = bench.ping();
    for index in 0..frame.len() {
        let pieces = [
            Piece::Bytes(frame[..index].to_vec()),
            damaged(frame[index]),
            Piece::Bytes(frame[index + 1..].to_vec()),
        ];
        bench.silence(&pieces, "a damaged character spoils its frame")?;
        bench.alive("a damaged character")?;
    }
    Ok(())
}

fn framing_error(bench: &mut Bench<'_>) -> Check {
    one_by_one(bench, Piece::BadStop)
}

fn parity_error(bench: &mut Bench<'_>) -> Check {
    one_by_one(bench, Piece::BadParity)
}

fn damaged_write(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(1);
    bench.set_bits(span.first, &[false])?;
    let [high, low] = span.first.to_be_bytes();
    let frame = bench.target.mode.frame(0, &[5, high, low, 0xFF, 0]);
    for index in 0..frame.len() {
        let pieces = [
            Piece::Bytes(frame[..index].to_vec()),
            Piece::BadStop(frame[index]),
            Piece::Bytes(frame[index + 1..].to_vec()),
        ];
        bench.silence(&pieces, "a broadcast")?;
    }
    let now = bench.read_bits(span)?;
    bench.ensure(now == [false], "the coil is still off")
}

fn line_break(bench: &mut Bench<'_>) -> Check {
    for bits in [10, 12, 15] {
        bench.silence(&[Piece::Break(bits)], "a break is no request")?;
        bench.alive("a break")?;
    }
    bench.silence(
        &[Piece::Break(15), Piece::Break(15), Piece::Break(15)],
        "breaks",
    )?;
    bench.alive("breaks")
}

fn glitch(bench: &mut Bench<'_>) -> Check {
    let bit = bench.endpoint.line().bits(1);
    let apart = Piece::Gap(bench.endpoint.line().t35_limits().most * 2 + bit * 12);
    for width in [Duration::from_micros(1), bit / 20, bit / 4, bit * 2 / 5] {
        let width = width.max(Duration::from_nanos(100));
        let ping = Piece::Bytes(bench.ping());
        let reply = bench.exchange(&[Piece::Glitch(width), apart.clone(), ping])?;
        bench.ensure(
            bench.is_pong(&reply),
            format!("a reply after a glitch of {width:?}"),
        )?;
    }
    Ok(())
}
