//! Silences inside frames and between them, to the microsecond.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::frame::Reply;
use crate::tester::{Tester, apart};

const N: &[Need] = &[Need::Rtu, Need::Exact];
const B: &[Need] = &[Need::Rtu, Need::Exact, Need::StartBit];
const S: &str = "V1.02 2.5.1.1";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("gaps/below-t1.5", S, "gaps up to t1.5 inside a frame are no harm", N, below_t15),
    case("gaps/t1.5-to-t3.5", S,
        "a gap between t1.5 and t3.5 drops the frame, or not, as STRICT_T15 says: always alike", N,
        between).interpretation(),
    case("gaps/just-below-t3.5", S,
        "a gap that is a few bits below t3.5 is treated as any other between t1.5 and t3.5", B,
        just_below_t35).interpretation(),
    case("gaps/above-t3.5", S, "a gap above t3.5 ends the frame: neither half is one", N, above_t35),
    case("gaps/too-soon", S, "a request less than t3.5 after another joins it, and both are lost", N,
        too_soon).interpretation(),
    case("gaps/a-bit-too-soon", S, "a request a few bits less than t3.5 after another joins it, and both are lost", B,
        a_bit_too_soon).interpretation(),
    case("gaps/t3.5-is-enough", S, "a request t3.5 after another unit's is answered", N, soon_enough),
    case("gaps/after-noise", S, "noise, t3.5 of silence, and a request is answered", N, after_noise),
];

/// Distance of a gap from its limit: 3 bits, but at least 20 us.
fn margin(tester: &Tester<'_>) -> Duration {
    let line = tester.endpoint.line();
    // A receiver may count the stop bits as silence, and needs one bit to detect a start bit.
    line.bits(3).max(Duration::from_micros(20))
}

/// Returns the request with a gap before the byte at `index`.
fn with_gap(tester: &mut Tester<'_>, index: usize, gap: Duration) -> Check<Reply> {
    let frame = tester.ping();
    let (first, rest) = frame.split_at(index);
    tester.exchange(&apart(first, gap, rest))
}

fn places(tester: &Tester<'_>) -> [usize; 4] {
    let length = tester.ping().len();
    [1, 2, length / 2, length - 1]
}

fn below_t15(tester: &mut Tester<'_>) -> Check {
    let t15 = tester.endpoint.line().t15_limits().least;
    for index in places(tester) {
        for gap in [t15 / 4, t15 / 2, t15 - margin(tester)] {
            let reply = with_gap(tester, index, gap)?;
            let wanted = format!("a reply: a gap of {gap:?} is below t1.5, {t15:?}");
            tester.ensure(tester.is_pong(&reply), wanted)?;
        }
    }
    // A gap after every byte.
    let mut pieces = Vec::new();
    for byte in tester.ping() {
        pieces.extend([Piece::Bytes(vec![byte]), Piece::Gap(t15 / 2)]);
    }
    pieces.pop();
    tester.answers(&pieces, "a reply: all gaps are below t1.5")
}

/// Returns a gap between t1.5 and t3.5 that ends more than a character below t3.5, at any rate and format.
fn middle(tester: &Tester<'_>) -> Duration {
    let line = tester.endpoint.line();
    let (above, below) = (line.t15_limits().most, line.t35_limits().least);
    above + (below - above) / 3
}

fn between(tester: &mut Tester<'_>) -> Check {
    let low = tester.endpoint.line().t15_limits().most + margin(tester);
    kept_or_dropped(tester, &[low, middle(tester)])
}

fn just_below_t35(tester: &mut Tester<'_>) -> Check {
    let high = tester.endpoint.line().t35_limits().least - margin(tester);
    kept_or_dropped(tester, &[middle(tester), high])
}

/// Sends frames with these gaps between t1.5 and t3.5. The unit must keep all of them or drop all of them.
fn kept_or_dropped(tester: &mut Tester<'_>, gaps: &[Duration]) -> Check {
    let mut dropped = tester.target.strict_t15;
    for index in places(tester) {
        for &gap in gaps {
            let reply = with_gap(tester, index, gap)?;
            let answered = tester.is_pong(&reply);
            let right = answered || reply == Reply::Silence;
            tester.ensure(right, "a reply or silence")?;
            let strict = *dropped.get_or_insert(!answered);
            let wanted = if strict {
                "silence: frames with a gap above t1.5 are dropped"
            } else {
                "a reply: frames with a gap above t1.5 are kept"
            };
            tester.ensure(strict != answered, format!("{wanted}; the gap is {gap:?}"))?;
        }
    }
    tester.alive("frames with gaps")
}

fn above_t35(tester: &mut Tester<'_>) -> Check {
    let t35 = tester.endpoint.line().t35_limits().most;
    for index in places(tester) {
        for gap in [t35 + margin(tester), t35 * 2, t35 * 10] {
            let reply = with_gap(tester, index, gap)?;
            let wanted = format!("silence: a gap of {gap:?} is above t3.5, {t35:?}");
            tester.ensure(reply == Reply::Silence, wanted)?;
        }
    }
    tester.alive("frames with gaps")
}

fn too_soon(tester: &mut Tester<'_>) -> Check {
    let t35 = tester.endpoint.line().t35_limits().least;
    joined_after(tester, &[t35 / 4, t35 / 2])
}

fn a_bit_too_soon(tester: &mut Tester<'_>) -> Check {
    let gap = tester.endpoint.line().t35_limits().least - margin(tester);
    joined_after(tester, &[gap])
}

/// Sends requests after these gaps. Each request must be joined with the one before it.
fn joined_after(tester: &mut Tester<'_>, gaps: &[Duration]) -> Check {
    let mine = tester.ping();
    let others = tester
        .target
        .mode
        .frame(tester.other(), &tester.target.ping);
    for first in [mine.clone(), others] {
        for &gap in gaps {
            let pieces = apart(&first, gap, &mine);
            tester.silence(&pieces, format!("{gap:?} is less than t3.5"))?;
            tester.alive("joined requests")?;
        }
    }
    Ok(())
}

fn soon_enough(tester: &mut Tester<'_>) -> Check {
    let t35 = tester.endpoint.line().t35_limits().most;
    let mine = tester.ping();
    let others = tester
        .target
        .mode
        .frame(tester.other(), &tester.target.ping);
    for gap in [t35 + margin(tester), t35 * 2] {
        let wanted = format!("a reply: {gap:?} is above t3.5");
        tester.answers(&apart(&others, gap, &mine), wanted)?;
    }
    Ok(())
}

fn after_noise(tester: &mut Tester<'_>) -> Check {
    let gap = tester.endpoint.line().t35_limits().most + margin(tester);
    let mine = tester.ping();
    for length in [1, 2, 3, 8, 100, 255, 256, 257, 600] {
        let noise = vec![0xA7; length];
        let wanted = format!("a reply, {gap:?} after {length} bytes of noise");
        tester.answers(&apart(&noise, gap, &mine), wanted)?;
    }
    Ok(())
}
