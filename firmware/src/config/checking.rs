//! Which registers of the configuration can be read, and which values can be written.

use modbus_server::{Exception, Span, Words};
use register_map::board::Board;
use register_map::codes::Command;
use register_map::configuration::{
    COMMAND, FORMAT, KEY, LORA, LORA_FRAME_GAP, MODE, MODULE, RANGE, UNIT,
};
use register_map::{Run, Runs, points, runs, stage};

use super::links::Links;
use super::settings::{format_suits_mode, is_behind, port_of};
use super::{Config, HEARTBEAT_ALONE};

/// Checks whether registers behind the links exist. The first one does.
///
/// # Errors
///
/// Exception 02 when the span goes beyond the end of its block: DEADBAND, or the stage.
fn check_behind<B: Board>(span: Span) -> Result<(), Exception> {
    let block_end = if span.start() < stage::DEAD_TIME {
        stage::DEAD_TIME
    } else {
        B::ROW.behind_links().end
    };
    if span.end() <= block_end.into() {
        Ok(())
    } else {
        Err(Exception::IllegalDataAddress)
    }
}

impl<B: Board> Config<B> {
    /// Checks whether these registers can be read.
    ///
    /// # Errors
    ///
    /// Exception 02 when the span contains a gap, or a register that the board does not have.
    pub fn check_read(&self, span: Span) -> Result<(), Exception> {
        match runs(B::ROW.rules(), span.start(), span.count()) {
            _ if Links::<B>::contain(span.start()) => self.check_links(span),
            _ if is_behind::<B>(span.start()) => check_behind::<B>(span),
            Some(_) if self.has(span) => Ok(()),
            _ => Err(Exception::IllegalDataAddress),
        }
    }

    /// Returns whether the board has these registers, which are not in a gap.
    fn has(&self, span: Span) -> bool {
        let has = |first: u16, last: u16| u32::from(first) < span.end() && span.start() <= last;
        let lacks_unit = B::ROW.switch;
        !(lacks_unit && has(UNIT, UNIT)) && (B::ROW.has_radio() || !has(LORA, LORA_FRAME_GAP))
    }

    /// Returns whether the board has these registers, and lets them be written.
    fn lets_write(&self, span: Span) -> bool {
        let fixed = |address| port_of(address).is_some_and(|port| !B::ROW.chooses(port));
        self.has(span) && (B::ROW.is_modular() || !span.addresses().any(fixed))
    }

    /// Checks whether these registers can be written with these values.
    ///
    /// # Errors
    ///
    /// The first of these exceptions that applies:
    ///
    /// - 02: the registers have a gap, or a MODULE belongs to a port that is part of the board.
    /// - 03: a value is not allowed. This includes a setting by point that does not suit the module written last, and a
    ///   FORMAT with seven data bits in RTU mode.
    /// - 06: the request is a broadcast over the air, or its line may not write the configuration.
    /// - 06: the lock is closed for this line, and the request does not write KEY alone.
    /// - 06: the request orders a save while another save runs, or while no save is left in the budget.
    ///
    /// A write of HEARTBEAT alone is always allowed.
    pub fn check_write(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        if span == HEARTBEAT_ALONE {
            return Ok(());
        }
        let suits = if Links::<B>::contain(span.start()) {
            self.check_links(span)?;
            self.suits_the_links(span, words)
        } else if is_behind::<B>(span.start()) {
            check_behind::<B>(span)?;
            let mut values = span.addresses().zip(words.iter());
            values.all(|(address, value)| stage::allows(address, value))
        } else {
            let runs = runs(B::ROW.rules(), span.start(), span.count());
            let runs = runs.filter(|_| self.lets_write(span));
            let runs = runs.ok_or(Exception::IllegalDataAddress)?;
            self.suit(runs, words) && self.suits_the_mode(span, words)
        };
        if !suits {
            return Err(Exception::IllegalDataValue);
        }
        self.check_line()?;
        let aired = self.origin.broadcast && self.is_over_the_air();
        let order = words.get(COMMAND.wrapping_sub(span.start()));
        let cannot_save =
            order == Some(Command::Save.code()) && (self.has_save() || !self.can_pay(span, words));
        if aired || cannot_save || !(self.is_unlocked() || span == Span::single(KEY)) {
            return Err(Exception::ServerDeviceBusy);
        }
        Ok(())
    }

    /// Returns whether the registers of these runs allow the values.
    fn suit(&self, runs: Runs, mut values: Words<'_>) -> bool {
        for run in runs {
            let of_run = values.slice(0, run.count);
            values = values.slice(run.count, u16::MAX);
            if !run.rule.values.allow_all(of_run.iter()) || !self.suits_the_ports(run, of_run) {
                return false;
            }
        }
        true
    }

    /// Returns whether values for points are allowed by the modules of their ports, and values for MODULE by the
    /// board's slots.
    fn suits_the_ports(&self, run: Run, words: Words<'_>) -> bool {
        if run.rule.first == MODULE {
            return (run.index..)
                .zip(words.iter())
                .all(|(index, code)| B::ROW.takes(index.wrapping_add(1), code));
        }
        if !B::ROW.is_modular() && run.rule.first == RANGE {
            let addresses = RANGE.wrapping_add(run.index)..;
            let mut ranges = addresses.zip(words.iter());
            if !ranges.all(|(address, range)| self.edited.takes_range(address, range)) {
                return false;
            }
        }
        let Some(narrower) = run.rule.narrower else {
            return true;
        };
        // Ports without a slot have no module that could restrict their points.
        B::ROW.ports().all(|port| {
            let first = points::of_port(port);
            if first >= run.index.wrapping_add(run.count) {
                return true;
            }
            let kinds = B::ROW.kinds(port, self.edited.module(port));
            (first..).zip(kinds).all(|(point, kind)| {
                kind != narrower.kind
                    || words
                        .get(point.wrapping_sub(run.index))
                        .is_none_or(|word| narrower.values.allow(word))
            })
        })
    }

    /// Returns whether FORMAT and MODE are compatible once these values are written.
    fn suits_the_mode(&self, span: Span, words: Words<'_>) -> bool {
        let written = |address: u16| words.get(address.wrapping_sub(span.start()));
        match (written(FORMAT), written(MODE)) {
            (None, None) => true,
            (format, mode) => format_suits_mode(
                format.unwrap_or_else(|| self.edited.get(FORMAT)),
                mode.unwrap_or_else(|| self.edited.get(MODE)),
            ),
        }
    }
}
