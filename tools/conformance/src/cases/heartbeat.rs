//! HEARTBEAT of a modio: a write that changes nothing, so that a master can show that it lives.

use std::time::Duration;

use register_map::configuration::{HEARTBEAT, KEY, OPEN_S, SERIAL_LOW};
use register_map::state;

use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_words};
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("config/heartbeat", "map, 0x010C",
        "HEARTBEAT alone takes any value without KEY and changes nothing; with another register it needs KEY",
        &[Need::Modio, Need::Function(6), Need::Function(0x10), Need::Function(0x16), Need::Function(0x17)], heartbeat),
];

/// Waits until the lock is closed. Skips the case where that would take a minute of the user's time.
fn close(tester: &mut Tester<'_>) -> Check {
    if tester.read_word(KEY)? == 0 {
        return Ok(());
    }
    if !tester.endpoint.abilities().exact {
        return skip("the lock is open");
    }
    tester.rest(Duration::from_secs(OPEN_S.into()))?;
    let open = tester.read_word(KEY)?;
    tester.ensure(open == 0, "the lock closed, a minute after the last write")
}

fn heartbeat(tester: &mut Tester<'_>) -> Check {
    close(tester)?;
    let before = tester.read_word(state::STATUS)?;
    let [high, low] = HEARTBEAT.to_be_bytes();
    for value in [0, 1, 0xFFFF] {
        let request = pdu(6, HEARTBEAT, value);
        tester.reply_is(&request, &request)?;
        let reply = pdu(0x10, HEARTBEAT, 1);
        tester.reply_is(&write_words(HEARTBEAT, &[value]), &reply)?;
        let [a, b] = value.to_be_bytes();
        let masks = [0x16, high, low, 0, 0, a, b];
        tester.reply_is(&masks, &masks)?;
        let with_read = [0x17, high, low, 0, 1, high, low, 0, 1, 2, a, b];
        tester.reply_is(&with_read, &[0x17, 2, 0, 0])?;
    }
    tester.silence_of(0, &pdu(6, HEARTBEAT, 1), "a broadcast")?;
    tester.word_is(HEARTBEAT, 0)?;
    tester.word_is(KEY, 0)?;
    tester.word_is(state::STATUS, before)?;
    let serial = tester.read_word(SERIAL_LOW)?;
    tester.exception(&write_words(SERIAL_LOW, &[serial, 1]), 6)
}
