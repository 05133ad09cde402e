//! File records, functions 14 and 15, and the file that describes a modio.

use modio_description::{Description, FILE, records};
use register_map::edges::log;
use register_map::update::{BLOCK_BYTES, status};
use register_map::{points, state};

use crate::case::{Case, Check, Need, case, skip};
use crate::target::Span;
use crate::tester::Tester;

const N: &[Need] = &[Need::Function(0x14)];
const M: &[Need] = &[Need::Function(0x14), Need::Modio];
const S: &str = "V1.1b3 6.14";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc14/byte-count", S, "a byte count below 07 or above F5 is exception 03", N, byte_count),
    case("fc14/length", S, "a request cut short or too long is 03 or silence", N, length).interpretation(),
    case("fc14/reference-type", S, "a reference type other than 06 is exception 02", N, reference_type),
    case("fc14/file-0", S, "file number 0 is exception 02", N, file_0),
    case("fc14/record-above-9999", S, "a record number above 9999 is exception 02", N, record_above_9999),
    case("fc14/longest-reply", S,
        "groups that do not fit a reply of 253 bytes are exception 03, or 02 where the file has not so many records",
        N, longest_reply).interpretation(),
    case("files/self-description", "map",
        "file 1 is the self-description, with its length, its CRC, which is register 0x020F, and the modules in force",
        M, self_description),
    case("files/groups", S, "several groups in one request are read in their order", M, groups),
    case("files/longest-reply", S, "a group of 124 records is read and one of 125 is exception 03", M,
        longest_of_modio),
    case("files/beyond-the-end", "map", "records beyond the end of a file, and files that do not exist, are exception 02", M,
        beyond_the_end),
    case("files/read-only", "map", "a write to a file is exception 02 and writes nothing",
        &[Need::Function(0x14), Need::Function(0x15), Need::Modio], read_only),
];

/// A group of records: file, first record and number of records.
type Group = (u16, u16, u16);

fn group(reference: u8, (file, record, count): Group) -> Vec<u8> {
    let fields = [file, record, count].map(u16::to_be_bytes);
    [&[reference], fields.as_flattened()].concat()
}

/// Returns the PDU of a request whose groups have reference type 6.
fn request(groups: &[Group]) -> Vec<u8> {
    let groups: Vec<u8> = groups.iter().flat_map(|of| group(6, *of)).collect();
    [&[0x14, groups.len() as u8], &groups[..]].concat()
}

/// Reads groups. Returns the bytes of each group.
fn read(tester: &mut Tester<'_>, groups: &[Group]) -> Check<Vec<Vec<u8>>> {
    let reply = tester.reply(&request(groups))?;
    let [0x14, count, ref rest @ ..] = reply[..] else {
        return tester.fail("14, a byte count and groups");
    };
    let wanted = "a byte count equal to the number of bytes";
    tester.ensure(rest.len() == usize::from(count), wanted)?;
    let (mut rest, mut read) = (rest, Vec::new());
    for (_, _, records) in groups {
        let bytes = usize::from(*records) * 2;
        let head = [(bytes + 1) as u8, 6];
        match rest.split_at_checked(2 + bytes) {
            Some((group, others)) if group[..2] == head => {
                read.push(group[2..].to_vec());
                rest = others;
            }
            _ => return tester.fail(format!("a group of {bytes} bytes with its length and 06")),
        }
    }
    tester.ensure(rest.is_empty(), "nothing after the groups")?;
    Ok(read)
}

fn byte_count(tester: &mut Tester<'_>) -> Check {
    tester.exception(&[0x14, 0], 3)?;
    tester.exception(&[0x14, 6, 6, 0, 1, 0, 0, 0], 3)?;
    // A request has 35 groups at most. This one has one byte more.
    let most = group(6, (1, 0, 1)).repeat(35);
    let pdu = [&[0x14, 0xF6], &most[..], &[6]].concat();
    tester.exception(&pdu, 3)
}

fn length(tester: &mut Tester<'_>) -> Check {
    let whole = request(&[(1, 0, 1)]);
    for length in [1, 2, 5, whole.len() - 1] {
        tester.exception_03_or_silence(&whole[..length])?;
    }
    tester.exception_03_or_silence(&[&whole[..], &[0]].concat())?;
    // A second group that is cut short.
    let cut = [&[0x14, 10], &group(6, (1, 0, 1))[..], &[6, 0, 1]].concat();
    tester.exception_03_or_silence(&cut)
}

fn reference_type(tester: &mut Tester<'_>) -> Check {
    for reference in [0, 5, 7, 0xFF] {
        let pdu = [&[0x14, 7], &group(reference, (1, 0, 1))[..]].concat();
        tester.exception(&pdu, 2)?;
    }
    Ok(())
}

fn file_0(tester: &mut Tester<'_>) -> Check {
    tester.exception(&request(&[(0, 0, 1)]), 2)
}

