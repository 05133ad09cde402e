//! Device identification: function 2B, MEI type 0E.

use crate::case::{Case, Check, Need, case, skip};
use crate::tester::Tester;

const N: &[Need] = &[Need::Function(0x2B)];
const S: &str = "V1.1b3 6.21";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc2b/basic-stream", S, "read code 01 from object 0 gives objects 00 to 02", N, basic),
    case("fc2b/regular-stream", S, "read code 02 from object 0 gives objects 00 to 06 and more follow in order", N,
        regular),
    case("fc2b/extended-stream", S,
        "read code 03 gives at least what its conformity level promises, split within 253 bytes", N, extended),
    case("fc2b/individual", S, "read code 04 gives the one object asked for, as the stream has it", N, individual),
    case("fc2b/individual-unknown", S, "read code 04 with an object that is not there is exception 02", N,
        individual_unknown),
    case("fc2b/stream-restarts", S, "a stream from an object that is not there starts at object 0", N, restarts),
    case("fc2b/stream-from-the-middle", S, "a stream begins at the object that the request names, if the unit has it", N,
        from_the_middle),
    case("fc2b/read-code", S, "read code 00 and those above 04 are exception 03", N, read_code),
    case("fc2b/mei-type", "V1.1b3 6.19", "another MEI type is exception 01", N, mei_type),
    case("fc2b/length", S, "a request cut short or too long is 03 or silence", N, length).interpretation(),
];

struct Page {
    conformity: u8,
    /// The next object, if more follow.
    next: Option<u8>,
    objects: Vec<(u8, Vec<u8>)>,
}

fn request(code: u8, object: u8) -> Vec<u8> {
    vec![0x2B, 0x0E, code, object]
}

/// Sends a request and splits the reply into its objects. The case fails when the reply does not have the form of 6.21.
fn page(tester: &mut Tester<'_>, code: u8, object: u8) -> Check<Page> {
    let reply = tester.reply(&request(code, object))?;
    let [
        0x2B,
        0x0E,
        echoed,
        conformity,
        more,
        next,
        count,
        ref rest @ ..,
    ] = reply[..]
    else {
        return tester.fail("2B 0E, read code, conformity level, more follows, next object, count");
    };
    tester.ensure(echoed == code, format!("the read code {code:02X} again"))?;
    let levels = [1, 2, 3, 0x81, 0x82, 0x83];
    let wanted = "a conformity level 01-03 or 81-83";
    tester.ensure(levels.contains(&conformity), wanted)?;
    tester.ensure(reply.len() <= 253, "a PDU of at most 253 bytes")?;
    let (mut objects, mut rest) = (Vec::new(), rest);
    while let [id, length, tail @ ..] = rest {
        let Some((value, tail)) = tail.split_at_checked(usize::from(*length)) else {
            return tester.fail("each object as long as its length says");
        };
        objects.push((*id, value.to_vec()));
        rest = tail;
    }
    tester.ensure(
        rest.is_empty() && objects.len() == usize::from(count),
        format!("{count} objects and nothing after them"),
    )?;
    let next = match (more, next) {
        (0, 0) => None,
        (0xFF, next) if code != 4 => Some(next),
        _ => {
            return tester.fail("more follows 00 and next object 00, or FF and the next object");
        }
    };
    Ok(Page {
        conformity,
        next,
        objects,
    })
}

/// Reads the objects from `first` to the end of the stream, with as many requests as needed.
fn stream(tester: &mut Tester<'_>, code: u8, first: u8) -> Check<Vec<(u8, Vec<u8>)>> {
    let (mut all, mut from) = (Vec::new(), first);
    loop {
        let page = page(tester, code, from)?;
        let wanted = "at least one object in each reply of a stream";
        tester.ensure(!page.objects.is_empty(), wanted)?;
        all.extend(page.objects);
        let in_order = all.is_sorted_by(|a: &(u8, Vec<u8>), b| a.0 < b.0);
        tester.ensure(in_order, "objects in ascending order, none twice")?;
        let Some(next) = page.next else {
            return Ok(all);
        };
        let ahead = all.last().is_some_and(|last| next > last.0);
        tester.ensure(ahead, "a next object after those received")?;
        from = next;
    }
}

fn ids(objects: &[(u8, Vec<u8>)]) -> Vec<u8> {
    objects.iter().map(|object| object.0).collect()
}

