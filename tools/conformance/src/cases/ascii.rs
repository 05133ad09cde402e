//! ASCII framing (Modbus over Serial Line V1.02, 2.5.2).

use std::time::Duration;

use modbus_line::Parity;

use crate::case::{Case, Check, Need, case};
use crate::cases::damage::one_by_one;
use crate::cases::dispatch::with_data;
use crate::endpoint::Piece;
use crate::frame::{Reply, ascii, lrc, rtu};
use crate::points::diagnose;
use crate::tester::{Tester, apart};

const N: &[Need] = &[Need::Ascii];
const S: &str = "V1.02 2.5.2.1";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("ascii/bad-lrc", "V1.02 2.5.2.2", "a wrong LRC gets silence", N, bad_lrc),
    case("ascii/before-the-colon", S, "whatever stands before the colon is ignored", N, before_colon),
    case("ascii/colon-restarts", S, "a colon starts a new frame, whatever was open", N, colon_restarts),
    case("ascii/not-a-digit", S, "characters that are no digits, and odd numbers of digits, spoil the frame", N,
        not_digits),
    case("ascii/lower-case", S, "the digits are 0-9 and A-F: a frame with lower-case digits gets silence", N,
        lower_case).interpretation(),
    case("ascii/damaged-character", S,
        "a character with a low stop bit or wrong parity spoils its frame, and that one only",
        &[Need::Ascii, Need::Faults], damaged),
    case("ascii/truncated", S, "a frame without its end gets silence, and the next one is answered", N, truncated),
    case("ascii/gap-below-1-s", S, "gaps of up to a second inside a frame are no harm", N, short_gap),
    case("ascii/gap-above-1-s", S, "a gap of more than a second ends the frame", N, long_gap),
    case("ascii/longest", S, "a frame of 513 characters is processed", N, longest),
    case("ascii/too-long", S, "longer frames are dropped", N, too_long),
    case("ascii/rtu-frame", S, "RTU frames get silence", N, rtu_frame),
    case("ascii/delimiter", "V1.1b3 6.8.1, 03", "08/03 changes the character that ends a frame after CR",
        &[Need::Ascii, Need::Function(8)], delimiter),
    case("ascii/delimiter-refused", "V1.1b3 6.8.1, 03",
        "08/03 with a colon, CR or a digit, or without 00 after the character, is exception 03",
        &[Need::Ascii, Need::Function(8)], delimiter_refused).interpretation(),
];

fn body(tester: &Tester<'_>) -> Vec<u8> {
    [&[tester.unit()], &tester.target.ping[..]].concat()
}

fn bad_lrc(tester: &mut Tester<'_>) -> Check {
    let body = body(tester);
    for bit in 0..8 {
        let bad = ascii(&body, lrc(&body) ^ 1 << bit);
        tester.silence_to(&bad, "the LRC is wrong")?;
    }
    tester.alive("frames with a wrong LRC")
}

fn before_colon(tester: &mut Tester<'_>) -> Check {
    for noise in [&b"0"[..], b"\r\n", b"0103", b"\x00\xFF", b"hello"] {
        let frame = [noise, &tester.ping()].concat();
        tester.answers(&[Piece::Bytes(frame)], "a reply to what follows the colon")?;
    }
    Ok(())
}

fn colon_restarts(tester: &mut Tester<'_>) -> Check {
    for open in [&b":"[..], b":0", b":0103", b":010300000001"] {
        let frame = [open, &tester.ping()].concat();
        let wanted = "a reply to what follows the last colon";
        tester.answers(&[Piece::Bytes(frame)], wanted)?;
    }
    Ok(())
}

fn not_digits(tester: &mut Tester<'_>) -> Check {
    let good = tester.ping();
    for wrong in [b'G', b' ', b'/', b'@', 0x00] {
        let mut bad = good.clone();
        bad[3] = wrong;
        tester.silence_to(&bad, "a character is not a digit")?;
    }
    let mut odd = good.clone();
    odd.remove(3);
    tester.silence_to(&odd, "an odd number of digits")?;
    tester.silence_to(b":\r\n", "the frame is empty")?;
    tester.silence_to(b":01FF\r\n", "an address alone")?;
    tester.alive("invalid frames")
}

