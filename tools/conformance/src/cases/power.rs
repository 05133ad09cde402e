//! Power-on.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("power/answers", "V1.02 2.4.2", "switched off and on, the unit answers within a second", &[Need::Power],
        answers).interpretation(),
    case("power/in-the-middle-of-traffic", "V1.02 2.4.2",
        "switched on in the middle of traffic, it ignores all of it up to the first silence",
        &[Need::Power, Need::Exact, Need::Rtu], mid_traffic),
    case("power/no-byte-by-itself", "V1.02 3.3", "nothing leaves a unit that starts", &[Need::Power],
        no_byte).interpretation(),
];

const OFF: Duration = Duration::from_millis(200);
pub(super) const START: Duration = Duration::from_secs(1);

pub(super) fn cycle(tester: &mut Tester<'_>) -> Check {
    tester.endpoint.set_power(false)?;
    tester.rest(OFF)?;
    tester.endpoint.set_power(true)?;
    Ok(())
}

fn answers(tester: &mut Tester<'_>) -> Check {
    for _ in 0..3 {
        cycle(tester)?;
        tester.rest(START)?;
        tester.alive("power on")?;
    }
    Ok(())
}

fn mid_traffic(tester: &mut Tester<'_>) -> Check {
    let line = tester.endpoint.line();
    // Send from before the start of the unit until well after it.
    let length = (START.as_nanos() / line.characters(1).as_nanos()) as usize;
    for byte in [0x55, 0x00, 0xFF] {
        cycle(tester)?;
        let bytes = [vec![byte; length], tester.ping()].concat();
        let wanted = "no silence has come before the request";
        tester.silence(&[Piece::Bytes(bytes)], wanted)?;
        tester.alive("the first silence")?;
    }
    Ok(())
}

fn no_byte(tester: &mut Tester<'_>) -> Check {
    cycle(tester)?;
    let received = tester.endpoint.receive(START, START, usize::MAX)?;
    let wanted = format!("silence while the unit starts: {received:?}");
    tester.ensure(received.is_empty(), wanted)
}
