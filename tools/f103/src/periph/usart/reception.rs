//! The receiving half of a USART: from the edges of its pin to RXNE and the error flags.

use super::Usart;
use super::bits::{cr1, sr};
use crate::serial::{Framing, Rate, Word};
use crate::time::Time;

impl Usart {
    /// Sets the level at the RX pin to `level` from `at` on. Edges come in order, and before the
    /// [`Peripheral::advance`](crate::peripheral::Peripheral::advance) to or past their instant.
    pub fn receive_edge(&mut self, at: Time, level: bool) {
        self.rx_pin.push(at, level);
        let last = &mut self.last_edges[usize::from(level)];
        *last = [last[1], Some(at)];
    }

    /// Returns whether the receiver is on and waits for a start bit: only then does the next edge at its pin matter
    /// before [`Peripheral::next_event`](crate::peripheral::Peripheral::next_event).
    #[must_use]
    pub fn awaits_start(&self) -> bool {
        self.receiving() && self.receiver.is_idle()
    }

    pub(super) fn receiving(&self) -> bool {
        self.cr1 & (cr1::UE | cr1::RE) == cr1::UE | cr1::RE && self.framing().is_some()
    }

    /// Returns the framing of the receiver; `None` without a clock or with a BRR below 1.
    pub(super) fn framing(&self) -> Option<Framing> {
        (self.hz > 0 && self.brr >= 16).then(|| Framing {
            rate: Rate::from_clock(self.brr, self.hz),
            data_bits: self.data_bits(),
            parity: self.parity(),
            stop_bits: self.stop_bits(),
            sampled_since: Some(self.baud_since),
        })
    }

    pub(super) fn advance_receiver(&mut self, now: Time) {
        let Some(framing) = self.framing().filter(|_| self.receiving()) else {
            self.rx_pin.drop_before(now);
            return;
        };
        while let Some(word) = self.receiver.next_word(&self.rx_pin, &framing, now) {
            self.check_idle(&framing, word.start);
            self.take_word(word);
        }
        self.check_idle(&framing, self.receiver.start().unwrap_or(now));
        // The search for a start bit looks back by three samples.
        let margin = framing.rate.bits(1);
        let mut needed = self.receiver.needs_from().saturating_sub(margin);
        if self.idle_armed {
            needed = needed.min(self.quiet_since);
        }
        self.rx_pin.drop_before(needed);
    }

    /// Takes a complete word (27.3.3).
    fn take_word(&mut self, word: Word) {
        if self.sr & sr::RXNE != 0 {
            // The word is lost and RDR keeps its contents; of the word's errors only the overrun is reported.
            self.sr |= sr::ORE;
        } else {
            self.received = word.data;
            self.sr |= sr::RXNE;
            for (error, flag) in [
                (word.parity_error, sr::PE),
                (word.framing_error, sr::FE),
                (word.noise, sr::NE),
            ] {
                if error {
                    self.sr |= flag;
                }
            }
        }
        self.idle_armed = true;
        self.quiet_since = word.end;
    }

    /// Returns when the line has been high for a whole frame since the last character, going by its edges up
    /// to `until`: the instant of IDLE (27.3.3, "Idle character").
    pub(super) fn idle_at(&self, framing: &Framing, until: Time) -> Option<Time> {
        if !self.idle_armed {
            return None;
        }
        let frame = framing.rate.bits(u64::from(framing.bits()));
        let mut high_since = self
            .rx_pin
            .level_at(self.quiet_since)
            .then_some(self.quiet_since);
        for (edge, level) in self.rx_pin.edges(self.quiet_since, until) {
            if high_since.is_some_and(|since| since + frame <= edge) {
                break;
            }
            high_since = level.then_some(edge);
        }
        high_since.map(|since| since + frame)
    }

    fn check_idle(&mut self, framing: &Framing, until: Time) {
        if self.idle_at(framing, until).is_some_and(|at| at <= until) {
            self.sr |= sr::IDLE;
            self.idle_armed = false;
        }
    }
}
