//! The events of a module, in the order of their times.

use super::Module;
use crate::radio::command::Command;
use crate::radio::packet::{News, Packet, Sender};
use crate::radio::parameters::{Mode, SLEEP_UART};
use crate::radio::timing;
use f103::serial::Word;
use f103::time::Time;

/// Most bytes that can be a command.
const LONGEST_COMMAND: usize = 6;

impl Module {
    /// Returns the instant of the next event; never before the present.
    pub(crate) fn next_event(&self) -> Option<Time> {
        if !self.works() {
            return None;
        }
        let idle = self.uart.is_idle();
        let sent = self.uart.sent_until();
        let silent = (idle && !self.collected.is_empty()).then_some(self.silent_at);
        [
            self.ready_at,
            self.uart.next_event(),
            (sent > self.now).then_some(sent),
            silent,
            self.command.map(|(at, _)| at),
            self.sending.next_event(idle),
            self.antenna.next_event(),
            self.mode_change(),
        ]
        .into_iter()
        .flatten()
        .min()
        .map(|at| at.max(self.now))
    }

    /// Computes the module up to `to`.
    pub(crate) fn advance(&mut self, to: Time) {
        while let Some(at) = self.next_event().filter(|&at| at <= to) {
            self.now = at;
            self.act(at);
        }
        self.now = self.now.max(to);
        self.uart.forget(self.now);
        if self.sender != Sender::Gateway {
            // Nothing reads the bytes that the module of a board has sent to the part. Drop them.
            self.uart.take_sent(self.now);
        }
    }

    /// Handles the events that are due at `now`.
    fn act(&mut self, now: Time) {
        if self.ready_at.is_some_and(|at| at <= now) {
            self.ready_at = None;
            self.enter(self.wanted, now);
        }
        while let Some(word) = self.uart.next_word(now) {
            self.take(word);
        }
        if let Some((_, command)) = self.command.take_if(|(at, _)| *at <= now) {
            self.carry_out(command);
        }
        let silent = self.uart.is_idle() && self.silent_at <= now;
        if silent && !self.collected.is_empty() {
            let command = Command::of(&core::mem::take(&mut self.collected));
            self.command = command.map(|command| (now + command.duration(), command));
        }
        if let Some(at) = self.sending.end(now) {
            self.antenna.listen(at);
        }
        self.receive(now);
        self.send(now);
        let idle = self.is_idle();
        self.idle_since = idle.then(|| self.idle_since.unwrap_or(now));
        if self.mode_change().is_some_and(|at| at <= now) {
            self.change_mode(now);
        }
    }

    /// Takes a byte from the UART.
    fn take(&mut self, word: Word) {
        let silent_at = word.end + self.uart.bytes(timing::SILENCE_BYTES);
        let byte = word.data as u8;
        if self.mode.is_some_and(Mode::sends) {
            self.sending.put(byte, silent_at);
        } else if self.command.is_none() && self.uart.sent_until() <= self.now {
            self.silent_at = silent_at;
            // One byte too many makes it no command.
            if self.collected.len() <= LONGEST_COMMAND {
                self.collected.push(byte);
            }
        }
    }

    /// Carries out a command whose time is over.
    fn carry_out(&mut self, command: Command) {
        if command == Command::Reset {
            self.stop();
            self.start();
            return;
        }
        let answer = self.memory.carry_out(command);
        self.uart.send(self.now, answer);
    }

    /// Receives the packets that are due.
    fn receive(&mut self, now: Time) {
        while let Some(packet) =
            self.antenna
                .receive(self.sender, self.mode, self.memory.in_force, now)
        {
            self.received += 1;
            let room = timing::BUFFER_BYTES.saturating_sub(self.uart.waiting(now));
            let bytes = packet.bytes.into_iter().take(room);
            self.uart.send(now + timing::OUTPUT_DELAY, bytes);
        }
    }

    /// Begins to send the packet that is due.
    fn send(&mut self, now: Time) {
        if !self.mode.is_some_and(Mode::sends) {
            return;
        }
        let Some(bytes) = self.sending.next_packet(self.uart.is_idle(), now) else {
            return;
        };
        self.sent += 1;
        let parameters = self.memory.in_force;
        let wake_up = match self.mode {
            Some(Mode::WakeUp) => parameters.wake_up(),
            _ => Time::ZERO,
        };
        let packet = Packet::new(
            self.corner,
            self.sender,
            self.sent,
            now,
            parameters,
            wake_up,
            bytes,
        );
        self.sending.begin(packet.end);
        self.antenna.stop();
        self.news.push(News::Begun(packet));
    }

    /// Returns the instant at which the module takes over the mode of its pins. `None` if it is in force, or while the
    /// module is busy.
    fn mode_change(&self) -> Option<Time> {
        let idle_since = self.idle_since?;
        let differs = self.mode.is_some_and(|mode| mode != self.wanted);
        let at = (self.wanted_since + timing::MODE_DELAY).max(idle_since + timing::MODE_AFTER_AUX);
        differs.then_some(at)
    }

    /// Takes over the mode of the pins.
    fn change_mode(&mut self, now: Time) {
        if self.mode == Some(Mode::Sleep) {
            self.mode = None;
            self.uart.set(SLEEP_UART, false, now);
            self.ready_at = Some(now + timing::RECONFIGURATION);
            self.idle_since = None;
        } else {
            self.enter(self.wanted, now);
        }
    }
}
