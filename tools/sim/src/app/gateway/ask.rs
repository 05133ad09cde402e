//! A single request to a unit, in a call that returns its reply: for the HTTP interface and its page.

use modbus_line::adu::Framing;
use sim::Time;
use sim::line::{Direction, frame_silence};

use super::exchange::{Exchange, Outcome, patience};
use super::mbap::Request;
use super::mode::Mode;
use crate::app::bench::Bench;

/// Virtual time between two looks for a reply.
const STEP: Time = Time::from_ms(1);

/// Sends a request to a unit, whose settings board `n` has, and lets virtual time pass until its reply was received.
/// Waits for a free line first. Returns `None` when there is no reply.
pub fn ask(bench: &mut Bench, n: usize, unit: u8, pdu: Vec<u8>) -> Option<Vec<u8>> {
    let mut mode = Mode::default();
    mode.update(bench.bus.board(n));
    let framing = mode.framing(bench.bus.line().settings());
    wait_for_free_line(bench, framing);
    let request = Request {
        transaction: 0,
        unit,
        pdu,
    };
    let exchange = Exchange::begin(bench, framing, &request);
    loop {
        match exchange.outcome(bench.bus.line()) {
            Outcome::Waiting => bench.run_until(bench.now() + STEP),
            Outcome::Reply(pdu) => return Some(pdu),
            Outcome::Silence | Outcome::Sent => return None,
        }
    }
}

/// Waits until the masters have sent everything, and the last request has its reply or the time for it is over.
fn wait_for_free_line(bench: &mut Bench, framing: Framing) {
    let line = bench.bus.line();
    let settings = line.settings();
    // The last frame is recorded after the silence that ends it.
    let recorded = line.master_free() + frame_silence(settings) + settings.characters(1);
    bench.run_until(recorded);
    let request = |bench: &mut Bench| {
        let last = bench.bus.line().frames().next_back();
        let request = last.filter(|frame| frame.direction == Direction::Request);
        request.map(|frame| frame.end)
    };
    while request(bench).is_some_and(|end| bench.now() < end + patience(framing, settings)) {
        bench.run_until(bench.now() + STEP);
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;

    use super::*;
    use crate::app::Origin;
    use crate::app::testing::bench;

    #[test]
    fn request_is_sent_after_the_requests_of_other_masters_and_has_no_reply_without_a_unit() {
        let mut bench = bench(Module::Di4);
        // The record of the line misses a start bit at the instant 0.
        bench.run_until(STEP);
        let other = Framing::Rtu.frame(0, 1, &[1, 0, 16, 0, 4]);
        bench.put(other.clone(), Origin::Pty);
        assert_eq!(ask(&mut bench, 0, 1, vec![7]), None);
        let line = bench.bus.line();
        let frames: Vec<_> = line.frames().collect();
        let own = Framing::Rtu.frame(0, 1, &[7]);
        let bytes: Vec<_> = frames.iter().map(|frame| &frame.bytes).collect();
        assert_eq!(bytes, [&other, &own]);
        let patience = patience(Framing::Rtu, line.settings());
        assert!(frames[1].start >= frames[0].end + patience);
    }
}
