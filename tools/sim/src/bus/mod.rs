//! Several boards on one RS-485 line.
//!
//! Each board has its own clock and its own end of the line. The edges of the master are known beforehand, and the
//! edges of a unit are added to the record of the bus afterwards. But the units also receive each other: a unit must
//! not pass an instant at which another unit could still pull the line low.
//!
//! A unit can do that only when its transmitter begins a character: at the end of the character before, or at a tick of
//! its baud generator while its core executes instructions. So each board runs up to the earliest such instant of the
//! other boards. All boards run at the same time, on as many threads as the host has cores. Then each board gets the
//! characters of the others, and the next round begins. The result does not depend on the number of threads. A core
//! that sleeps does nothing until its next event, so its board stays behind until then, or until the run ends. All
//! edges of a character are known when it begins.
//!
//! The LoRa modules of the boards and the gateway radio share the air. A receiver checks a packet some time after its
//! end, and by then every module has passed the end of the packet. So a board with a module may be ahead of the others
//! by that time, and the air is exact without any exception.
//!
//! The line is exact, with two exceptions:
//!
//! - Stopping a core in the middle of its work costs much more than letting it run until it sleeps. So a board may
//!   already be past the start of a character when it gets the edge: by half a bit and at most [`LATEST`], plus the
//!   rest of an instruction. The edge still counts from its true instant ([`crate::line`]): the board samples the true
//!   bits of the character, and receives it at its true time. Only the edge itself is late for the firmware by that
//!   time, in the capture of a timer or in the level of the pin.
//! - A unit can cut a character with its driver, its pin or its supply, or pull the line low with a GPIO output. It
//!   does so between two ticks. Another board may then be past this instant by up to one bit of that unit, or by
//!   [`FARTHEST`] while the transmitter of that unit is off, and gets the edge late.

mod air;
mod plan;

use rayon::prelude::*;

use crate::board::Board;
use crate::line::{Line, Output, Settings};
use crate::radio::Air;
use f103::chip::CYCLE;
use f103::time::Time;
pub use plan::{FARTHEST, LATEST};
use plan::{Horizon, Plan};

/// Longest time between two updates of the bus itself.
const RECORDED: Time = Time::from_ms(10);

/// Time that an edge takes for a metre of cable, at two thirds of the speed of light.
const METRE: Time = Time::from_ns(5);

/// Boards on one RS-485 line.
///
/// A bus with one board uses the line of that board. With several boards, [`Bus::line`] is the bus: the master is
/// connected to it, and it has the record. The line of each board ([`Board::line`]) is then only the end at that board:
/// it has the edges of the driver and the echo, but no frames.
#[derive(Debug)]
pub struct Bus {
    boards: Vec<Board>,
    /// The next actions of each board.
    plans: Vec<Plan>,
    /// For each board, the time that an edge takes from the master to it.
    delays: Vec<Time>,
    /// For each board, whether [`board_mut`](Self::board_mut) has returned it since the last run.
    lent: Vec<bool>,
    /// The bus itself; not used with one board.
    line: Line,
    /// [`Line::version`] of the bus that the boards have taken over.
    version: u64,
    /// The air, if a board has a LoRa module; not used with one board.
    air: Option<Air>,
}

impl Bus {
    /// Returns a bus with these boards on it. Boards whose time is behind that of the others run first.
    ///
    /// # Panics
    ///
    /// If `boards` is empty.
    #[must_use]
    pub fn new(mut boards: Vec<Board>) -> Self {
        let now = boards.iter().map(|board| board.now()).min();
        let now = now.expect("a bus has at least one board");
        let mut air = None;
        if boards.len() > 1 {
            for board in &mut boards {
                board.line().become_end();
            }
            air = Air::of_boards(&mut boards, now);
        }
        Self {
            plans: boards.iter().map(Board::plan).collect(),
            delays: vec![Time::ZERO; boards.len()],
            lent: vec![true; boards.len()],
            boards,
            line: Line::of_bus(now),
            // No version of the line is equal to this, so the boards take over the first one.
            version: u64::MAX,
            air,
        }
    }

    /// Returns the number of boards, at least 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a bus is never empty")]
    pub fn len(&self) -> usize {
        self.boards.len()
    }

    /// Returns the boards, in the order in which they were given.
    #[must_use]
    pub fn boards(&self) -> &[Board] {
        &self.boards
    }

    /// Returns board `n`, counted from 0.
    ///
    /// # Panics
    ///
    /// If there is no board `n`.
    #[must_use]
    pub fn board(&self, n: usize) -> &Board {
        &self.boards[n]
    }

    /// Returns board `n`, counted from 0, for changing it. A method that lets the time of this board pass leaves the
    /// other boards behind. They catch up in the next run, and until then this board receives nothing from them.
    ///
    /// # Panics
    ///
    /// If there is no board `n`.
    pub fn board_mut(&mut self, n: usize) -> &mut Board {
        self.lent[n] = true;
        &mut self.boards[n]
    }

    /// Places board `n` at this distance from the master, in metres of cable, before the first run. Without this, all
    /// boards are at the master. Not used with one board.
    ///
    /// # Panics
    ///
    /// If there is no board `n`.
    pub fn set_distance(&mut self, n: usize, metres: u32) {
        self.delays[n] = METRE * metres.into();
    }

    /// Returns the virtual time of the board that is farthest ahead.
    #[must_use]
    pub fn now(&self) -> Time {
        let now = self.boards.iter().map(|board| board.now()).max();
        now.unwrap_or(Time::ZERO)
    }