fn lower_case(tester: &mut Tester<'_>) -> Check {
    // These data have letters among their digits, whatever the unit's address is.
    let function = super::dispatch::unknown_function(tester)?;
    let pdu = [function, 0xAB, 0xCD, 0xEF];
    tester.exception(&pdu, 1)?;
    let lower = tester.frame(&pdu).to_ascii_lowercase();
    tester.silence_to(&lower, "the digits are in lower case")?;
    tester.alive("a frame in lower case")
}

fn damaged(tester: &mut Tester<'_>) -> Check {
    one_by_one(tester, Piece::BadStop)?;
    if tester.endpoint.line().format.parity == Parity::None {
        return Ok(());
    }
    one_by_one(tester, Piece::BadParity)
}

fn truncated(tester: &mut Tester<'_>) -> Check {
    let good = tester.ping();
    for cut in 1..good.len() {
        tester.silence_to(&good[..cut], "the frame has no end")?;
        tester.alive("a truncated frame")?;
    }
    Ok(())
}

fn with_gap(tester: &Tester<'_>, gap: Duration) -> [Piece; 3] {
    let frame = tester.ping();
    let (first, rest) = frame.split_at(5);
    apart(first, gap, rest)
}

fn short_gap(tester: &mut Tester<'_>) -> Check {
    for ms in [10, 100, tester.exact(980, 500)] {
        let pieces = with_gap(tester, Duration::from_millis(ms));
        tester.answers(&pieces, format!("a reply: a gap of {ms} ms is allowed"))?;
    }
    Ok(())
}

fn long_gap(tester: &mut Tester<'_>) -> Check {
    for ms in [1050, 1500] {
        let pieces = with_gap(tester, Duration::from_millis(ms));
        tester.silence(&pieces, format!("a gap of {ms} ms is too long"))?;
        tester.alive("a gap above a second")?;
    }
    Ok(())
}

fn longest(tester: &mut Tester<'_>) -> Check {
    // Unit, 253 bytes of PDU, LRC: 255 bytes as 510 digits, colon, CR and LF.
    let (function, frame) = with_data(tester, 252);
    let reply = tester.raw_due(&frame)?;
    tester.ensure(
        frame.len() == 513 && reply.exception(function) == Some(1),
        "exception 01: a frame of 513 characters is valid",
    )
}

fn too_long(tester: &mut Tester<'_>) -> Check {
    for data in [253, 254, 300, 600] {
        let (_, frame) = with_data(tester, data);
        tester.silence_to(&frame, "the frame is too long")?;
        tester.alive("a frame that is too long")?;
    }
    Ok(())
}

fn rtu_frame(tester: &mut Tester<'_>) -> Check {
    let frame = rtu(&body(tester));
    for _ in 0..3 {
        tester.silence_to(&frame, "the frame is an RTU frame")?;
    }
    tester.alive("RTU frames")
}

fn delimiter(tester: &mut Tester<'_>) -> Check {
    let change = |to: u8| diagnose(3, &[to, 0]);
    tester.reply_unless_lacking(&change(b'!'), "08/03")?;
    let [new, back] = [tester.ping(), tester.frame(&change(b'\n'))].map(|mut frame| {
        frame.pop();
        frame.push(b'!');
        frame
    });
    // The reply may end in either character.
    let answered = tester.raw_due(&new)? != Reply::Silence;
    tester.raw(&back)?;
    let wanted = "a reply to a frame that ends in CR and the new character";
    tester.ensure(answered, wanted)?;
    tester.alive("the delimiter is LF again")
}

fn delimiter_refused(tester: &mut Tester<'_>) -> Check {
    tester.reply_unless_lacking(&diagnose(3, b"\n\0"), "08/03")?;
    for data in [b":\0", b"\r\0", b"0\0", b"9\0", b"A\0", b"F\0", b"!\x01"] {
        tester.exception(&diagnose(3, data), 3)?;
        tester.alive("a refused delimiter")?;
    }
    Ok(())
}
