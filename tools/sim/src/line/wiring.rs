//! The connection of the bus to the board: the driver at the TX pin, and the receiver at the RX pin.

use super::{Direction, HISTORY, Line, Received, Span, frame_silence, keep};
use f103::periph::usart::{Sent, TxPin, Usart, Wire};
use f103::serial::{Framing, Wave, Word};
use f103::time::Time;

/// What keeps the USART's characters from the bus, with the findings: it lasted for a whole character, it ended in the
/// middle of one, or it ended in the first half of a start bit, so that the character arrived.
struct Obstacle {
    lost: &'static str,
    middle: &'static str,
    late: &'static str,
}

const DRIVER_OFF: Obstacle = Obstacle {
    lost: "the USART sent a character while the RS-485 driver was off: it is lost",
    middle: "the RS-485 driver was switched on in the middle of a character",
    late: "the USART began to send before the RS-485 driver was on: the start bit is too short",
};
const NO_PIN: Obstacle = Obstacle {
    lost: "the USART sent a character while its TX pin was not an alternate function",
    middle: "the TX pin became an alternate function in the middle of a character",
    late: "the USART began to send before its TX pin was an alternate function: the start bit is too short",
};

impl Wire for Line {
    fn sent(&mut self, sent: Sent) {
        self.put(sent);
    }

    fn set_tx_pin(&mut self, pin: TxPin, now: Time) {
        if pin != self.tx_pin {
            let now = now.max(self.now);
            self.extend(now);
            self.tx_pin = pin;
            self.connected(&NO_PIN, now);
            self.shared.changed = true;
            self.settle(now);
        }
    }

    fn advance(&mut self, to: Time) {
        self.extend(to);
    }

    fn now(&self) -> Time {
        self.now
    }

    fn take_edges(&mut self) -> Vec<(Time, bool)> {
        std::mem::take(&mut self.rx_edges)
    }

    fn next_edge(&self) -> Option<Time> {
        if self.has_edges() {
            return Some(self.now);
        }
        if self.driver && !self.echo {
            return None;
        }
        let unit = self.driver.then_some(&self.usart);
        [Some(&self.master.wave), Some(&self.noise), unit]
            .into_iter()
            .flatten()
            .chain(self.shared.waves())
            .filter_map(|wave| wave.next_edge(self.now))
            .map(|(at, _)| at)
            .min()
    }

    /// Returns whether an edge of the RX pin waits for the USART.
    fn has_edges(&self) -> bool {
        !self.rx_edges.is_empty()
    }

    /// Returns the level of the receiver's output; high while the receiver is off.
    fn rx_level(&self) -> bool {
        self.rx
    }

    fn caught_up(&mut self, usart: &Usart) {
        if self.shared.is_end() {
            self.forget(self.now.saturating_sub(HISTORY));
            return;
        }
        self.listen();
        if self.follow && self.master_free() == self.now {
            self.settings = usart.settings().unwrap_or(self.settings);
        }
    }
}

impl Line {
    /// Switches the unit's driver on or off at `now`. Call this directly after [`Usart::exchange`].
    pub fn set_driver(&mut self, on: bool, now: Time) {
        if on == self.driver {
            return;
        }
        let now = now.max(self.now);
        self.extend(now);
        let sends = |span: Span| span.start <= now && now < span.end;
        if !on && self.last_sent.is_some_and(sends) {
            let text = "the RS-485 driver was switched off before the end of the last stop bit";
            self.findings.push((now, text));
        }
        self.driver = on;
        self.connected(&DRIVER_OFF, now);
        self.shared.switched(now, on);
        keep(&mut self.driver_edges, (now, on));
        self.settle(now);
    }

    /// Switches the unit's driver off because it has no supply any more, which the firmware cannot prevent.
    pub fn power_off(&mut self, now: Time) {
        self.last_sent = None;
        self.unheard = None;
        self.set_driver(false, now);
    }

    /// Chooses whether the unit receives its echo because its receiver stays on while its driver is on. Off at first,
    /// as with DE and RE connected.
    pub fn set_echo(&mut self, echo: bool) {
        self.echo = echo;
        self.settle(self.now);
    }

    /// Returns whether the unit's driver is on.
    #[must_use]
    pub const fn driver(&self) -> bool {
        self.driver
    }

