//! A UART that is connected to one of the part: samples the level at RXD, and sends characters at TXD.

use std::collections::VecDeque;

use crate::radio::SLEEP_UART;
use f103::periph::usart::{Sent, TxPin};
use f103::serial::{Character, Framing, Receiver, Settings, Wave, Word};
use f103::time::Time;

/// A byte that was sent at TXD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Byte {
    /// The byte.
    pub byte: u8,
    /// Start of the start bit.
    pub start: Time,
    /// End of the stop bit.
    pub end: Time,
}

/// The UART.
#[derive(Clone, Debug)]
pub(crate) struct Uart {
    settings: Settings,
    /// Whether the receiver is on.
    open: bool,
    /// Level of the transmitter that is connected to RXD, with the characters that it has begun.
    host: Wave,
    pin: TxPin,
    /// Level at RXD.
    rxd: Wave,
    receiver: Receiver,
    /// Level at TXD, with the characters that are to be sent.
    txd: Wave,
    /// End of the last character at TXD.
    sent_until: Time,
    /// Bytes at TXD that were not taken, those to be sent included.
    sent: VecDeque<Byte>,
    /// Edges of TXD up to this instant have been taken.
    taken: Time,
}

impl Default for Uart {
    fn default() -> Self {
        Self {
            settings: SLEEP_UART,
            open: false,
            host: Wave::default(),
            pin: TxPin::Level(true),
            rxd: Wave::default(),
            receiver: Receiver::default(),
            txd: Wave::default(),
            sent_until: Time::ZERO,
            sent: VecDeque::new(),
            taken: Time::ZERO,
        }
    }
}

impl Uart {
    /// Returns the duration of `n` bytes.
    pub(crate) fn bytes(&self, n: u64) -> Time {
        self.settings.characters(n)
    }

    /// Switches the receiver on or off, with this rate and format. A character that is being received is lost if one of
    /// them changes.
    pub(crate) fn set(&mut self, settings: Settings, open: bool, now: Time) {
        if (settings, open) != (self.settings, self.open) {
            self.settings = settings;
            self.open = open;
            self.receiver = Receiver::listening_from(now);
        }
    }

    /// Takes over what the transmitter at RXD has sent.
    pub(crate) fn put_in(&mut self, sent: Sent) {
        sent.put_on(&mut self.host);
        if self.pin == TxPin::Usart {
            sent.put_on(&mut self.rxd);
        }
    }

    /// Notes that the pin of the transmitter at RXD is driven like this from `now` on.
    pub(crate) fn set_pin(&mut self, pin: TxPin, now: Time) {
        if pin == self.pin {
            return;
        }
        self.pin = pin;
        self.rxd.truncate(now);
        match pin {
            TxPin::Level(level) => self.rxd.push(now, level),
            TxPin::Usart => {
                self.rxd.push(now, self.host.level_at(now));
                for (at, level) in self.host.edges(now, Time::MAX) {
                    self.rxd.push(at, level);
                }
            }
        }
    }

    /// Returns the next word that was received by `now`, without its parity bit.
    pub(crate) fn next_word(&mut self, now: Time) -> Option<Word> {
        if !self.open {
            return None;
        }
        let framing = Framing::of(self.settings);
        let word = self.receiver.next_word(&self.rxd, &framing, now)?;
        Some(Word {
            data: framing.payload(word.data),
            ..word
        })
    }

    /// Returns whether no character is being received.
    pub(crate) fn is_idle(&self) -> bool {
        self.receiver.is_idle()
    }

    /// Returns the instant at which a character begins or is complete.
    pub(crate) fn next_event(&self) -> Option<Time> {
        if !self.open {
            return None;
        }
        let due = self.receiver.due(&Framing::of(self.settings));
        // While the receiver is idle, `needs_from` is where it searches for a start bit.
        due.or_else(|| self.rxd.next_fall(self.receiver.needs_from()))
    }

    /// Sends bytes at TXD from `at` on, or after those that are still to be sent.
    pub(crate) fn send(&mut self, at: Time, bytes: impl IntoIterator<Item = u8>) {
        let first = at.max(self.sent_until);
        for (byte, n) in bytes.into_iter().zip(0..) {
            let (start, end) = (first + self.bytes(n), first + self.bytes(n + 1));
            let character = Character::new(self.settings, byte).at(start);
            self.txd.push_character(&character);
            self.sent.push_back(Byte { byte, start, end });
            self.sent_until = end;
        }
    }

    /// Returns the end of the last byte at TXD.
    pub(crate) const fn sent_until(&self) -> Time {
        self.sent_until
    }

    /// Returns the number of bytes at TXD that do not begin before `now`.
    pub(crate) fn waiting(&self, now: Time) -> usize {
        let waiting = self.sent.iter().rev();
        waiting.take_while(|byte| byte.start >= now).count()
    }

    /// Ends all sending from `now` on: TXD goes high.
    pub(crate) fn cut(&mut self, now: Time) {
        self.txd.truncate(now);
        self.txd.push(now, true);
        while self.sent.back().is_some_and(|byte| byte.end > now) {
            self.sent.pop_back();
        }
        self.sent_until = self.sent_until.min(now);
    }

    /// Removes and returns the bytes at TXD that have ended by `now`.
    pub(crate) fn take_sent(&mut self, now: Time) -> Vec<Byte> {
        let count = self.sent.partition_point(|byte| byte.end <= now);
        self.sent.drain(..count).collect()
    }

    /// Returns the level at TXD.
    pub(crate) fn txd(&self, now: Time) -> bool {
        self.txd.level_at(now)
    }

    /// Returns the next edge at TXD after the edges that were taken.
    pub(crate) fn next_edge(&self) -> Option<Time> {
        self.txd.next_edge(self.taken).map(|(at, _)| at)
    }

    /// Removes and returns the edges at TXD up to `now`.
    pub(crate) fn take_edges(&mut self, now: Time) -> Vec<(Time, bool)> {
        let edges = self.txd.edges(self.taken, now).collect();
        self.taken = self.taken.max(now);
        edges
    }

    /// Drops what is not needed after `now`.
    pub(crate) fn forget(&mut self, now: Time) {
        if [&self.host, &self.rxd, &self.txd]
            .iter()
            .all(|wave| wave.is_empty())
        {
            return;
        }
        let margin = Framing::of(self.settings).rate.bits(1);
        let needed = if self.open {
            self.receiver.needs_from().min(now)
        } else {
            now
        };
        self.rxd.drop_before(needed.saturating_sub(margin));
        self.host.drop_before(now);
        self.txd.drop_before(self.taken.min(now));
    }
}