fn record_above_9999(tester: &mut Tester<'_>) -> Check {
    for record in [10_000, 0x8000, 0xFFFF] {
        tester.exception(&request(&[(1, record, 1)]), 2)?;
    }
    Ok(())
}

fn longest_reply(tester: &mut Tester<'_>) -> Check {
    for groups in [
        &[(1, 0, 125)][..],
        &[(1, 0, 0x8000)],
        &[(1, 0, 62), (1, 0, 62)],
    ] {
        let reply = tester.ask_due(&request(groups))?;
        let wanted = "exception 03 or 02";
        tester.ensure(matches!(reply.exception(0x14), Some(2 | 3)), wanted)?;
    }
    Ok(())
}

/// Reads the first two records of file 1. Returns them and the number of records of the file.
fn head(tester: &mut Tester<'_>) -> Check<(Vec<u8>, u16)> {
    let head = read(tester, &[(FILE, 0, 2)])?.concat();
    let records = records(u16::from_be_bytes([head[0], head[1]]));
    tester.ensure(records <= 10_000, "a length of at most 10000 records")?;
    Ok((head, records))
}

fn self_description(tester: &mut Tester<'_>) -> Check {
    let (head, records) = head(tester)?;
    let mut file = Vec::new();
    for record in (0..records).step_by(124) {
        let count = (records - record).min(124);
        file.extend(read(tester, &[(FILE, record, count)])?.concat());
    }
    let unit = match Description::open(&file) {
        Ok(unit) => unit,
        Err(error) => return tester.fail(error),
    };
    let crc = tester.read_word(state::DESCRIPTION_CRC)?;
    let wanted = "the CRC in the second record";
    tester.ensure(crc.to_be_bytes() == head[2..], wanted)?;
    let in_force = tester.read_words(Span::of(state::MODULE_IN_FORCE, points::PORTS))?;
    let described = (1..).zip(in_force).all(|(number, code)| {
        let port = unit.ports.iter().find(|port| port.number == number);
        port.map_or(0, |port| port.module) == code
    });
    tester.ensure(described, format!("the modules of {:?}", unit.ports))
}

fn groups(tester: &mut Tester<'_>) -> Check {
    let wanted = [(FILE, 7, 3), (FILE, 0, 2), (FILE, 7, 3), (FILE, 20, 40)];
    let together = read(tester, &wanted)?;
    for (group, bytes) in wanted.iter().zip(&together) {
        let alone = read(tester, &[*group])?.concat();
        let must = format!("the same as with other groups: {bytes:02X?}");
        tester.ensure(alone == *bytes, must)?;
    }
    Ok(())
}

fn longest_of_modio(tester: &mut Tester<'_>) -> Check {
    read(tester, &[(FILE, 0, 124)])?;
    tester.exception(&request(&[(FILE, 0, 125)]), 3)
}

/// Returns the number of records of file 2, the state of an update; 0 without a loader, because then the unit has no such
/// file.
fn records_of_status(tester: &mut Tester<'_>) -> Check<u16> {
    if tester.read_word(state::BUILD)? & state::build::NO_LOADER != 0 {
        return Ok(0);
    }
    let Some(board) = tester.target.modio.and_then(|modio| modio.board) else {
        return skip("the register map does not know the board, and so not the size of its slots");
    };
    let blocks = board.layout().slot as usize / BLOCK_BYTES;
    Ok(status::BITMAP + blocks.div_ceil(16) as u16)
}

fn beyond_the_end(tester: &mut Tester<'_>) -> Check {
    let (_, records) = head(tester)?;
    let of_status = records_of_status(tester)?;
    for (file, records) in [
        (FILE, records),
        (status::FILE, of_status),
        (log::FILE, log::END),
    ] {
        if let Some(last) = records.checked_sub(1) {
            read(tester, &[(file, last, 1)])?;
            tester.exception(&request(&[(file, last, 2)]), 2)?;
        }
        for beyond in [records, 9999] {
            tester.exception(&request(&[(file, beyond, 1)]), 2)?;
        }
    }
    for file in [4, 0x100, 0x180, 0xFFFF] {
        tester.exception(&request(&[(file, 0, 1)]), 2)?;
        tester.exception(&request(&[(FILE, 0, 1), (file, 0, 1)]), 2)?;
    }
    Ok(())
}

fn read_only(tester: &mut Tester<'_>) -> Check {
    let before = read(tester, &[(FILE, 0, 8)])?;
    for file in [FILE, 2, 0x100] {
        let pdu = [&[0x15, 9], &group(6, (file, 4, 1))[..], &[0x5A, 0xA5]].concat();
        let reply = tester.ask_due(&pdu)?;
        tester.ensure(reply.exception(0x15) == Some(2), "exception 02")?;
    }
    let after = read(tester, &[(FILE, 0, 8)])?;
    tester.ensure(after == before, "the same words as before")
}
