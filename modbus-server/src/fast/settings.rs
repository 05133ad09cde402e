//! Sub-function 18: which points report events.

use super::sub;
use crate::{Adu, Exception};

/// How a point reports its events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Setting {
    /// Not.
    #[default]
    Off,
    /// With low priority.
    Low,
    /// With high priority: in an arbitration before all low ones.
    High,
}

/// Checks a request to switch the events of points on and off: `data` are the bytes after the function code of a request
/// to the unit's own address.
///
/// # Errors
/// 01 for another sub-function; 03 if the length, a range or a setting is wrong.
pub fn check_settings(data: &[u8]) -> Result<(), Exception> {
    let [sub::SETTINGS, rest @ ..] = data else {
        return Err(Exception::IllegalFunction);
    };
    let (count, mut ranges) = rest.split_first().ok_or(Exception::IllegalDataValue)?;
    let is_whole = usize::from(*count) == ranges.len();
    while let Some((range, after)) = first_of(ranges) {
        if range.settings.iter().any(|setting| *setting > 2) {
            return Err(Exception::IllegalDataValue);
        }
        ranges = after;
    }
    if is_whole && ranges.is_empty() {
        Ok(())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// Makes each setting of a request that [`check_settings`] has accepted, and makes its buffer the reply: a bit for each
/// point, set if it reports events now. `set` takes kind, id and setting of a point, and returns that bit.
pub fn apply_settings(adu: &mut Adu, mut set: impl FnMut(u8, u16, Setting) -> bool) {
    // The reply replaces the request from the front, because it is shorter.
    let (mut read, mut written) = (4_u8, 4_u8);
    while let Some((range, _)) = first_of(adu.from(read)) {
        let (kind, first, count) = (range.kind, range.first, range.settings.len() as u8);
        read += 4;
        let mut mask = 0;
        for n in 0..count {
            let setting = match adu.get(read) {
                0 => Setting::Off,
                1 => Setting::Low,
                _ => Setting::High,
            };
            read = read.wrapping_add(1);
            mask |= u8::from(set(kind, first.wrapping_add(n.into()), setting)) << (n % 8);
            if n % 8 == 7 || n + 1 == count {
                adu.set(written, core::mem::take(&mut mask));
                written += 1;
            }
        }
    }
    adu.set(3, written - 4);
    adu.truncate(written.into());
}

/// A range of points and the settings for them.
struct Range<'a> {
    kind: u8,
    first: u16,
    settings: &'a [u8],
}

/// Returns the first range and the bytes after it.
fn first_of(ranges: &[u8]) -> Option<(Range<'_>, &[u8])> {
    let [kind, high, low, count, rest @ ..] = ranges else {
        return None;
    };
    let (settings, rest) = rest.split_at_checked((*count).into())?;
    let first = u16::from_be_bytes([*high, *low]);
    Some((
        Range {
            kind: *kind,
            first,
            settings,
        },
        rest,
    ))
}
