//! The sub-functions of function 08, diagnostics (V1.1b3 6.8).

use crate::Exception;
use crate::line::Framing;

/// A request of function 08 with a valid form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Diagnostic {
    /// 00: return the data.
    Echo,
    /// 01: restart communication, which also ends listen-only mode.
    Restart {
        /// Data FF00: also clear the event log.
        clear_log: bool,
    },
    /// 02: return the diagnostic register.
    Register,
    /// 03: change the character that ends an ASCII frame.
    Delimiter(u8),
    /// 04: enter listen-only mode, without a reply.
    ListenOnly,
    /// 0A: clear the counters.
    Clear,
    /// 0B to 12: return the counter at this index of [`Counters::as_words`](crate::Counters::as_words).
    Counter(u8),
    /// 14: clear the counter of character overruns.
    ClearOverruns,
}

/// Sub-function 01.
const RESTART: u8 = 0x01;
/// Sub-function 04.
const LISTEN_ONLY: u8 = 0x04;
/// The first sub-function that returns a counter.
const FIRST_COUNTER: u8 = 0x0B;

impl Diagnostic {
    /// Decodes the bytes after the function code.
    ///
    /// # Errors
    /// 01 for a sub-function that is not supported: 03 needs ASCII mode. 03 for data or a length that is not allowed.
    pub(crate) fn decode(fields: &[u8], framing: Framing) -> Result<Self, Exception> {
        let &[high, sub, ref data @ ..] = fields else {
            return Err(Exception::IllegalDataValue);
        };
        if high != 0 {
            return Err(Exception::IllegalFunction);
        }
        let diagnostic = match sub {
            // The data may have any length.
            0x00 => return Ok(Self::Echo),
            RESTART => match data {
                [0xFF, 0x00] => return Ok(Self::Restart { clear_log: true }),
                _ => Self::Restart { clear_log: false },
            },
            0x02 => Self::Register,
            0x03 if framing != Framing::Rtu => match *data {
                [delimiter, 0x00] if Framing::can_end_with(delimiter) => {
                    return Ok(Self::Delimiter(delimiter));
                }
                _ => return Err(Exception::IllegalDataValue),
            },
            LISTEN_ONLY => Self::ListenOnly,
            0x0A => Self::Clear,
            FIRST_COUNTER..=0x12 => Self::Counter(sub - FIRST_COUNTER),
            0x14 => Self::ClearOverruns,
            _ => return Err(Exception::IllegalFunction),
        };
        match data {
            [0x00, 0x00] => Ok(diagnostic),
            _ => Err(Exception::IllegalDataValue),
        }
    }

    /// Returns whether the sub-function changes nothing.
    pub(crate) const fn only_reads(self) -> bool {
        match self {
            Self::Echo | Self::Register | Self::Counter(_) => true,
            Self::Restart { .. }
            | Self::Delimiter(_)
            | Self::ListenOnly
            | Self::Clear
            | Self::ClearOverruns => false,
        }
    }

    /// Returns whether the bytes after function code 08 restart communication.
    pub(crate) const fn is_restart(fields: &[u8]) -> bool {
        matches!(fields, [0x00, RESTART, 0x00 | 0xFF, 0x00])
    }

    /// Returns whether the bytes after function code 08 start listen-only mode, which is never answered.
    pub(crate) const fn is_listen_only(fields: &[u8]) -> bool {
        matches!(fields, [0x00, LISTEN_ONLY, 0x00, 0x00])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_short_checks_agree_with_decode() {
        for sub in 0..=0x20 {
            for data in [[0, 0], [0xFF, 0], [0, 1], [1, 0], [0xFF, 0xFF]] {
                for fields in [&[0, sub, data[0], data[1]][..], &[0, sub, data[0]]] {
                    let decoded = Diagnostic::decode(fields, Framing::Rtu);
                    let restarts = matches!(decoded, Ok(Diagnostic::Restart { .. }));
                    assert_eq!(Diagnostic::is_restart(fields), restarts, "{fields:02X?}");
                    assert_eq!(
                        Diagnostic::is_listen_only(fields),
                        decoded == Ok(Diagnostic::ListenOnly),
                        "{fields:02X?}"
                    );
                }
            }
        }
    }
}
