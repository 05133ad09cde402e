//! Several boards on one RS-485 line.
//!
//! Each board has its clock and its end of the line. The edges of the master are known beforehand, and those of a unit
//! reach the record of the bus afterwards. This leaves the units that receive each other: none of them may pass an
//! instant at which another one could still pull the line low.
//!
//! A unit can do that only when its transmitter begins a character: at the end of the one under way, or at a tick of
//! its baud generator while its core executes instructions. So each board goes on up to the earliest such instant of
//! the others, all of them at the same time on as many threads as the host has cores; then they receive what the others
//! have sent, and go on. What a board does is the same whatever the number of threads. A core that sleeps does nothing
//! until its next event, and its board stays behind until then, or until the run ends. All edges of a character are
//! known when it begins.
//!
//! This is exact, with two exceptions:
//!
//! - To stop a core in the middle of its work costs much more than to let it go on until it sleeps. So a board may be
//!   past the beginning of a character when it receives the edge: by half a bit, [`LATEST`] at most, and the end of an
//!   instruction. The edge still counts from its true instant ([`crate::line`]): the character is sampled at its true
//!   bits, and arrives at its true time. Only what shows the edge itself, such as the capture of a timer or the level
//!   at the pin, is late for the firmware by that much.
//! - A unit can break off a character by its driver, its pin or its supply, or pull the line low by a plain output. It
//!   does so between two ticks. The others may then be past it by up to one bit of that unit, or by [`FARTHEST`] while
//!   its transmitter is off, and receive the edge late.

use rayon::prelude::*;

use crate::board::Board;
use crate::chip::CYCLE;
use crate::line::{Line, Said, Settings};
use crate::machine::Limit;
use crate::time::Time;

/// How far the others run ahead of a unit whose transmitter is off: it has to send an idle frame before its first
/// character, which takes longer at every rate that a line runs at.
pub const FARTHEST: Time = Time::from_us(10);

/// How late a board may hear of a character that begins while its core executes instructions.
pub const LATEST: Time = Time::from_us(20);

/// The bus itself is brought up to date at least so often.
const RECORDED: Time = Time::from_ms(10);

/// What a board will do, by what is known.
#[derive(Clone, Copy, Debug)]
struct Plan {
    /// Its core executes nothing before this instant.
    awake: Time,
    /// It begins no character before this instant.
    start: Time,
    /// The other boards may be there already: half a bit after `start`, [`LATEST`] at most.
    bound: Time,
}

/// How far boards can run before they exchange what they have sent: no other board begins a character before.
#[derive(Clone, Copy, Debug)]
struct Horizon {
    /// The board whose bound is the least, which runs up to the next one.
    first: usize,
    least: Time,
    next: Time,
}

impl Horizon {
    /// `None` when all boards sleep until `t`, the end of the run.
    fn of(plans: &[Plan], t: Time) -> Option<Self> {
        let awake = plans.iter().map(|plan| plan.awake).min()?;
        if awake >= t {
            return None;
        }
        let mut horizon = Self {
            first: 0,
            least: t,
            next: t,
        };
        for (n, plan) in plans.iter().enumerate() {
            if plan.bound < horizon.least {
                horizon.next = horizon.least;
                (horizon.first, horizon.least) = (n, plan.bound);
            } else {
                horizon.next = horizon.next.min(plan.bound);
            }
        }
        // One instruction at least.
        horizon.least = horizon.least.max(awake + Time::from_ps(1));
        horizon.next = horizon.next.max(horizon.least);
        Some(horizon)
    }

    /// Up to where board `n` runs.
    fn of_board(self, n: usize) -> Time {
        if n == self.first {
            self.next
        } else {
            self.least
        }
    }
}

/// Boards on one RS-485 line.
///
/// With one board it is that board with its line. With several, [`Bus::line`] is the bus: the master is connected to
/// it, and it has the record. The line of a board on it ([`Board::line`]) is then only the end at that board: it has the
/// edges of the driver and the echo, but no frames.
#[derive(Debug)]
pub struct Bus {
    boards: Vec<Board>,
    /// When each board does something next.
    plans: Vec<Plan>,
    /// Which boards have been lent out since the last run.
    lent: Vec<bool>,
    /// The bus itself; not used with one board.
    line: Line,
    /// What of it the boards know of.
    version: u64,
}

impl Bus {
    /// A bus with these boards on it. Boards whose time is behind the others' go on first.
    ///
    /// # Panics
    ///
    /// When there is no board.
    #[must_use]
    pub fn new(mut boards: Vec<Board>) -> Self {
        let now = boards.iter().map(Board::now).min();
        let now = now.expect("a bus has at least one board");
        if boards.len() > 1 {
            for board in &mut boards {
                board.line().become_end();
            }
        }
        Self {
            plans: boards.iter().map(Board::plan).collect(),
            lent: vec![true; boards.len()],
            boards,
            line: Line::of_bus(now),
            // Not the version of the line: no board knows of a version yet.
            version: u64::MAX,
        }
    }

    /// How many boards there are, at least one.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "there is always a board")]
    pub fn len(&self) -> usize {
        self.boards.len()
    }

    /// The boards, in the order in which they were given.
    #[must_use]
    pub fn boards(&self) -> &[Board] {
        &self.boards
    }

    /// Board `n`, the first one is 0.
    ///
    /// # Panics
    ///
    /// When there is no such board, as with a slice.
    #[must_use]
    pub fn board(&self, n: usize) -> &Board {
        &self.boards[n]
    }

    /// The same, to do something to it. What lets its time pass on its own leaves the other boards behind: they catch
    /// up in the next run. Until then it receives nothing from them.
    ///
    /// # Panics
    ///
    /// When there is no such board, as with a slice.
    pub fn board_mut(&mut self, n: usize) -> &mut Board {
        self.lent[n] = true;
        &mut self.boards[n]
    }

