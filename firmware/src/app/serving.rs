//! Serves a request: takes it from its line, executes it, and sends the reply.
//!
//! ```text
//! line    take          send     <- the locks of a line are short, because its interrupts wait for them
//! device       ...serve...
//! ```

use board_support::pac::Interrupt;
use firmware::{
    config::{LineName, Origin},
    start_up::LOADER_UNIT,
};
use modbus_server::{LineCounters, Outcome, Reply, Request, Server, line::Framing};
use register_map::codes::Command;
use rtic::Mutex;

use crate::{board::Device, line::Line, orders::Orders, radio::Radio};

/// The unit address of a broadcast.
const BROADCAST: u8 = 0;

/// A server, and what belongs to its line.
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
        rs485: &mut impl Mutex<T = Option<Line>>,
        radio: &mut impl Mutex<T = Option<Radio>>,
        device: &mut impl Mutex<T = &'static mut Device>,
        orders: &mut impl Mutex<T = Orders>,
    ) -> bool {
        let order = self
            .rs485
            .order
            .take_if(|_| rs485.lock(|line| line.as_ref().is_some_and(|line| !line.is_replying())));
        execute(order, device, orders);
        let request = rs485.lock(|line| line.as_mut()?.take());
        let served = request.is_some();
        if let Some(request) = request {
            if let Some(line) = radio.lock(|line| Some(line.as_ref()?.counters())) {
                self.copy_counters(LineName::Radio, &line, device);
            }
            let (reply, delay_ms) = self.serve(LineName::Rs485, request, device);
            rs485.lock(|line| line.as_mut().map(|line| line.send(reply, delay_ms)));
        }

        // Only a restart affects a reply that is on its way. The other commands are executed before the master can
        // have the reply, because a command of the other line may follow it.
        let order = self.radio.order.take_if(|order| {
            radio.lock(|line| {
                line.as_ref().is_some_and(|line| {
                    !line.is_replying() && (*order != Command::Restart || !line.is_on_air())
                })
            })
        });
        execute(order, device, orders);
        let Some(request) = radio.lock(|line| line.as_mut()?.take()) else {
            return served;
        };
        if let Some(line) = rs485.lock(|line| Some(line.as_ref()?.counters())) {
            self.copy_counters(LineName::Rs485, &line, device);
        }
        // RESPONSE_DELAY is for masters on the RS-485 line; the air takes much longer.
        let (reply, _) = self.serve(LineName::Radio, request, device);
        radio.lock(|line| line.as_mut().map(|line| line.send_reply(reply)));
        true
    }

    const fn of(&mut self, which: LineName) -> &mut Served {
        match which {
            LineName::Rs485 => &mut self.rs485,
            LineName::Radio => &mut self.radio,
        }
    }

    /// Serves a request. Returns the reply and its delay in milliseconds.
    // Not inlined: one copy serves both lines.
    #[inline(never)]
    fn serve(
        &mut self,
        which: LineName,
        request: Request<'static>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> (Reply<'static>, u16) {
        // In recovery mode a unit must be found even by a master with a short time-out.
        let delays = self.unit != LOADER_UNIT;
        let served = self.of(which);
        let origin = Origin {
            line: which,
            broadcast: request.unit() == BROADCAST,
        };
        let seen_at = request.ended().wrapping_sub(served.frame_gap_ms);
        let (reply, delay_ms) = device.lock(|device| {
            let delay_ms = device.config.response_delay_ms();
            device.set_origin(origin);
            let reply = served.server.serve(request, &mut **device);
            // In listen-only mode requests do not count, so that the outputs go to SAFE.
            if !matches!(reply.outcome(), Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(seen_at);
            }
            served.order = device.take_order();
            (reply, delay_ms)
        });
        if reply.writes() {
            rtic::pend(Interrupt::EXTI1);
        }
        if served.order.is_some() && !reply.is_answered() {
            // There is no reply to wait for, so execute the command now.
            rtic::pend(Interrupt::EXTI3);
        }
        (reply, if delays { delay_ms } else { 0 })
    }

    /// Copies the counters of a line to the device's state. Those of the line whose request is being served are copied
    /// by the device itself.
    fn copy_counters(
        &mut self,
        which: LineName,
        line: &LineCounters,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) {
        let counters = self.of(which).server.counters_at(line);
        device.lock(|device| *device.state.counters_of(which) = counters);
    }
}

/// Executes the command of a request whose reply has been sent, if there is one, or passes it on to the background
/// task.
fn execute(
    order: Option<Command>,
    device: &mut impl Mutex<T = &'static mut Device>,
    orders: &mut impl Mutex<T = Orders>,
) {
    let Some(order) = order else { return };
    if let Some(order) = device.lock(|device| device.carry_out(order)) {
        orders.lock(|orders| match order {
            Command::Save => orders.save = true,
            Command::Restart => orders.restart = true,
            Command::Identify => orders.identify = true,
            _ => {}
        });
        rtic::pend(Interrupt::EXTI0);
    }
}
