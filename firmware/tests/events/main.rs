//! Events of thirty units on one bus, in virtual time: each edge is reported once and in order, and soon.
//!
//! The units are the device with its server and port, as on the board; the bus is a model: characters take their time,
//! crystals differ, interrupts are late, and receivers get bits wrong. `MODIO_EVENTS_S` is the time that passes on the
//! bus, in seconds, and `MODIO_EVENTS_OUT` a folder for the picture of the latencies, `events.svg`.

mod bus;
mod master;
mod plot;
mod unit;

use std::env;

use master::{Master, Traffic, polling};
use plot::Panel;

/// Returns the seconds that a test simulates: a minute, unless the environment says otherwise.
fn seconds() -> f64 {
    let text = env::var("MODIO_EVENTS_S");
    text.map_or(60.0, |text| text.parse().expect("MODIO_EVENTS_S: seconds"))
}

/// Returns the value below which this share of the sorted values lies.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn each_edge_is_reported_once_in_order_and_much_earlier_than_by_polling() {
    let mut panels = Vec::new();
    for (baud, per_s, median_share, most_share) in
        [(115_200, 50.0, 10.0, 5.0), (9_600, 5.0, 6.0, 4.0)]
    {
        let traffic = Traffic {
            edges_per_s: per_s,
            restarts_per_s: 0.0,
            seconds: seconds(),
        };
        let mut master = Master::new(baud, 30, 0.0, 1);
        let mut latencies = master.run(&traffic);
        latencies.sort_by(f64::total_cmp);
        let mut polled = polling(baud, 30, latencies.len());
        polled.sort_by(f64::total_cmp);
        for (share, least) in [(0.5, median_share), (0.99, most_share)] {
            let (events, polls) = (quantile(&latencies, share), quantile(&polled, share));
            println!(
                "{baud} bit/s, {share}: {events:.0} us, polling {polls:.0} us, 1/{:.1}",
                polls / events
            );
            assert!(
                events * least <= polls,
                "{baud}: {share}: {events:.0} of {polls:.0} us"
            );
        }
        panels.push(Panel {
            baud,
            events: latencies,
            polling: polled,
        });
    }
    if let Ok(folder) = env::var("MODIO_EVENTS_OUT") {
        std::fs::write(format!("{folder}/events.svg"), plot::svg(&panels)).unwrap();
    }
}

#[test]
fn no_edge_is_lost_with_bit_errors_and_units_that_restart() {
    for (baud, per_s) in [(115_200, 50.0), (9_600, 5.0)] {
        let traffic = Traffic {
            edges_per_s: per_s,
            restarts_per_s: 0.02,
            seconds: seconds(),
        };
        let mut master = Master::new(baud, 30, 1e-5, 2);
        let latencies = master.run(&traffic);
        assert!(latencies.len() as f64 > 0.8 * per_s * seconds());
    }
}

/// Returns the longest time from an edge until the master knows it, in s.
fn longest(master: &mut Master, edges_per_s: f64) -> f64 {
    let traffic = Traffic {
        edges_per_s,
        restarts_per_s: 0.0,
        seconds: seconds(),
    };
    let latencies = master.run(&traffic);
    assert!(latencies.len() as f64 > 0.3 * edges_per_s * seconds());
    latencies.into_iter().fold(0.0, f64::max) / 1e6
}

#[test]
fn unit_that_nobody_has_set_up_keeps_no_other_one_waiting() {
    for baud in [9_600, 115_200] {
        let mut master = Master::keeping_address(baud);
        master.restart_second();
        let longest = longest(&mut master, 2.0);
        // Five fetches of one packet each; with the start in each packet of the second unit it would be 2,500 bits.
        let bits = longest * f64::from(baud);
        assert!(bits < 1_500.0, "{baud}: {longest} s");
    }
}

#[test]
fn input_that_bounces_keeps_no_other_unit_waiting_for_a_second() {
    // An edge within each fetch of 600 bits.
    for (baud, hz) in [(9_600, 50.0), (115_200, 250.0)] {
        let mut master = Master::keeping_address(baud);
        master.bounce_second(hz, seconds() + 5.0);
        let longest = longest(&mut master, 2.0);
        assert!(longest < 1.0, "{baud}: {longest} s");
    }
}
