//! Requests at several rates, to the image in the simulator, in exact time.

use std::time::Duration;

use conformance::cases::of_bench;
use conformance::endpoint::Endpoint as _;
use conformance::endpoint::sim::{Fitting, start};
use conformance::frame::Mode;
use conformance::run::{Verdict, run};
use modbus_line::LineFormat;
use register_map::Module;

use super::{modio_02, probed};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_loses_no_frame_at_any_rate_and_its_rate_is_restored() {
    let home = LineFormat::default();
    let mut line = start(&Fitting {
        dip: 3,
        ..modio_02(Module::Do4)
    })
    .expect("the image can be read");
    let mut target = probed(&mut line, 3, Mode::Rtu);
    target.hil.requests = 300;
    target.hil.rates = vec![9600, 19_200, 115_200, 921_600];
    target.hil.limit = Some(home.t35() + Duration::from_millis(1));
    let outcomes = run(&mut line, &target, &of_bench()).expect("it can be tested");
    for (outcome, baud) in outcomes.iter().zip(&target.hil.rates) {
        assert_eq!(outcome.verdict, Verdict::Passed, "{outcome:#?}");
        let measured = &outcome.measured;
        assert_eq!(
            (&measured["baud"], &measured["sent"]),
            (&(*baud).into(), &300.into())
        );
        let us = |value: &serde_json::Value| value.as_u64().expect("a time");
        let [first, last] = ["min", "max"].map(|name| us(&measured["turnaround_us"][name]));
        // V1.02, 2.5.1.1: not before t3.5.
        let t35 = us(&measured["t35_us"]);
        assert!(first >= t35 && last < t35 + 1000, "{measured}");
    }
    assert_eq!(line.line(), home);

    // After a power cycle the stored settings are in force.
    line.set_power(false).expect("a simulator switches");
    line.set_power(true).expect("a simulator switches");
    probed(&mut line, 3, Mode::Rtu);
}
