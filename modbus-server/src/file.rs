//! File records: functions 14 and 15 (V1.1b3 6.14, 6.15).
//!
//! A request has groups of consecutive records; a record is a word. Each group has its header, and in function 15 its
//! words.
//!
//! ```text
//!           +----+------------+----+------+--------+--------+-------+----+---
//!  request  | 14 | byte count | 06 | file | record | length |       | 06 | ...
//!           | 15 |            |    |      |        |        | words |    |
//!           +----+------------+----+------+--------+--------+-------+----+---
//!           +----+------------+------------+----+-------+------------+---
//!  reply    | 14 | byte count | byte count | 06 | words | byte count | ...
//!           +----+------------+------------+----+-------+------------+---
//! ```
//!
//! The reply to function 15 is its request.

use core::ops::RangeInclusive;

use crate::exception::first_of;
use crate::{Adu, DataModel, Exception, Span, Words, WordsOut};

/// The only reference type there is.
const REFERENCE: u8 = 6;
/// Records of a file.
const RECORDS: u32 = 10_000;
/// Bytes of a group's header.
const HEADER: usize = 7;
/// Byte counts of function 14.
const READ: RangeInclusive<u8> = 0x07..=0xF5;
/// Byte counts of function 15.
const WRITE: RangeInclusive<u8> = 0x09..=0xFB;
/// The most bytes of a reply's groups: 253 of the PDU, less function code and byte count. The field's range of 07 to F5
/// in the table of 6.14 cannot be meant: a group of one word has 4 bytes, and 6.14 names 253 bytes as the limit.
const MAX_REPLY: usize = 253 - 2;
/// Where the groups of a request begin, counted from the unit address.
const GROUPS_FROM: u8 = 3;

/// A group of records.
struct Group<'a> {
    reference: u8,
    file: u16,
    record: u16,
    /// In records: 1 or more.
    length: u16,
    /// As many words, in function 15.
    words: Words<'a>,
}

impl Group<'_> {
    /// The records, if a file can have them.
    fn records(&self) -> Result<Span, Exception> {
        Span::new(self.record, self.length)
            .filter(|records| records.end() <= RECORDS)
            .filter(|_| self.reference == REFERENCE && self.file != 0)
            .ok_or(Exception::IllegalDataAddress)
    }
}

/// The groups of a request in order.
#[derive(Clone)]
struct Groups<'a> {
    rest: &'a [u8],
    with_words: bool,
}

impl<'a> Groups<'a> {
    /// Takes the next group; `None` at the end, and for a group that is cut short or has no records. Not inlined: it is
    /// called in four places.
    #[inline(never)]
    fn take(&mut self) -> Option<Group<'a>> {
        let (&[reference, f1, f0, r1, r0, l1, l0], rest) =
            self.rest.split_first_chunk::<HEADER>()?;
        let length = u16::from_be_bytes([l1, l0]);
        let words = if self.with_words {
            usize::from(length) * 2
        } else {
            0
        };
        let (words, rest) = rest.split_at_checked(words)?;
        self.rest = rest;
        (length > 0).then_some(Group {
            reference,
            file: u16::from_be_bytes([f1, f0]),
            record: u16::from_be_bytes([r1, r0]),
            length,
            words: Words::new(words),
        })
    }
}

/// Checks byte counts and the form of all groups of a request. `fields` are what follows the function code. Returns the
/// byte count that a reply of function 14 to these groups has.
///
/// # Errors
/// 03 where the form is wrong.
#[inline(never)]
fn check_form(fields: &[u8], with_words: bool) -> Result<(Groups<'_>, u8), Exception> {
    let byte_counts = if with_words { WRITE } else { READ };
    let (byte_count, rest) = fields.split_first().ok_or(Exception::IllegalDataValue)?;
    if !byte_counts.contains(byte_count) || rest.len() != usize::from(*byte_count) {
        return Err(Exception::IllegalDataValue);
    }
    let groups = Groups { rest, with_words };
    let (mut left, mut reply) = (groups.clone(), 0);
    while !left.rest.is_empty() {
        let group = left.take().ok_or(Exception::IllegalDataValue)?;
        reply += 2 + 2 * usize::from(group.length);
    }
    // Function 15 never exceeds it: the groups of a reply are shorter than those of its request.
    if reply > MAX_REPLY {
        return Err(Exception::IllegalDataValue);
    }
    Ok((groups, reply as u8))
}

/// Checks a request of function 14, or of function 15, `with_words`. `fields` are what follows the function code. Checks
/// the form of all groups, then all their addresses, then what the model says. Returns the byte count of a reply of
/// function 14.
///
/// # Errors
/// The exception to answer with.
pub(crate) fn check(
    fields: &[u8],
    with_words: bool,
    model: &impl DataModel,
) -> Result<u8, Exception> {
    let (mut groups, reply) = check_form(fields, with_words)?;
    let mut result = Ok(());
    while let Some(group) = groups.take() {
        let checked = group.records().and_then(|records| {
            if with_words {
                model.check_write_file(group.file, records, group.words)
            } else {
                model.check_read_file(group.file, records)
            }
        });
        result = first_of(result, checked);
    }
    result.map(|()| reply)
}

#[inline(never)]
/// Replaces a checked request of function 14 by the groups of its reply.
pub(crate) fn read(adu: &mut Adu, model: &impl DataModel) {
    // Lets the compiler leave all of this out for a model without files.
    if !model.has_files() {
        return;
    }
    let mut copy = [0; *READ.end() as usize];
    let request = adu.from(GROUPS_FROM);
    let len = request.len();
    for (copy, byte) in copy.iter_mut().zip(request) {
        *copy = *byte;
    }
    // A checked request fits.
    let rest = copy.get(..len).unwrap_or_default();
    adu.clear();
    let with_words = false;
    let mut groups = Groups { rest, with_words };
    while let Some(group) = groups.take() {
        let Ok(records) = group.records() else { return };
        let bytes = usize::from(group.length) * 2;
        // At most 249.
        adu.extend(&[bytes as u8 + 1, REFERENCE]);
        let from = adu.len();
        let words = adu.resize(from + bytes).get_mut(from..);
        let mut out = WordsOut::new(words.unwrap_or_default());
        model.read_file(group.file, records, &mut out);
        out.finish();
    }
}

#[inline(never)]
/// Writes the records of a checked request of function 15.
pub(crate) fn write(adu: &Adu, model: &mut impl DataModel) {
    if !model.has_files() {
        return;
    }
    let (rest, with_words) = (adu.from(GROUPS_FROM), true);
    let mut groups = Groups { rest, with_words };
    while let Some(group) = groups.take() {
        if let Ok(records) = group.records() {
            model.write_file(group.file, records, group.words);
        }
    }
}
