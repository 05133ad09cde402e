//! The gateway radio: its bytes, its parameters, and the start of the boards' modules.

use sim::Time;
use sim::radio::Mode;

use super::scene::Scene;

/// Interval at which the mode of a module is checked.
const LOOK: Time = Time::from_ms(10);

impl Scene {
    /// Lets the gateway keep its factory parameters, instead of following the first board's module.
    pub fn fix_gateway(&mut self) {
        if let Some(air) = self.bus.air() {
            air.set_follow(false);
        }
    }

    /// Runs until the first board's module is in normal mode and the gateway has followed, or until the virtual time is
    /// `limit`. Does nothing if the board has no module.
    pub fn start_radio(&mut self, limit: Time) {
        while let Some(module) = self.bus.board(0).radio() {
            let normal = module.mode() == Some(Mode::Normal);
            if self.now() >= limit {
                return;
            }
            self.run_until(self.now() + LOOK);
            if normal {
                return;
            }
        }
    }

    /// Sends bytes to the gateway now, or directly after the bytes that are still being sent. Returns the end of the
    /// last byte.
    pub fn send_by_radio(&mut self, bytes: &[u8]) -> Time {
        let now = self.now();
        self.bus.air().map_or(now, |air| air.send(now, bytes))
    }

    /// Returns the bytes that the gateway has sent to its master since the last call.
    pub fn take_received_by_radio(&mut self) -> Vec<u8> {
        let air = self.bus.air();
        let received = air.map(|air| air.take_received()).unwrap_or_default();
        received.iter().map(|byte| byte.byte).collect()
    }
}

#[cfg(test)]
mod tests {
    use sim::Config;
    use sim::radio::Parameters;

    use super::*;
    use crate::app::testing::{bench_of, bench_of_boards};

    fn fitted(stored: Parameters) -> Config {
        Config {
            radio: Some(stored),
            ..Config::default()
        }
    }

    #[test]
    fn bytes_pass_the_gateway_in_both_directions() {
        // The firmware does nothing, so the modules of the boards stay in sleep.
        for boards in [vec!["one"], vec!["one", "two"]] {
            let config = || fitted(Parameters::FACTORY);
            let boards = boards.into_iter().map(|name| (name, config()));
            let mut scene = bench_of_boards(boards);
            scene.run_until(Time::from_ms(10));
            scene.send_by_radio(b"ab");
            scene.send_by_radio(b"c");
            let now = scene.now();
            let air = scene.bus.air().unwrap();
            air.transmit(now + Time::from_ms(300), Parameters::FACTORY, b"reply");
            scene.run_until(Time::from_ms(700));
            let air = scene.bus.air().unwrap();
            let sent: Vec<_> = air.packets().map(|packet| packet.bytes.clone()).collect();
            assert_eq!(sent, [b"reply".to_vec(), b"abc".to_vec()]);
            assert_eq!(scene.take_received_by_radio(), b"reply");
            assert!(scene.take_received_by_radio().is_empty());
        }
    }

    #[test]
    fn board_without_a_module_has_no_gateway_and_starts_at_once() {
        let mut scene = bench_of(Config::default());
        scene.send_by_radio(b"lost");
        scene.fix_gateway();
        scene.start_radio(Time::from_secs(3));
        assert_eq!(scene.now(), Time::ZERO);
        assert!(scene.take_received_by_radio().is_empty());
    }

    #[test]
    fn module_that_does_not_enter_normal_mode_is_waited_for_up_to_the_limit() {
        let mut scene = bench_of(fitted(Parameters::FACTORY));
        scene.start_radio(Time::from_ms(200));
        assert!(scene.now() >= Time::from_ms(200) && scene.now() < Time::from_ms(201));
    }
}
