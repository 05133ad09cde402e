//! Serves a request: takes it from its line, executes it, and sends the reply.
//!
//! ```text
//! line    take          send     <- the locks of a line are short, because its interrupts wait for them
//! device       ...serve...
//! ```

use board_support::device::interrupt;
use firmware::{
    config::{LineName, Origin},
    line::Addresses,
    start_up::RECOVERY_UNIT,
};
use modbus_server::{
    LineCounters, Outcome, Request, Server,
    fast::{self, Contest},
    line::Framing,
};
use register_map::codes::Command;
use rtic::Mutex;

use crate::{
    board::{BOARD, Device, Events},
    line_setup::Line,
    second::{Second, in_use},
};

/// The unit address of a broadcast.
const BROADCAST: u8 = 0;

/// The server of one line, with the settings and the pending command of that line.
struct Served {
    server: Server,
    line: LineName,
    /// Time from the end of a frame until the line reports it, in ms, rounded up.
    frame_gap_ms: u32,
    /// RESPONSE_DELAY does not apply. It is for masters on the RS-485 line; the second line is slower.
    at_once: bool,
    /// The command of the last request, which is executed when its reply has been sent.
    order: Option<Command>,
}

/// The servers of the lines.
pub struct Serving {
    rs485: Served,
    /// This unit's part in function 70, which the RS-485 line serves; `None` on a board without it.
    unit: Option<fast::Unit>,
    second: Served,
}

impl Serving {
    /// Creates the servers of a unit. `rs485` is the framing of the RS-485 line and the silence that ends a frame
    /// there, in ms, rounded up. The second line reports when a frame has ended itself. `points_only`: the
    /// second line serves points and reads only.
    pub const fn new(
        unit: u8,
        fast: Option<fast::Unit>,
        rs485: (Framing, u32),
        points_only: bool,
    ) -> Self {
        let second = Server::new(Framing::Rtu);
        let second = if points_only {
            second.with_read_only_diagnostics()
        } else {
            second
        };
        Self {
            rs485: Served {
                server: Server::new(rs485.0),
                line: LineName::Rs485,
                frame_gap_ms: rs485.1,
                // In recovery mode a unit must be found even by a master with a short time-out.
                at_once: unit == RECOVERY_UNIT,
                order: None,
            },
            unit: fast,
            second: Served {
                server: second,
                line: LineName::Second,
                frame_gap_ms: 0,
                at_once: true,
                order: None,
            },
        }
    }

    /// Serves the waiting request of each line, if any, after executing the command of the line's previous request.
    pub fn run(
        &mut self,
        rs485: &mut impl Mutex<T = Option<Line>>,
        second: &mut impl Mutex<T = Option<Second>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        if let Some(order) = self.rs485.order
            && rs485.lock(|line| line.as_ref().is_some_and(|line| !line.is_replying()))
        {
            self.rs485.order = None;
            execute(order, self.rs485.line, device);
        }
        // Only a restart affects a reply that is on its way. The other commands are executed before the master can
        // have the reply, because a command of the other line may follow it.
        if let Some(order) = self.second.order
            && second.lock(|line| {
                in_use(line).is_some_and(|line| {
                    !(line.is_replying() || restarts(order) && line.is_ending())
                })
            })
        {
            self.second.order = None;
            execute(order, self.second.line, device);
        }
        let mut served = false;
        // The next request waits until the command has been executed.
        if self.rs485.order.is_none()
            && let Some(request) = rs485.lock(|line| line.as_mut()?.take())
        {
            self.rs485
                .serve(request, self.unit.as_mut(), rs485, second, device);
            self.change_address(rs485, second, device);
            served = true;
        }
        if self.second.order.is_none()
            && let Some(request) = second.lock(|line| in_use(line)?.take())
        {
            self.second.serve(request, None, rs485, second, device);
            served = true;
        }
        if !served {
            // The scan runs this every 100 ms.
            if let Some(line) = rs485.lock(|line| Some(line.as_ref()?.counters())) {
                self.rs485.copy_counters(&line, device);
            }
            if let Some(line) = second.lock(|line| Some(in_use(line)?.counters())) {
                self.second.copy_counters(&line, device);
            }
        }
    }

