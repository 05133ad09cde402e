//! A request from its port to its reply.
//!
//! ```text
//! line    take: reply starts          answer           finish
//! device  .....................decide........carry out.......   <- what is written or read, in one lock each
//! ```
//!
//! Between the phases no lock is held, and in the line's no more is done than has to be: its interrupts wait.

use board_support::pac::Interrupt;
use firmware::start_up::LOADER_UNIT;
use modbus_server::{Outcome, Request, Server};
use register_map::codes::Command;
use rtic::Mutex;

use crate::{board::Device, line::Line, orders::Orders};

/// The server of a line.
pub struct Serving {
    server: Server,
    /// The unit address.
    unit: u8,
    /// The silence that ends a frame, in ms, rounded up.
    frame_gap_ms: u32,
}

impl Serving {
    /// `frame_gap_ms`: the silence that ends a frame, rounded up.
    pub const fn new(server: Server, unit: u8, frame_gap_ms: u32) -> Self {
        Self {
            server,
            unit,
            frame_gap_ms,
        }
    }

    /// Serves the request that waits, if any, after the order of the one before it. Whether there was one.
    pub fn run(
        &mut self,
        line: &mut impl Mutex<T = Option<Line>>,
        device: &mut impl Mutex<T = &'static mut Device>,
        orders: &mut impl Mutex<T = Orders>,
    ) -> bool {
        let delay_ms = self.delay_ms(device);
        // The unit address leaves while all that follows is being done.
        let (silent, request) = line.lock(|line| {
            line.as_mut().map_or((true, None), |line| {
                (!line.is_replying(), line.take(&self.server, delay_ms))
            })
        });
        if silent {
            // The reply of the request before is out, or never comes.
            pass_order_on(device, orders);
        }
        request.is_some_and(|request| self.serve(request, line, device))
    }

    fn delay_ms(&self, device: &mut impl Mutex<T = &'static mut Device>) -> u16 {
        if self.unit == LOADER_UNIT {
            // A master must find a unit in loader mode, however short the master's time-out is.
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
            // In listen-only mode the outputs are to fall to SAFE.
            if !matches!(decision.outcome, Outcome::NoRequest | Outcome::NotObeyed) {
                device.request_seen(committed.ended().wrapping_sub(self.frame_gap_ms));
            }
            committed.carry_out(server, &mut **device)
        });
        line.lock(|line| line.as_mut().map(|line| line.finish(served)));
        if decision.work.writes() {
            rtic::pend(Interrupt::EXTI1);
            if !decision.is_answered() {
                // No reply to wait for: an order is carried out now.
                rtic::pend(Interrupt::EXTI3);
            }
        }
        true
    }
}

/// Carries the last request's order out, or passes it on to the background.
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
