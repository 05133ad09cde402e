//! Serves a request, from its port to its reply.
//!
//! ```text
//! line    take: reply starts          answer           finish
//! device  .....................decide........carry out.......   <- one lock for each phase
//! ```
//!
//! No lock is held between the phases. The locks of the lines are kept short, because the interrupts of the RS-485
//! line wait for them.

use board_support::pac::Interrupt;
use firmware::{
    config::{LineName, Origin},
    line::ServedLine,
    start_up::RECOVERY_UNIT,
};
use modbus_server::{Outcome, Request, Server, line::Framing};
use register_map::codes::Command;
use rtic::Mutex;

use crate::{board::Device, line::Line, radio::Radio};

/// The lines, under their locks.
pub struct Lines<L, R> {
    pub rs485: L,
    pub radio: R,
}

impl<L: Mutex<T = Option<Line>>, R: Mutex<T = Option<Radio>>> Lines<L, R> {
    /// Calls `f` with a line, if it is on.
    #[inline(always)]
    fn lock<T>(&mut self, which: LineName, f: impl FnOnce(&mut dyn ServedLine) -> T) -> Option<T> {
        match which {
            LineName::Rs485 => self.rs485.lock(|line| line.as_mut().map(|line| f(line))),
            LineName::Radio => self.radio.lock(|line| line.as_mut().map(|line| f(line))),
        }
    }
}

/// The unit address of a broadcast.
const BROADCAST: u8 = 0;

/// A line's part in serving.
struct Served {
    server: Server,
    /// Time from the end of a frame until the line reports it, in ms, rounded up.
    frame_gap_ms: u32,
    /// The command of the last request, which is executed when its reply has been sent.
    order: Option<Command>,
}

impl Served {
    const fn new(server: Server, frame_gap_ms: u32) -> Self {
        Self {
            server,
            frame_gap_ms,
            order: None,
        }
    }
}

/// The waiting request of a line.
struct Taken {
    /// The previous reply has been sent, or will never be sent.
    silent: bool,
    /// Its end may still be on its way.
    on_air: bool,
    request: Option<Request<'static>>,
}

/// Takes the waiting request of a line, if the line is on and there is one. Its reply starts now, or after `delay_ms`.
#[inline(always)]
fn take(line: &mut Option<impl ServedLine>, server: &Server, delay_ms: u16) -> Taken {
    let Some(line) = line else {
        return Taken {
            silent: false,
            on_air: false,
            request: None,
        };
    };
    Taken {
        silent: !line.is_replying(),
        on_air: line.is_on_air(),
        request: line.take(server, delay_ms),
    }
}

/// The servers of the lines.
pub struct Serving {
    rs485: Served,
    radio: Served,
    /// Unit address.
    unit: u8,
}

impl Serving {
    /// Creates the servers of a unit. `rs485` is the framing of the RS-485 line and the silence that ends a frame
    /// there, in ms, rounded up. The radio line reports when a frame has ended itself. `points_only`: the radio line
    /// serves points and reads only.
    pub const fn new(unit: u8, rs485: (Framing, u32), points_only: bool) -> Self {
        let radio = Server::new(Framing::Rtu);
        let radio = if points_only {
            radio.with_read_only_diagnostics()
        } else {
            radio
        };
        Self {
            rs485: Served::new(Server::new(rs485.0), rs485.1),
            radio: Served::new(radio, 0),
            unit,
        }
    }

    /// Serves the waiting request of each line, if any, after executing the command of the line's previous request.
    /// Returns whether there was a request.
    pub fn run(
        &mut self,
        lines: &mut Lines<impl Mutex<T = Option<Line>>, impl Mutex<T = Option<Radio>>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let delay_ms = self.delay_ms(device);
        // The UART sends the unit address while the code below runs.
        let taken = lines
            .rs485
            .lock(|line| take(line, &self.rs485.server, delay_ms));
        let served = self.run_line(LineName::Rs485, taken, lines, device);
        // RESPONSE_DELAY is for masters on the RS-485 line; the air takes much longer.
        let taken = lines.radio.lock(|line| take(line, &self.radio.server, 0));
        self.run_line(LineName::Radio, taken, lines, device) || served
    }

    // Not inlined: one copy serves both lines.
    #[inline(never)]
    fn run_line(
        &mut self,
        which: LineName,
        taken: Taken,
        lines: &mut Lines<impl Mutex<T = Option<Line>>, impl Mutex<T = Option<Radio>>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let order = &mut self.of(which).order;
        if taken.silent
            // Only a restart affects a reply that is on its way. The other commands are executed before the master can
            // have the reply, because a command of the other line may follow it.
            && let Some(order) = order.take_if(|order| !taken.on_air || *order != Command::Restart)
        {
            device.lock(|device| device.carry_out(order));
            rtic::pend(Interrupt::EXTI0);
        }
        taken
            .request
            .is_some_and(|request| self.serve(which, request, lines, device))
    }

    const fn of(&mut self, which: LineName) -> &mut Served {
        match which {
            LineName::Rs485 => &mut self.rs485,
            LineName::Radio => &mut self.radio,
        }
    }

    fn delay_ms(&self, device: &mut impl Mutex<T = &'static mut Device>) -> u16 {
        if self.unit == RECOVERY_UNIT {
            // In recovery mode a unit must be found even by a master with a short time-out.
            0
        } else {
            device.lock(|device| device.config.response_delay_ms())
        }
    }

    fn serve(
        &mut self,
        which: LineName,
        request: Request<'static>,
        lines: &mut Lines<impl Mutex<T = Option<Line>>, impl Mutex<T = Option<Radio>>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let served = self.of(which);
        let origin = Origin {
            line: which,
            broadcast: request.unit() == BROADCAST,
        };
        let decided = device.lock(|device| {
            device.set_origin(origin);
            request.decide(&served.server, &**device)
        });
        let Some(answered) = lines.lock(which, |line| line.answer(decided)) else {
            return false;
        };
        let committed = answered.commit(&mut served.server);
        let decision = *committed.decision();
        if Device::shows_counters(&decision.work) {
            self.copy_counters(lines, device);
        }
        let served = self.of(which);
        let done = device.lock(|device| {
            // In listen-only mode requests do not count, so that the outputs go to SAFE.
            if !matches!(decision.outcome, Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(committed.ended().wrapping_sub(served.frame_gap_ms));
            }
            let done = committed.carry_out(&mut served.server, &mut **device);
            served.order = device.take_order();
            done
        });
        lines.lock(which, |line| line.finish(done));
        if decision.work.writes() {
            rtic::pend(Interrupt::EXTI1);
            if !decision.is_answered() {
                // There is no reply to wait for, so execute the command now.
                rtic::pend(Interrupt::EXTI3);
            }
        }
        true
    }

    /// Copies the counters of both lines to the device's state.
    fn copy_counters(
        &self,
        lines: &mut Lines<impl Mutex<T = Option<Line>>, impl Mutex<T = Option<Radio>>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        let rs485 = lines.lock(LineName::Rs485, |line| line.counters());
        let radio = lines.lock(LineName::Radio, |line| line.counters());
        device.lock(|device| {
            let state = &mut device.state;
            if let Some(line) = rs485 {
                state.counters = self.rs485.server.counters_at(&line);
            }
            if let Some(line) = radio {
                state.radio_counters = self.radio.server.counters_at(&line);
            }
        });
    }
}
