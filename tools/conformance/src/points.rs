//! Reads, writes and restores the unit's points for a case, by the functions that the unit has.

use std::fmt::Display;
use std::time::Duration;

pub use modbus_line::adu::{pdu, words_of, write_words};
use register_map::configuration::{KEY, OPEN_S, OPENING_KEY};

use crate::case::{Check, Stop};
use crate::target::{Span, Words};
use crate::tester::Tester;

/// Interval at which a unit is asked whether its configuration lock has closed.
const LOCK_INTERVAL: Duration = Duration::from_secs(1);

/// Returns a request of function 08.
pub fn diagnose(sub: u16, data: &[u8]) -> Vec<u8> {
    [&[8], &sub.to_be_bytes()[..], data].concat()
}

/// Returns a write of several coils, 0x0F; the padding bits of the last byte are `padding`.
pub fn write_bits(address: u16, values: &[bool], padding: bool) -> Vec<u8> {
    let mut request = pdu(0x0F, address, values.len() as u16);
    request.push(values.len().div_ceil(8) as u8);
    request.extend(values.chunks(8).map(|chunk| {
        (0..8).fold(0_u8, |byte, n| {
            let bit = chunk.get(n).copied().unwrap_or(padding);
            byte | u8::from(bit) << n
        })
    }));
    request
}

/// The values of the points that cases write to, before a case.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Snapshot {
    bits: Option<Vec<bool>>,
    words: Option<Vec<u16>>,
}