    /// The virtual time: that of the board that is farthest.
    #[must_use]
    pub fn now(&self) -> Time {
        let now = self.boards.iter().map(Board::now).max();
        now.unwrap_or(Time::ZERO)
    }

    /// Runs all boards until the virtual time is `t`, or the end of the instruction under way then.
    pub fn run_until(&mut self, t: Time) {
        if let [board] = &mut *self.boards {
            return board.run_until(t);
        }
        self.take_up();
        // On a thread of the pool, where to share work out is cheap.
        rayon::scope(|_| {
            while let Some(horizon) = Horizon::of(&self.plans, t) {
                self.run_boards(|n, plan| {
                    let to = horizon.of_board(n);
                    (plan.awake < to).then_some(to)
                });
                self.record(t);
            }
            self.run_boards(|_, _| Some(t));
        });
        self.record_until(t);
    }

    /// Runs for `d`.
    pub fn run_for(&mut self, d: Time) {
        self.run_until(self.now() + d);
    }

    /// Power off on board `n`, 100 ms for all boards, power on.
    ///
    /// # Panics
    ///
    /// When there is no such board, as with a slice.
    pub fn cycle(&mut self, n: usize) {
        self.board_mut(n).power_off();
        self.run_for(CYCLE);
        self.board_mut(n).power_on();
    }

    /// The line, to send on and to read what was sent.
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

    /// Takes over the changes to the boards and the line since the last run.
    fn take_up(&mut self) {
        for n in 0..self.boards.len() {
            if core::mem::take(&mut self.lent[n]) {
                self.boards[n].take_up();
                self.pass_on(n);
                self.plans[n] = self.boards[n].plan();
            }
        }
        if self.version != self.line.version() {
            self.version = self.line.version();
            for board in &mut self.boards {
                let from = self.line.now();
                board.end_of_line(|end| end.mirror(&self.line, from));
            }
            self.plans = self.boards.iter().map(Board::plan).collect();
        }
    }

    /// Runs each board until the instant that `to` gives, if any, and passes on what they have sent.
    fn run_boards(&mut self, to: impl Fn(usize, &Plan) -> Option<Time>) {
        let mut due: Vec<_> = self
            .boards
            .iter_mut()
            .zip(&mut self.plans)
            .enumerate()
            .filter_map(|(n, (board, plan))| Some((n, to(n, plan)?, board, plan)))
            .collect();
        due.par_iter_mut().for_each(|(_, to, board, plan)| {
            board.run_on_bus(*to);
            **plan = board.plan();
        });
        let ran: Vec<_> = due.into_iter().map(|(n, ..)| n).collect();
        for n in ran {
            self.pass_on(n);
        }
    }

    /// Brings the bus up to where all boards are, at most to `t`, when it has not been for a while.
    fn record(&mut self, t: Time) {
        let known = self.plans.iter().map(|plan| plan.start).min();
        // A character may begin at that instant.
        let known = known.map_or(Time::ZERO, |start| {
            start.saturating_sub(Time::from_ps(1)).min(t)
        });
        if known.saturating_sub(self.line.now()) >= RECORDED {
            self.record_until(known);
        }
    }

    fn record_until(&mut self, known: Time) {
        let settings = self.boards.iter().find_map(Board::line_settings);
        self.line.pass(known, settings);
    }

    /// Passes on to all others what unit `n` has sent.
    fn pass_on(&mut self, n: usize) {
        let Some(said) = self.boards[n].take_said() else {
            return;
        };
        self.line.hear(n, &said);
        for (other, board) in self.boards.iter_mut().enumerate() {
            if other != n {
                board.end_of_line(|end| end.hear(n, &said));
                self.plans[other] = board.plan();
            }
        }
    }
}

impl Board {
    /// Does something to the board's end of the line.
    fn end_of_line<T>(&mut self, action: impl FnOnce(&mut Line) -> T) -> T {
        let soc = &mut self.machine.bus.soc;
        let answer = action(&mut soc.circuit.line);
        soc.wires_changed();
        answer
    }

    /// What the unit did to the bus since the last time.
    fn take_said(&mut self) -> Option<Said> {
        let soc = &mut self.machine.bus.soc;
        if !(soc.usart1().has_sent() || soc.circuit.line.has_changed()) {
            return None;
        }
        self.sync();
        self.end_of_line(Line::take_said)
    }

    /// Takes up what was done to the circuit since the last run.
    fn take_up(&mut self) {
        let now = self.now();
        self.machine.bus.soc.refresh(now);
        self.sync();
    }

    /// Runs until `t`, or the end of the instruction under way then. What is worked out lazily is left as it is.
    fn run_on_bus(&mut self, t: Time) {
        if self.now() < t {
            self.machine.run(Limit {
                time: t,
                instructions: u64::MAX,
                pc: None,
                breakpoints: false,
            });
        }
    }

    /// What the board does next.
    fn plan(&self) -> Plan {
        let awake = self.machine.next_instruction();
        let usart = self.machine.bus.soc.usart1();
        let start = match usart.earliest_start(awake) {
            _ if awake == Time::MAX => awake,
            Some(start) => start,
            None => awake + FARTHEST,
        };
        let late = usart
            .bit()
            .map_or(Time::ZERO, |bit| Time::from_ps(bit.as_ps() / 2).min(LATEST));
        Plan {
            awake,
            start,
            bound: start + late,
        }
    }

    /// The rate and format of the unit, for a master that follows it; `None` while the power is off.
    fn line_settings(&self) -> Option<Settings> {
        let usart = self.machine.bus.soc.usart1();
        self.powered().then(|| usart.settings()).flatten()
    }
}