    /// Puts the unit address in force on both lines that a request has set, if any.
    fn change_address(
        &mut self,
        rs485: &mut impl Mutex<T = Option<Line>>,
        second: &mut impl Mutex<T = Option<Second>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        if BOARD.switch {
            return;
        }
        let fast = self.unit.is_some();
        if let Some(unit) = device.lock(|device| device.take_unit())
            && let Some(units) = Events::units(Some(unit), fast)
        {
            if let Some(fast) = &mut self.unit {
                fast.set_address(unit);
            }
            rs485.lock(|line| line.as_mut().map(|line| line.set_units(units)));
            if let Some(units) = Events::units(Some(unit), false) {
                second.lock(|line| in_use(line).map(|line| line.set_units(units)));
            }
        }
    }
}

impl Served {
    /// Serves a request of this line and sends its reply.
    // Not inlined: one copy serves both lines.
    #[inline(never)]
    fn serve(
        &mut self,
        mut request: Request<'static>,
        unit: Option<&mut fast::Unit>,
        rs485: &mut impl Mutex<T = Option<Line>>,
        second: &mut impl Mutex<T = Option<Second>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        let mut origin = Origin {
            line: self.line,
            broadcast: request.unit() == BROADCAST,
            by_serial: false,
        };
        let ended = request.ended();
        let mut unit = unit.filter(|_| BOARD.events && request.unit() == fast::ADDRESS);
        if let Some(unit) = unit.as_mut()
            && !unit.open(&mut request)
        {
            return self.serve_for_all(request, unit, rs485, device);
        }
        origin.by_serial = unit.is_some();
        let (mut reply, delay_ms) = device.lock(|device| {
            let delay_ms = device.config.response_delay_ms();
            device.set_origin(origin);
            (self.server.serve(request, &mut **device), delay_ms)
        });
        let (outcome, writes) = (reply.outcome(), reply.writes());
        match (self.line, unit) {
            (LineName::Rs485, Some(unit)) => {
                unit.close(&mut reply);
                let contest = Contest::default();
                rs485.lock(|line| line.as_mut().map(|line| line.arbitrate(reply, contest)));
            }
            (LineName::Rs485, None) => {
                let delay_ms = if self.at_once { 0 } else { delay_ms };
                rs485.lock(|line| line.as_mut().map(|line| line.send(reply, delay_ms)));
            }
            (LineName::Second, _) => {
                second.lock(|line| in_use(line).map(|line| line.send_reply(reply)));
            }
        }
        self.end(ended, outcome, writes, device);
    }

    /// Serves a request of function 70 to all units, which only the RS-485 line takes.
    #[cold]
    #[inline(never)]
    fn serve_for_all(
        &mut self,
        request: Request<'static>,
        unit: &mut fast::Unit,
        rs485: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        let ended = request.ended();
        let (reply, contest) = device.lock(|device| {
            device.set_origin(Origin {
                line: self.line,
                ..Origin::default()
            });
            self.server.serve_fast(request, unit, &mut **device)
        });
        let (outcome, writes) = (reply.outcome(), reply.writes());
        rs485.lock(|line| line.as_mut().map(|line| line.arbitrate(reply, contest)));
        self.end(ended, outcome, writes, device);
    }

    /// Does what follows a request after its reply has begun.
    #[inline(always)]
    fn end(
        &mut self,
        ended: u32,
        outcome: Outcome,
        writes: bool,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        self.server.settle();
        self.order = device.lock(|device| {
            // In listen-only mode requests do not count, so that the outputs go to SAFE.
            if !matches!(outcome, Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(ended.wrapping_sub(self.frame_gap_ms), writes);
            }
            device.end_request()
        });
        if writes {
            rtic::pend(interrupt::EXTI1);
        }
        if self.order.is_some() {
            // Without a reply there is no end of a reply to wait for.
            rtic::pend(interrupt::SERVE);
        }
    }

    /// Copies the counters of this line to the device's state, for requests of the other line. The device itself copies
    /// those of the line of a request.
    #[inline(never)]
    fn copy_counters(&self, line: &LineCounters, device: &mut impl Mutex<T = &'static mut Device>) {
        let counters = self.server.counters_at(line);
        device.lock(|device| *device.state.counters_of(self.line) = counters);
    }
}

/// Returns whether a command restarts the device.
const fn restarts(order: Command) -> bool {
    matches!(
        order,
        Command::Restart | Command::RestartAs255 | Command::Finish | Command::GoBack
    )
}

/// Executes the command of a request whose reply has been sent, or passes it on to the background task.
#[inline(never)]
fn execute(order: Command, line: LineName, device: &mut impl Mutex<T = &'static mut Device>) {
    device.lock(|device| device.carry_out(order, line));
    rtic::pend(interrupt::EXTI0);
}
