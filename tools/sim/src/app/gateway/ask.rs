//! A single request to a unit, in a call that returns its reply: for the HTTP interface and its page.

use modbus_line::adu::Framing;
use sim::Time;
use sim::line::{Direction, frame_silence};

use super::exchange::{Exchange, Outcome, patience};
use super::mbap::Request;
use super::mode::Mode;
use crate::app::scene::Scene;

/// Virtual time between two looks for a reply.
const STEP: Time = Time::from_ms(1);

/// Sends a request to a unit, whose settings board `n` has, and lets virtual time pass until its reply was received.
/// Waits for a free line first. Returns `None` when there is no reply.
pub fn ask(scene: &mut Scene, n: usize, unit: u8, pdu: Vec<u8>) -> Option<Vec<u8>> {
    let mut mode = Mode::default();
    mode.update(scene.bus.board(n));
    let framing = mode.framing(scene.bus.line().settings());
    wait_for_free_line(scene, framing);
    let request = Request {
        transaction: 0,
        unit,
        pdu,
    };
    let exchange = Exchange::begin(scene, framing, &request);
    loop {
        match exchange.outcome(scene.bus.line()) {
            Outcome::Waiting => scene.run_until(scene.now() + STEP),
            Outcome::Reply(pdu) => return Some(pdu),
            Outcome::Silence | Outcome::Sent => return None,
        }
    }
}

/// Waits until the masters have sent everything, and the last request has its reply or the time for it is over.
fn wait_for_free_line(scene: &mut Scene, framing: Framing) {
    let line = scene.bus.line();
    let settings = line.settings();
    // The last frame is recorded after the silence that ends it.
    let recorded = line.master_free() + frame_silence(settings) + settings.characters(1);
    scene.run_until(recorded);
    let request = |scene: &mut Scene| {
        let last = scene.bus.line().frames().next_back();
        let request = last.filter(|frame| frame.direction == Direction::Request);
        request.map(|frame| frame.end)
    };
    while request(scene).is_some_and(|end| scene.now() < end + patience(framing, settings)) {
        scene.run_until(scene.now() + STEP);
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;

    use super::*;
    use crate::app::Origin;
    use crate::app::testing::scene;

    #[test]
    fn request_is_sent_after_the_requests_of_other_masters_and_has_no_reply_without_a_unit() {
        let mut scene = scene(Module::Di4);
        // The record of the line misses a start bit at the instant 0.
        scene.run_until(STEP);
        let other = Framing::Rtu.frame(0, 1, &[1, 0, 16, 0, 4]);
        scene.put(other.clone(), Origin::Pty);
        assert_eq!(ask(&mut scene, 0, 1, vec![7]), None);
        let line = scene.bus.line();
        let frames: Vec<_> = line.frames().collect();
        let own = Framing::Rtu.frame(0, 1, &[7]);
        let bytes: Vec<_> = frames.iter().map(|frame| &frame.bytes).collect();
        assert_eq!(bytes, [&other, &own]);
        let patience = patience(Framing::Rtu, line.settings());
        assert!(frames[1].start >= frames[0].end + patience);
    }
}