impl Tester<'_> {
    /// Coils to write to.
    pub fn bits(&self) -> Check<Span> {
        let lacking = || Stop::Skip("no coil to write to".to_owned());
        self.target.bits.ok_or_else(lacking)
    }

    /// Returns the registers to write to.
    pub fn words(&self) -> Check<Words> {
        let lacking = || Stop::Skip("no register to write to".to_owned());
        self.target.words.ok_or_else(lacking)
    }

    /// Returns a value that the registers to write to refuse.
    pub fn refused_value(&self) -> Check<u16> {
        let lacking = || Stop::Skip("no value is known that is refused".to_owned());
        self.words()?.refused.ok_or_else(lacking)
    }

    /// Returns the longest run that a function (1 to 4) reads.
    pub fn readable(&self, function: u8) -> Check<Span> {
        let lacking = || Stop::Skip(format!("nothing to read by function {function:02X}"));
        self.target.longest(function).ok_or_else(lacking)
    }

    /// Returns an address that a function (1 to 4) cannot read.
    pub fn nowhere(&self, function: u8) -> Check<u16> {
        let lacking = || Stop::Skip("every address exists".to_owned());
        self.target.nowhere(function).ok_or_else(lacking)
    }

    /// Returns the addresses next to what a function (1 to 4) reads, and 0xFFFF, as far as the function cannot read
    /// them.
    pub fn outside(&self, function: u8) -> Vec<u16> {
        let spans = self.target.readable(function);
        let mut outside = vec![0xFFFF];
        for span in spans {
            outside.extend(span.last.checked_add(1));
            outside.extend(span.first.checked_sub(1));
        }
        outside.retain(|address| !spans.iter().any(|span| span.has(*address)));
        outside
    }

    /// Checks the values of registers. `wanted` describes them.
    pub fn words_are(&mut self, span: Span, values: &[u16], wanted: impl Display) -> Check {
        let now = self.read_words(span)?;
        self.ensure(now == values, wanted)
    }

    /// Checks that a register still has this value.
    pub fn word_is(&mut self, address: u16, value: u16) -> Check {
        let wanted = format!("register {address:04X} still is {value:04X}");
        self.words_are(Span::one(address), &[value], wanted)
    }

    /// Checks the states of coils. `wanted` describes them.
    pub fn bits_are(&mut self, span: Span, states: &[bool], wanted: impl Display) -> Check {
        let now = self.read_bits(span)?;
        self.ensure(now == states, wanted)
    }

    /// Checks that coils are still off.
    pub fn is_off(&mut self, coils: Span) -> Check {
        let now = self.read_bits(coils)?;
        self.ensure(!now.contains(&true), "the coil is still off")
    }

    /// Reads coils by function 01, at most 2000.
    pub fn read_bits(&mut self, span: Span) -> Check<Vec<bool>> {
        let count = span.len() as usize;
        let reply = self.reply(&pdu(1, span.first, count as u16))?;
        let right = reply.len() == 2 + count.div_ceil(8);
        self.ensure(right, format!("the reply holds {count} coils"))?;
        let bit = |n: usize| reply[2 + n / 8] >> (n % 8) & 1 == 1;
        Ok((0..count).map(bit).collect())
    }

    /// Reads registers by function 03, at most 125.
    pub fn read_words(&mut self, span: Span) -> Check<Vec<u16>> {
        let count = span.len() as usize;
        let reply = self.reply(&pdu(3, span.first, count as u16))?;
        let right = reply.len() == 2 + count * 2 && reply[1] as usize == count * 2;
        self.ensure(right, format!("the reply holds {count} registers"))?;
        Ok(words_of(&reply))
    }

    /// Reads one register by function 03.
    pub fn read_word(&mut self, address: u16) -> Check<u16> {
        let one = Span::one(address);
        Ok(self.read_words(one)?[0])
    }

    /// Sets coils from `first` on, by 0F or 05.
    pub fn set_bits(&mut self, first: u16, values: &[bool]) -> Check {
        if self.target.has(0x0F) {
            return self.reply(&write_bits(first, values, false)).map(drop);
        }
        for (address, value) in (first..).zip(values) {
            let value = if *value { 0xFF00 } else { 0 };
            self.reply(&pdu(5, address, value))?;
        }
        Ok(())
    }

    /// Sets registers from `first` on, by 10 or 06.
    pub fn set_words(&mut self, first: u16, values: &[u16]) -> Check {
        if self.target.has(0x10) {
            return self.reply(&write_words(first, values)).map(drop);
        }
        for (address, value) in (first..).zip(values) {
            self.reply(&pdu(6, address, *value))?;
        }
        Ok(())
    }

    /// Opens a modio's configuration lock.
    pub fn unlock(&mut self) -> Check {
        self.reply(&pdu(6, KEY, OPENING_KEY)).map(drop)
    }

    /// Waits until a modio's configuration lock is closed. A case before may have opened it.
    pub fn wait_for_lock(&mut self) -> Check {
        let open = Duration::from_secs(OPEN_S.into());
        // Where time is not exact, the unit may be a simulator that is slower than its clock.
        let latest = self.endpoint.now() + self.exact(open, open * 4) + LOCK_INTERVAL;
        while self.read_word(KEY)? != 0 {
            let in_time = self.endpoint.now() < latest;
            self.ensure(
                in_time,
                format!("the lock closes {open:?} after the last write"),
            )?;
            self.rest(LOCK_INTERVAL)?;
        }
        Ok(())
    }

    /// Reads the values of the points that cases write to.
    pub fn snapshot(&mut self) -> Check<Snapshot> {
        let mut snapshot = Snapshot::default();
        if let Some(span) = self.target.bits.filter(|_| self.target.has(1)) {
            snapshot.bits = Some(self.read_bits(span)?);
        }
        if let Some(words) = self.target.words.filter(|_| self.target.has(3)) {
            snapshot.words = Some(self.read_words(words.span)?);
        }
        Ok(snapshot)
    }

    /// Restores the points whose values have changed.
    pub fn restore(&mut self, before: &Snapshot) -> Check {
        let now = self.snapshot()?;
        if let (Some(bits), Some(span)) = (&before.bits, self.target.bits)
            && now.bits != before.bits
        {
            self.set_bits(span.first, bits)?;
        }
        if let (Some(values), Some(words)) = (&before.words, self.target.words)
            && now.words != before.words
        {
            if words.locked {
                self.unlock()?;
            }
            self.set_words(words.span.first, values)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_those_of_the_standard() {
        // V1.1b3, 6.11 and 6.12: the worked examples.
        let coils = [1, 0, 1, 1, 0, 0, 1, 1, 1, 0].map(|bit| bit == 1);
        assert_eq!(
            write_bits(0x13, &coils, false),
            [0x0F, 0, 0x13, 0, 0x0A, 2, 0xCD, 1]
        );
        assert_eq!(write_bits(0x13, &coils, true)[7], 0xFD);
        assert_eq!(
            write_words(1, &[0x0A, 0x0102]),
            [0x10, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2]
        );
        assert_eq!(words_of(&[3, 4, 1, 2, 3, 4]), [0x0102, 0x0304]);
        assert!(words_of(&[3]).is_empty());
    }
}