fn basic(tester: &mut Tester<'_>) -> Check {
    let objects = stream(tester, 1, 0)?;
    tester.ensure(ids(&objects) == [0, 1, 2], "the objects 00, 01 and 02")?;
    let wanted = "vendor, product code and revision as ASCII";
    tester.ensure(objects.iter().all(|object| object.1.is_ascii()), wanted)
}

fn regular(tester: &mut Tester<'_>) -> Check {
    let level = page(tester, 1, 0)?.conformity & 0x7F;
    let objects = ids(&stream(tester, 2, 0)?);
    if level == 1 {
        // A device of the basic level answers with its basic objects.
        return tester.ensure(objects == [0, 1, 2], "the objects 00, 01 and 02");
    }
    if tester.target.modio.is_some() {
        return tester.ensure(objects == [0, 1, 2, 3, 4, 5, 6], "the objects 00 to 06");
    }
    // Each of 03 to 06 is optional.
    tester.ensure(
        objects.starts_with(&[0, 1, 2]) && objects.iter().all(|id| *id <= 6),
        "the objects 00, 01 and 02, and none after 06",
    )
}

fn extended(tester: &mut Tester<'_>) -> Check {
    let level = page(tester, 1, 0)?.conformity & 0x7F;
    let objects = ids(&stream(tester, 3, 0)?);
    tester.ensure(objects.starts_with(&[0, 1, 2]), "the basic objects first")?;
    let has = objects.iter().any(|id| *id >= 0x80);
    let wanted = "objects from 80 on, as a device of the extended level has them";
    tester.ensure(has || level < 3, wanted)
}

fn needs_individual_access(tester: &mut Tester<'_>) -> Check {
    if page(tester, 1, 0)?.conformity & 0x80 == 0 {
        return skip("its conformity level has no individual access");
    }
    Ok(())
}

fn individual(tester: &mut Tester<'_>) -> Check {
    needs_individual_access(tester)?;
    for (id, value) in stream(tester, 3, 0)? {
        let one = page(tester, 4, id)?;
        let wanted = format!("only object {id:02X}, with the same value as in the stream");
        tester.ensure(one.objects == [(id, value)], wanted)?;
    }
    Ok(())
}

fn individual_unknown(tester: &mut Tester<'_>) -> Check {
    needs_individual_access(tester)?;
    let known = ids(&stream(tester, 3, 0)?);
    for id in [0x07, 0x40, 0x7F, 0xFE, 0xFF] {
        if !known.contains(&id) {
            tester.exception(&request(4, id), 2)?;
        }
    }
    Ok(())
}

fn restarts(tester: &mut Tester<'_>) -> Check {
    for code in 1..=3 {
        let known = stream(tester, code, 0)?;
        for id in [0x50, 0xFF] {
            if !known.iter().any(|object| object.0 == id) {
                let again = stream(tester, code, id)?;
                tester.ensure(again == known, "the whole stream, from object 0 on")?;
            }
        }
    }
    Ok(())
}

fn from_the_middle(tester: &mut Tester<'_>) -> Check {
    for code in 1..=3 {
        let known = stream(tester, code, 0)?;
        for (place, (id, _)) in known.iter().enumerate().skip(1) {
            let rest = stream(tester, code, *id)?;
            tester.ensure(
                rest == known[place..],
                format!(
                    "the objects from {id:02X} on, with the same values as in the whole stream"
                ),
            )?;
        }
    }
    Ok(())
}

fn read_code(tester: &mut Tester<'_>) -> Check {
    for code in [0, 5, 6, 0x7F, 0x80, 0xFF] {
        tester.exception(&request(code, 0), 3)?;
    }
    Ok(())
}

fn mei_type(tester: &mut Tester<'_>) -> Check {
    for mei in [0x00, 0x0D, 0x0F, 0xFF] {
        tester.exception(&[0x2B, mei, 1, 0], 1)?;
    }
    Ok(())
}

fn length(tester: &mut Tester<'_>) -> Check {
    tester.exception_03_or_silence(&[0x2B, 0x0E])?;
    tester.exception_03_or_silence(&[0x2B, 0x0E, 1])?;
    tester.exception_03_or_silence(&[0x2B, 0x0E, 1, 0, 0])
}
