//! Read device identification: function 2B, MEI type 0E (V1.1b3 6.21).
//!
//! ```text
//!  +------+----+----+----+------------+-------------+-------------+-------+----+-----+--------+---
//!  | unit | 2B | 0E |code| conformity | more follows| next object | count | id | len | value  |...
//!  +------+----+----+----+------------+-------------+-------------+-------+----+-----+--------+---
//! ```

use crate::{Adu, DataModel, Exception, TextOut};

/// Kind of objects that a request asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ReadCode {
    /// 01: objects 00 to 02.
    Basic = 1,
    /// 02: objects 00 to 06.
    Regular = 2,
    /// 03: objects 00 to 06, and from 80 on.
    Extended = 3,
    /// 04: one object.
    One = 4,
}

/// The MEI type of read device identification.
const MEI_TYPE: u8 = 0x0E;

/// First object of the device's own; objects 07 to 7F are reserved.
const FIRST_EXTENDED: u8 = 0x80;
/// Last object that the standard defines.
const LAST_REGULAR: u8 = 0x06;

/// Length of a unit address and the longest PDU.
const LONGEST: usize = 1 + 253;
/// Bytes before conformity, which the reply repeats from the request: unit, function code, MEI type and read code.
const REPEATED: usize = 4;
/// Bytes of conformity, more follows, next object and count.
const FIXED: usize = 4;
/// Bytes of an object's number and length.
const OBJECT: usize = 2;
/// Length of the longest value that fits a reply. Longer values are cut.
const MAX_VALUE: usize = LONGEST - REPEATED - FIXED - OBJECT;

/// Positions of these fields, counted from the unit address.
const MORE_FOLLOWS: u8 = 5;
const NEXT_OBJECT: u8 = 6;
const COUNT: u8 = 7;

impl ReadCode {
    const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            1 => Self::Basic,
            2 => Self::Regular,
            3 => Self::Extended,
            4 => Self::One,
            _ => return None,
        })
    }

    /// Returns the last object that this kind may contain.
    const fn last(self) -> u8 {
        match self {
            Self::Basic => 0x02,
            Self::Regular => LAST_REGULAR,
            Self::Extended | Self::One => 0xFF,
        }
    }
}

/// Decodes the MEI type and the bytes after it.
///
/// # Errors
/// 01 for a device without identification, whatever the request contains, and for another MEI type, because the
/// function code is validated first (V1.1b3 4.5). 03 for a wrong length or a code that is not 01 to 04. 02 for a
/// single object that does not exist.
pub(crate) fn decode(fields: &[u8], model: &impl DataModel) -> Result<(ReadCode, u8), Exception> {
    if !exists(0, model) {
        return Err(Exception::IllegalFunction);
    }
    let (code, object) = match *fields {
        [MEI_TYPE, code, object] => (code, object),
        [] | [MEI_TYPE, ..] => return Err(Exception::IllegalDataValue),
        _ => return Err(Exception::IllegalFunction),
    };
    let code = ReadCode::from_code(code).ok_or(Exception::IllegalDataValue)?;
    let known = object == 0 || (object <= code.last() && exists(object, model));
    match code {
        ReadCode::One if !known => Err(Exception::IllegalDataAddress),
        // A stream whose first object does not exist begins with object 0.
        _ => Ok((code, if known { object } else { 0 })),
    }
}

/// Makes a checked request its reply.
pub(crate) fn fill(code: ReadCode, first: u8, model: &impl DataModel, adu: &mut Adu) {
    adu.truncate(REPEATED);
    adu.extend(&[conformity(model), 0x00, 0x00, 0]);
    let mut count = 0;
    let mut next = Some(first);
    while let Some(object) = next
        && object <= code.last()
    {
        match append(object, model, adu) {
            Some(true) => count += 1,
            Some(false) => {
                adu.set(MORE_FOLLOWS, 0xFF);
                adu.set(NEXT_OBJECT, object);
                break;
            }
            None if object >= FIRST_EXTENDED => break,
            None => {}
        }
        next = match object {
            _ if code == ReadCode::One => None,
            LAST_REGULAR => Some(FIRST_EXTENDED),
            object => object.checked_add(1),
        };
    }
    adu.set(COUNT, count);
}

/// Appends an object with its length and value, which is cut when it does not fit any reply. Returns `None` if the
/// object does not exist, `Some(false)` if this reply has no room for it.
fn append(object: u8, model: &impl DataModel, adu: &mut Adu) -> Option<bool> {
    let start = adu.len();
    let bytes = adu.resize(LONGEST);
    let mut text = TextOut::new(bytes.get_mut(start + OBJECT..).unwrap_or_default());
    let exists = is_known(object) && model.identification(object, &mut text);
    let len = text.len().min(MAX_VALUE);
    let end = start + OBJECT + len;
    let fits = exists && end <= LONGEST;
    adu.resize(if fits { end } else { start });
    if fits {
        // Both values are below 254.
        adu.set(start as u8, object);
        adu.set(start as u8 + 1, len as u8);
    }
    exists.then_some(fits)
}

/// Returns whether the object exists.
fn exists(object: u8, model: &impl DataModel) -> bool {
    is_known(object) && model.identification(object, &mut TextOut::new(&mut []))
}

/// Returns whether the number is not reserved.
const fn is_known(object: u8) -> bool {
    object <= LAST_REGULAR || object >= FIRST_EXTENDED
}

/// Returns which kinds of objects the device has; bit 7 says that each can be read individually.
fn conformity(model: &impl DataModel) -> u8 {
    let there = |object| exists(object, model);
    let level = if there(FIRST_EXTENDED) {
        ReadCode::Extended
    } else if (ReadCode::Basic.last() + 1..=LAST_REGULAR).any(there) {
        ReadCode::Regular
    } else {
        ReadCode::Basic
    };
    0x80 | level as u8
}