    /// Returns what keeps the USART's characters from the bus.
    fn obstacle(&self) -> Option<&'static Obstacle> {
        if self.tx_pin != TxPin::Usart {
            Some(&NO_PIN)
        } else if !self.driver {
            Some(&DRIVER_OFF)
        } else {
            None
        }
    }

    /// Reports the part of a character that was kept from the bus, if `obstacle` has ended at `now` as the last one.
    fn connected(&mut self, obstacle: &Obstacle, now: Time) {
        if self.obstacle().is_some() {
            return;
        }
        let unheard = self.unheard.take();
        // Nothing was missing of a character that begins now or later.
        if self
            .last_sent
            .is_none_or(|span| now <= span.start || span.end <= now)
        {
            return;
        }
        let is_late = unheard.is_some_and(|character| (now - character.start) * 2 < character.bit);
        let text = if is_late {
            obstacle.late
        } else {
            obstacle.middle
        };
        self.findings.push((now, text));
    }

    /// Reports a character that has ended by `now` and was kept from the bus for all of its time.
    fn report_lost(&mut self, now: Time) {
        let ended = self.last_sent.is_some_and(|span| span.end <= now);
        if let Some(character) = self.unheard.take_if(|_| ended) {
            let obstacle = self.obstacle().unwrap_or(&DRIVER_OFF);
            self.findings.push((character.start, obstacle.lost));
        }
    }

    /// Takes over the output of the unit's USART at its TX pin.
    fn put(&mut self, sent: Sent) {
        self.shared.changed = true;
        sent.put_on(&mut self.usart);
        match sent {
            Sent::Character(character) => {
                self.report_lost(character.start);
                self.last_sent = Some(Span {
                    start: character.start,
                    end: character.end(),
                });
                self.unheard = self.obstacle().map(|_| character);
            }
            Sent::Cut(at) => {
                if let Some(span) = &mut self.last_sent {
                    span.end = span.end.min(at);
                }
            }
        }
    }

    /// Computes the waves of the unit, the bus and the RX pin up to `to`. The driver does not change until then.
    pub(super) fn extend(&mut self, to: Time) {
        self.collide(to);
        // Something may have been queued or sent at the present instant.
        self.settle(self.now);
        loop {
            let next = [&self.master.wave, &self.noise, &self.usart]
                .into_iter()
                .chain(self.shared.waves())
                .filter_map(|wave: &Wave| wave.next_edge(self.now))
                .map(|(at, _)| at)
                .min()
                .filter(|&at| at <= to);
            let Some(at) = next else { break };
            self.now = at;
            self.settle(at);
        }
        self.now = self.now.max(to);
        self.report_lost(self.now);
    }

    /// Computes the levels at `at`. No later instant is known.
    pub(super) fn settle(&mut self, at: Time) {
        let unit = !self.driver
            || match self.tx_pin {
                TxPin::Usart => self.usart.level_at(at),
                TxPin::Level(level) => level,
            };
        let others = self.shared.level_at(at);
        let level = self.master.wave.level_at(at) && unit && others;
        let bus = level == self.noise.level_at(at);
        let rx = bus || (self.driver && !self.echo);
        // On the bus, the wave of the unit is that of all units, so that the record attributes their characters to
        // `Response`. At an end of the line it is the wave of that unit only.
        let unit = if self.shared.is_end() {
            unit
        } else {
            unit && others
        };
        self.unit.push(at, unit);
        self.bus.push(at, bus);
        if rx != self.rx {
            self.rx = rx;
            self.rx_edges.push((at, rx));
        }
    }

    /// Records collisions from now to `to`: the master sends while the unit's driver is on.
    fn collide(&mut self, to: Time) {
        while self
            .master
            .sending
            .front()
            .is_some_and(|span| span.end <= self.now)
        {
            self.master.sending.pop_front();
        }
        if self.shared.is_bus() {
            self.collide_units(to);
            return;
        }
        if !self.driver {
            return;
        }
        for span in &self.master.sending {
            let (start, end) = (span.start.max(self.now), span.end.min(to));
            if start >= end {
                continue;
            }
            match self.collisions.back_mut() {
                Some(last) if last.end == start => last.end = end,
                _ => keep(&mut self.collisions, Span { start, end }),
            }
        }
    }

    /// Records every character that was received up to now. Drops edges that are not needed any more.
    pub(super) fn listen(&mut self) {
        let framing = Framing::of(self.settings);
        let silence = frame_silence(self.settings);
        while let Some(word) = self.listener.next_word(&self.bus, &framing, self.now) {
            let word = Word {
                data: framing.payload(word.data),
                ..word
            };
            self.record_word(&word, silence);
        }
        let quiet_until = self.listener.start().unwrap_or(self.now);
        self.record.quiet(quiet_until, silence);
        let mut oldest = self.now.saturating_sub(HISTORY);
        if let Some(start) = self.listener.start() {
            oldest = oldest.min(start.saturating_sub(framing.rate.bits(1)));
        }
        self.forget(oldest);
    }

    /// Drops what happened before `oldest`.
    fn forget(&mut self, oldest: Time) {
        for wave in [
            &mut self.master.wave,
            &mut self.noise,
            &mut self.usart,
            &mut self.unit,
            &mut self.bus,
        ] {
            wave.drop_before(oldest);
        }
        self.shared.drop_before(oldest);
    }

    /// Adds a word to the record, and to the characters that the master has received.
    fn record_word(&mut self, word: &Word, silence: Time) {
        let unit = self.unit.low_between(word.start, word.at);
        let master = self.master.wave.low_between(word.start, word.at);
        let collided = unit && master || self.shared.senders(word.start, word.at) > 1;
        let unit_began = unit && (!master || self.master.wave.level_at(word.start));
        let direction = if unit_began {
            Direction::Response
        } else {
            Direction::Request
        };
        self.record.word(word, direction, collided, silence);
        if unit {
            let received = Received {
                byte: word.data as u8,
                start: word.start,
                end: word.end,
                parity_error: word.parity_error,
                framing_error: word.framing_error,
                noise: word.noise,
                collided,
            };
            keep(&mut self.received, received);
        }
    }
}
