//! A line with other units on it.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::frame::{Reply, rtu};
use crate::points::pdu;
use crate::tester::{Tester, apart};

const N: &[Need] = &[Need::Rtu];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("bus/others-traffic", "V1.02 2.4.1",
        "requests, replies and exceptions of other units make this one neither deaf nor talkative", N,
        others_traffic),
    case("bus/others-truncated-traffic", "V1.02 2.4.1", "nor do truncated and damaged ones", N, others_truncated),
    case("bus/others-long-replies", "V1.02 2.4.1", "nor do replies of every length, up to 255 bytes", N, others_long),
    case("bus/request-right-after-others-reply", "V1.02 2.5.1.1",
        "a request t3.5 after another unit's reply is answered", &[Need::Rtu, Need::Exact], right_after),
    case("bus/others-reply-is-no-request", "V1.02 2.2",
        "a reply that would be a write if it were for this unit is not taken for one",
        &[Need::Rtu, Need::Bits, Need::Function(1)], reply_is_no_request),
    case("bus/stray-zero", "V1.02 2.5.1.1", "a stray 00 before a request costs that request at most", N, stray_zero),
    case("bus/own-echo", "V1.02 3.3", "with DE and RE tied, the unit does not take its own reply for a request",
        &[Need::Rtu, Need::Echo], own_echo).interpretation(),
];

/// Requests to other units, and their replies.
fn traffic(tester: &Tester<'_>) -> Vec<Vec<u8>> {
    let other = tester.other();
    [
        &[other, 1, 0, 0, 0, 8][..],
        &[other, 1, 1, 0x5A],
        &[other, 3, 0, 0, 0, 2],
        &[other, 3, 4, 1, 1, 0, 0x10],
        &[other, 0x83, 2],
        &[other, 5, 0, 0, 0xFF, 0],
        &[other, 6, 0, 1, 0, 3],
        &[other, 0x10, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2],
        &[other, 0x10, 0, 1, 0, 2],
        &[other, 0x41, 9, 9],
        &[other, 0x11],
        &[200, 0x2B, 0x0E, 1, 0],
    ]
    .map(rtu)
    .to_vec()
}

fn others_traffic(tester: &mut Tester<'_>) -> Check {
    for frame in traffic(tester) {
        tester.silence_to(&frame, "the frame is another unit's")?;
        tester.alive("other units' traffic")?;
    }
    for frame in traffic(tester) {
        tester.silence_to(&frame, "the frame is another unit's")?;
    }
    tester.alive("a lot of other units' traffic")
}

fn others_truncated(tester: &mut Tester<'_>) -> Check {
    for frame in traffic(tester) {
        let cuts = [1, 2, 3, frame.len() - 1];
        for cut in cuts.into_iter().filter(|cut| *cut < frame.len()) {
            tester.silence_to(&frame[..cut], "the frame of another unit is cut")?;
        }
        tester.alive("other units' truncated traffic")?;
        let mut bad = frame.clone();
        bad[1] ^= 4;
        tester.silence_to(&bad, "the frame of another unit is damaged")?;
        tester.alive("other units' damaged traffic")?;
    }
    Ok(())
}

fn others_long(tester: &mut Tester<'_>) -> Check {
    let other = tester.other();
    for words in [1, 2, 60, 123, 124, 125] {
        let data = vec![0x5A; usize::from(words) * 2];
        let body = [vec![other, 3, words * 2], data].concat();
        tester.silence_to(&rtu(&body), "the frame is another unit's reply")?;
        tester.alive(format!("another unit's reply of {words} registers"))?;
    }
    Ok(())
}

fn right_after(tester: &mut Tester<'_>) -> Check {
    let line = tester.endpoint.line();
    let gap = line.t35_limits().most + line.bits(3).max(Duration::from_micros(20));
    for frame in traffic(tester) {
        tester.answers(
            &[
                Piece::Bytes(frame.clone()),
                Piece::Gap(gap),
                Piece::Bytes(frame),
                Piece::Gap(gap),
                Piece::Bytes(tester.ping()),
            ],
            format!("a reply, {gap:?} after other traffic"),
        )?;
    }
    Ok(())
}

fn reply_is_no_request(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    let other = tester.other();
    // A write to another unit and its echo, which are the same frame.
    let frame = rtu(&[&[other], &pdu(5, span.first, 0xFF00)[..]].concat());
    // A reply to a read whose data is a good request for this unit, including its CRC.
    let inner = tester.frame(&pdu(5, span.first, 0xFF00));
    let body = [&[other, 3, inner.len() as u8], &inner[..]].concat();
    for frame in [frame.clone(), frame, rtu(&body)] {
        tester.silence_to(&frame, "the frame is another unit's")?;
    }
    tester.is_off(span)
}

fn stray_zero(tester: &mut Tester<'_>) -> Check {
    for stray in [&[0][..], &[0, 0], &[0xFF]] {
        let frame = [stray, &tester.ping()].concat();
        let reply = tester.raw(&frame)?;
        let right = reply == Reply::Silence || tester.is_pong(&reply);
        tester.ensure(right, "silence, or the reply")?;
        tester.alive("a stray byte in front of a request")?;
        let silence = tester.endpoint.line().t35_limits().most * 2;
        let apart = apart(stray, silence, &tester.ping());
        let wanted = "a reply: a silence separates the stray byte from the request";
        tester.answers(&apart, wanted)?;
    }
    Ok(())
}

fn own_echo(tester: &mut Tester<'_>) -> Check {
    tester.endpoint.set_echo(true)?;
    let result = echoed(tester);
    tester.endpoint.set_echo(false)?;
    result?;
    tester.alive("replies that the unit received itself")
}

fn echoed(tester: &mut Tester<'_>) -> Check {
    let ping = tester.target.ping.clone();
    for _ in 0..10 {
        tester.reply(&ping)?;
    }
    // Replies that are equal to their requests. A unit that treats its own reply as a request never stops answering.
    let mut echoes = Vec::new();
    if tester.target.has(8) {
        echoes.push(vec![8, 0, 0, 1, 2]);
    }
    let reads_and_writes = tester.target.has(5) && tester.target.has(1);
    if let Some(span) = tester.target.bits.filter(|_| reads_and_writes) {
        let now = tester.read_bits(span.up_to(1))?[0];
        echoes.push(pdu(5, span.first, if now { 0xFF00 } else { 0 }));
    }
    for request in echoes {
        for _ in 0..5 {
            tester.reply_is(&request, &request)?;
        }
    }
    Ok(())
}
