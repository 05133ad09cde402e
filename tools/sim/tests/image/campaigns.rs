//! An update of several boards on one line: the plan is that of one board, so they run on one kind of board.

use std::env;

use register_map::codes::Baud;

use crate::campaign::Line;

/// `MODIO_UNITS` is the number of units, 2 without it.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_bus_is_updated_while_its_points_are_polled_and_a_unit_loses_its_supply() {
    let units = env::var("MODIO_UNITS").map_or(2, |units| units.parse().unwrap());
    let mut bus = Line::new(Baud::B115200, units);
    if units > 2 {
        // Undisturbed first.
        assert!(bus.update() < 1.3);
        bus = Line::new(Baud::B115200, units);
    }
    bus.polls = true;
    bus.cut_after = Some(200);
    let ratio = bus.update();
    assert!(ratio < 4.0, "{ratio}");
    let [polls, lost] = bus.polled;
    // Each unit is silent for some seconds, while it restarts.
    let units = u32::from(units);
    assert!(polls > 5 * units && lost <= 5 * units, "{polls} {lost}");
}
