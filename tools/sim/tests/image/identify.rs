//! COMMAND 6: the LEDs show which unit on the bus it is.

use sim::{Module, Time, board::Leds};

use crate::bench::Bench;

const LIT: Leds = Leds {
    activity: true,
    fault: true,
    run: true,
};
const DARK: Leds = Leds {
    activity: false,
    fault: false,
    run: false,
};

impl Bench {
    /// Returns the state of the LEDs every 50 ms during this time, starting in the middle of a tick of the pattern.
    fn watch_leds(&mut self, time: Time) -> Vec<Leds> {
        let end = self.board.now() + time;
        let mut seen = Vec::new();
        while self.board.now() < end {
            self.board.run_for(Time::from_ms(50));
            seen.push(self.board.leds());
        }
        seen
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn identify_makes_all_leds_blink_for_ten_seconds() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.command(6);
    // Stop just before the command ends.
    let seen = bench.watch_leds(Time::from_ms(9500));
    assert!(
        seen.iter().all(|leds| [LIT, DARK].contains(leds)),
        "{seen:?}"
    );
    let changes = seen.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((46..=48).contains(&changes), "{changes} changes in 9.5 s");
    bench.board.run_for(Time::from_secs(1));
    let after = bench.watch_leds(Time::from_secs(2));
    assert!(after.iter().all(|leds| !leds.fault && !leds.activity));
    let changes = after.windows(2).filter(|pair| pair[0] != pair[1]);
    assert!(
        (3..=4).contains(&changes.count()),
        "run blinks once a second"
    );
}
