//! `modio-hil` with the firmware's image in the simulator as its board, in exact time.

#![cfg(feature = "sim")]

use std::env;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use conformance::cli::{chosen, waits};
use conformance::endpoint::Endpoint as _;
use conformance::endpoint::sim::{Fitting, start};
use hil::report::Report;
use hil::{Plan, run};
use modbus_line::LineFormat;
use register_map::Module;
use register_map::board::MODIO_02;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_loses_no_frame_at_any_rate_and_its_rate_is_restored() {
    let images = env::var_os("MODIO_IMAGES_MODIO_02").expect("cargo xtask test sets it");
    let [loader, image] = ["loader", "modio-a.image"].map(|name| PathBuf::from(&images).join(name));
    let home = LineFormat::default();
    let mut endpoint = start(&Fitting {
        module: Module::Do4,
        dip: 3,
        line: home,
        ..Fitting::new(loader, image, &MODIO_02)
    })
    .expect("the image can be read");
    let rates = vec![9600, 19_200, 115_200, 921_600];
    let plan = Plan {
        unit: 3,
        patience: waits(&endpoint, None),
        allow_config: false,
        module: None,
        cases: chosen(&["fc05/".to_owned()]).expect("there are such cases"),
        requests: 300,
        rates: rates.clone(),
        limit: Some(home.t35() + Duration::from_millis(1)),
        wires: Vec::new(),
        analog: Vec::new(),
    };
    let mut report = Report::default();
    let never = AtomicBool::new(false);
    let mut lines = Vec::new();
    let mut tell = |line: &str| lines.push(line.to_owned());
    run(&mut endpoint, &plan, &never, &mut report, &mut tell).expect("it can be tested");
    let text = lines.join("\n");
    assert_eq!(report.totals().failed, 0, "{text}");
    assert!(report.totals().passed >= 4 + rates.len(), "{text}");
    for (tally, rate) in report.timing.iter().zip(&rates) {
        assert_eq!((tally.line.baud, tally.sent), (*rate, 300));
        let spread = tally.spread.as_ref().expect("replies");
        let (t35, first, last) = (
            tally.line.t35(),
            spread.percentile(0),
            spread.percentile(100),
        );
        // V1.02, 2.5.1.1: not before t3.5.
        assert!(first >= t35, "{rate}: {first:?}");
        assert!(last < t35 + Duration::from_millis(1), "{rate}: {last:?}");
    }
    assert_eq!(endpoint.line(), home);

    // After a power cycle the stored settings are in force.
    endpoint.set_power(false).expect("a simulator switches");
    endpoint.set_power(true).expect("a simulator switches");
    endpoint
        .rest(Duration::from_millis(200))
        .expect("time passes");
    let again = Plan {
        cases: Vec::new(),
        rates: Vec::new(),
        requests: 5,
        ..plan
    };
    let mut report = Report::default();
    run(&mut endpoint, &again, &never, &mut report, &mut |_| {}).expect("it answers as before");
    assert_eq!(report.totals().failed, 0);
}
