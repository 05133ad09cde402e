//! File records: functions 14 and 15 (V1.1b3 6.14, 6.15).
//!
//! A request contains groups of consecutive records; a record is a word. Each group has a header, and in function
//! 15 also its words.
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
//! The reply to function 15 repeats the request.

use core::ops::RangeInclusive;

use crate::exception::first_of;
use crate::{Adu, DataModel, Exception, Span, Words, WordsOut};

/// The only reference type.
const REFERENCE: u8 = 6;
/// Number of records of a file.
const RECORDS: u32 = 10_000;
/// Bytes of a group's header.
const HEADER: usize = 7;
/// Allowed byte counts of function 14.
const READ: RangeInclusive<u8> = 0x07..=0xF5;
/// Allowed byte counts of function 15.
const WRITE: RangeInclusive<u8> = 0x09..=0xFB;
/// Largest number of bytes of a reply's groups: the 253 of the PDU, less function code and byte count. The table of
/// 6.14 gives a range of 07 to F5 for the byte count of a reply. That must be an error, because a group of one word
/// has 4 bytes and 6.14 names 253 bytes as the limit.
const MAX_REPLY: usize = 253 - 2;
/// Position of the groups in a request, counted from the unit address.
const GROUPS_FROM: u8 = 3;

/// A group of records.
struct Group<'a> {
    reference: u8,
    file: u16,
    record: u16,
    /// Number of records: 1 or more.
    length: u16,
    /// The same number of words, in function 15.
    words: Words<'a>,
}

impl Group<'_> {
    /// Returns the records, if a file can contain them.
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
    /// Returns the next group. Returns `None` at the end, and for a group that is incomplete or has no records. Not
    /// inlined, because it is called in four places.
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

/// Checks byte counts and the form of all groups of a request. `fields` are the bytes after the function code.
/// Returns the byte count of a reply of function 14 to these groups.
///
/// # Errors
/// 03 when the form is wrong.
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
    // Function 15 never exceeds it, because the groups of a reply are shorter than those of its request.
    if reply > MAX_REPLY {
        return Err(Exception::IllegalDataValue);
    }
    Ok((groups, reply as u8))
}

/// Checks a request of function 14, or of function 15 when `with_words` is set. `fields` are the bytes after the
/// function code. Checks the form of all groups first, then all their addresses, then asks the model. Returns the
/// byte count of a reply of function 14.
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

/// Makes a checked request of function 14 its reply, with groups of `bytes` bytes.
#[inline(never)]
pub(crate) fn read(adu: &mut Adu, bytes: u8, model: &impl DataModel) {
    // The groups of the reply are written over those of the request.
    let mut request = Adu::new();
    request.extend(adu.from(GROUPS_FROM));
    let rest = request.as_slice();
    adu.set(GROUPS_FROM - 1, bytes);
    adu.truncate(GROUPS_FROM.into());
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

/// Writes the records of a checked request of function 15. `fields` are the bytes after the function code.
#[inline(never)]
pub(crate) fn write(fields: &[u8], model: &mut impl DataModel) {
    let (rest, with_words) = (fields.get(1..).unwrap_or_default(), true);
    let mut groups = Groups { rest, with_words };
    while let Some(group) = groups.take() {
        if let Ok(records) = group.records() {
            model.write_file(group.file, records, group.words);
        }
    }
}
