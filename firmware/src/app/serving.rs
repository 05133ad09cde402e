//! Serves a request, from its port to its reply.
//!
//! ```text
//! line    take: reply starts          answer           finish
//! device  .....................decide........carry out.......   <- one lock for each phase
//! ```
//!
//! No lock is held between the phases. The locks of the line are kept short, because its interrupts wait for them.

use board_support::pac::Interrupt;
use firmware::start_up::LOADER_UNIT;
use modbus_server::{Outcome, Request, Server};
use register_map::codes::Command;
use rtic::Mutex;

use crate::{board::Device, line::Line, orders::Orders};

/// The server of a line.
pub struct Serving {
    server: Server,
    /// Unit address.
    unit: u8,
    /// Silence that ends a frame, in ms, rounded up.
    frame_gap_ms: u32,
}

impl Serving {
    /// `frame_gap_ms` is the silence that ends a frame, in ms, rounded up.
    pub const fn new(server: Server, unit: u8, frame_gap_ms: u32) -> Self {
        Self {
            server,
            unit,
            frame_gap_ms,
        }
    }

    /// Serves the waiting request, if any, after executing the command of the previous request. Returns whether
    /// there was a request.
    pub fn run(
        &mut self,
        line: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
        orders: &mut impl Mutex<T = Orders>,
    ) -> bool {
        let delay_ms = self.delay_ms(device);
        // The UART sends the unit address while the code below runs.
        let (silent, request) = line.lock(|line| {
            line.as_mut().map_or((true, None), |line| {
                (!line.is_replying(), line.take(&self.server, delay_ms))
            })
        });
        if silent {
            // The previous reply has been sent, or will never be sent.
            pass_order_on(device, orders);
        }
        request.is_some_and(|request| self.serve(request, line, device))
    }

    fn delay_ms(&self, device: &mut impl Mutex<T = &'static mut Device>) -> u16 {
        if self.unit == LOADER_UNIT {
            // In loader mode a unit must be found even by a master with a short time-out.
            0
        } else {
            device.lock(|device| device.config.response_delay_ms())
        }
    }

    fn serve(
        &mut self,
        request: Request<'static>,
        line: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> bool {
        let server = &mut self.server;
        let decided = device.lock(|device| request.decide(server, &**device));
        let Some(answered) = line.lock(|line| line.as_mut().map(|line| line.answer(decided)))
        else {
            return false;
        };
        let committed = answered.commit(server);
        let decision = *committed.decision();
        let served = device.lock(|device| {
            if Device::shows_counters(&decision.work) {
                device.state.counters = server.counters();
            }
            // In listen-only mode requests do not count, so that the outputs go to SAFE.
            if !matches!(decision.outcome, Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(committed.ended().wrapping_sub(self.frame_gap_ms));
            }
            committed.carry_out(server, &mut **device)
        });
        line.lock(|line| line.as_mut().map(|line| line.finish(served)));
        if decision.work.writes() {
            rtic::pend(Interrupt::EXTI1);
            if !decision.is_answered() {
                // There is no reply to wait for, so execute the command now.
                rtic::pend(Interrupt::EXTI3);
            }
        }
        true
    }
}

/// Executes the command of the last request, or passes it on to the background task.
fn pass_order_on(
    device: &mut impl Mutex<T = &'static mut Device>,
    orders: &mut impl Mutex<T = Orders>,
) {
    let left = device.lock(|device| {
        let order = device.take_order()?;
        device.carry_out(order)
    });
    if let Some(order) = left {
        orders.lock(|orders| match order {
            Command::Save => orders.save = true,
            Command::Restart => orders.restart = true,
            Command::Identify => orders.identify = true,
            _ => {}
        });
        rtic::pend(Interrupt::EXTI0);
    }
}
