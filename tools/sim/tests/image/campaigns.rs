//! An update of several boards on one line: the plan is that of one board, so they run on one kind of board.

use register_map::codes::Baud;

use crate::campaign::Line;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_bus_is_updated_while_its_points_are_polled_and_a_unit_loses_its_supply() {
    let mut bus = Line::new(Baud::B115200, 2);
    bus.polls = true;
    bus.cut_after = Some(200);
    let ratio = bus.update();
    assert!(ratio < 4.0, "{ratio}");
    let [polls, lost] = bus.polled;
    // Each unit is silent for some seconds, while it restarts.
    assert!(polls > 10 && lost <= 10, "{polls} {lost}");
}