    /// Runs all boards until the virtual time is `t`. A board whose core is in an instruction then finishes it.
    pub fn run_until(&mut self, t: Time) {
        if let [board] = &mut *self.boards {
            return board.run_until(t);
        }
        self.apply_changes();
        // Run on a thread of the pool, where distributing work is cheap.
        rayon::scope(|_| {
            while let Some(horizon) = self.horizon(t) {
                self.run_boards(|n, plan| {
                    let to = horizon.of_board(n);
                    (plan.awake < to).then_some(to)
                });
                self.run_air(horizon.of_board(self.boards.len()));
                self.record(t);
            }
            self.run_boards(|_, _| Some(t));
            self.run_air(t);
        });
        self.record_until(t);
    }

    /// Runs all boards for `d` of virtual time.
    pub fn run_for(&mut self, d: Time) {
        self.run_until(self.now() + d);
    }

    /// Switches board `n` off, runs all boards for 100 ms, and switches board `n` on.
    ///
    /// # Panics
    ///
    /// If there is no board `n`.
    pub fn cycle(&mut self, n: usize) {
        self.board_mut(n).power_off();
        self.run_for(CYCLE);
        self.board_mut(n).power_on();
    }

    /// Returns the line, for sending and for reading the record.
    pub fn line(&mut self) -> &mut Line {
        let now = self.now();
        match &mut *self.boards {
            [board] => board.line(),
            _ => {
                self.line.set_earliest(now);
                &mut self.line
            }
        }
    }

    /// Returns how far the boards, and the gateway after them, can run towards `t`. `None` if all of them sleep until
    /// `t`.
    fn horizon(&self, t: Time) -> Option<Horizon> {
        let gateway = self.air.as_ref().map(Air::plan);
        Horizon::of(self.plans.iter().copied().chain(gateway), t)
    }

    /// Takes over the changes that were made to the boards, the line and the air since the last run.
    fn apply_changes(&mut self) {
        for n in 0..self.boards.len() {
            if core::mem::take(&mut self.lent[n]) {
                self.boards[n].apply_changes();
                self.pass_on(n);
                self.plans[n] = self.boards[n].plan();
            }
        }
        if self.version != self.line.version() {
            self.version = self.line.version();
            for (board, delay) in self.boards.iter_mut().zip(&self.delays) {
                let from = self.line.now();
                board.end_of_line(|end| end.mirror(&self.line, from, *delay));
            }
            self.plans = self.boards.iter().map(Board::plan).collect();
        }
        self.pass_on_air();
    }

    /// Runs each board to the instant that `to` returns, or not at all with `None`, and passes on its output.
    fn run_boards(&mut self, to: impl Fn(usize, &Plan) -> Option<Time>) {
        let mut due: Vec<_> = self
            .boards
            .iter_mut()
            .zip(&mut self.plans)
            .enumerate()
            .filter_map(|(n, (board, plan))| Some((n, to(n, plan)?, board, plan)))
            .collect();
        due.par_iter_mut().for_each(|(_, to, board, plan)| {
            board.run_ahead(*to);
            **plan = board.plan();
        });
        let ran: Vec<_> = due.into_iter().map(|(n, ..)| n).collect();
        for n in ran {
            self.pass_on(n);
        }
    }

    /// Updates the bus up to the instant that all boards have reached, at most to `t`, if the last update is
    /// [`RECORDED`] ago.
    fn record(&mut self, t: Time) {
        let known = self.plans.iter().map(|plan| plan.start).min();
        // Stop one picosecond before, because a character may begin at `start`.
        let known = known.map_or(Time::ZERO, |start| {
            start.saturating_sub(Time::from_ps(1)).min(t)
        });
        if known.saturating_sub(self.line.now()) >= RECORDED {
            self.record_until(known);
        }
    }

    /// Updates the bus up to `known`.
    fn record_until(&mut self, known: Time) {
        let settings = self.boards.iter().find_map(Board::line_settings);
        self.line.pass(known, settings);
    }

    /// Passes the output of unit `n` on to the bus and to all other boards, and its packets on to the air.
    fn pass_on(&mut self, n: usize) {
        self.pass_on_news(n);
        let Some(output) = self.boards[n].take_output() else {
            return;
        };
        let from = self.delays[n];
        self.line.add_output(n, &output, from);
        for (other, board) in self.boards.iter_mut().enumerate() {
            if other != n {
                let to = self.delays[other];
                let delay = from.max(to) - from.min(to);
                board.end_of_line(|end| end.add_output(n, &output, delay));
                self.plans[other] = board.plan();
            }
        }
    }
}

impl Board {
    /// Calls `action` with the board's end of the line.
    fn end_of_line<T>(&mut self, action: impl FnOnce(&mut Line) -> T) -> T {
        let answer = action(&mut self.circuit_mut().line);
        self.wires_changed();
        answer
    }

    /// Returns the unit's output to the bus; `None` if it is as in the last call.
    fn take_output(&mut self) -> Option<Output> {
        if !(self.usart(self.layout().line.tx).has_sent() || self.circuit().line.has_changed()) {
            return None;
        }
        self.sync();
        self.end_of_line(Line::take_output)
    }

    /// Takes over the changes that were made to the circuit since the last run.
    fn apply_changes(&mut self) {
        self.refresh();
        self.sync();
    }

    /// Returns the rate and format of the unit, for a master that follows it; `None` while the power is off.
    fn line_settings(&self) -> Option<Settings> {
        let usart = self.usart(self.layout().line.tx);
        self.powered().then(|| usart.settings()).flatten()
    }
}
