//! Times in the protocol: microseconds with at most three decimals.

use std::fmt;
use std::time::Duration;

/// Writes a time in microseconds with three decimals, truncated to nanoseconds.
pub(crate) struct Micros(pub(crate) Duration);

impl fmt::Display for Micros {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ns = self.0.as_nanos();
        write!(f, "{}.{:03}", ns / 1000, ns % 1000)
    }
}

/// Parses a time in microseconds with at most three decimals.
///
/// # Errors
///
/// A line of text when the text is not such a number.
pub(crate) fn parse(text: &str) -> Result<Duration, String> {
    let wrong = || format!("{text:?} is not a time in microseconds, such as 4010 or 4010.417");
    let (whole, decimals) = text.split_once('.').unwrap_or((text, "0"));
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if !digits(whole) || !digits(decimals) || decimals.len() > 3 {
        return Err(wrong());
    }
    let ns: u64 = format!("{decimals:0<3}").parse().map_err(|_| wrong())?;
    let us: u64 = whole.parse().map_err(|_| wrong())?;
    us.checked_mul(1000)
        .and_then(|us| us.checked_add(ns))
        .map(Duration::from_nanos)
        .ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_times_are_restored_to_the_nanosecond() {
        for ns in [0, 1, 999, 1000, 4_010_417, u64::from(u32::MAX) * 1000] {
            let time = Duration::from_nanos(ns);
            assert_eq!(parse(&Micros(time).to_string()), Ok(time));
        }
        assert_eq!(parse("12"), Ok(Duration::from_micros(12)));
        assert_eq!(parse("0.5"), Ok(Duration::from_nanos(500)));
    }

    #[test]
    fn texts_that_are_not_times_are_rejected() {
        let wrong = "|.|1.|.5|-1|+1|1e3|1.2345|1,5|99999999999999999999";
        for text in wrong.split('|') {
            assert!(parse(text).unwrap_err().contains(text), "{text}");
        }
    }
}
