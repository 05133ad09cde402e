//! HEARTBEAT of a modio: a write that changes nothing, so that a master can show that it lives.

use std::time::Duration;

use register_map::configuration::{HEARTBEAT, KEY, OPEN_S, SERIAL_LOW};
use register_map::state;

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case, skip};
use crate::points::{pdu, write_words};

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("config/heartbeat", "map, 0x010C",
        "HEARTBEAT alone takes any value without KEY and changes nothing; with another register it needs KEY",
        &[Need::Modio, Need::Function(6), Need::Function(0x10), Need::Function(0x16), Need::Function(0x17)], heartbeat),
];

/// Waits until the lock is closed. Skips the case where that would take a minute of the user's time.
fn close(bench: &mut Bench<'_>) -> Check {
    if bench.read_word(KEY)? == 0 {
        return Ok(());
    }
    if !bench.endpoint.abilities().exact {
        return skip("the lock is open");
    }
    bench.rest(Duration::from_secs(OPEN_S.into()))?;
    let open = bench.read_word(KEY)?;
    bench.ensure(open == 0, "the lock closed, a minute after the last write")
}

fn heartbeat(bench: &mut Bench<'_>) -> Check {
    close(bench)?;
    let before = bench.read_word(state::STATUS)?;
    let [high, low] = HEARTBEAT.to_be_bytes();
    for value in [0, 1, 0xFFFF] {
        let request = pdu(6, HEARTBEAT, value);
        bench.reply_is(&request, &request)?;
        let reply = pdu(0x10, HEARTBEAT, 1);
        bench.reply_is(&write_words(HEARTBEAT, &[value]), &reply)?;
        let [a, b] = value.to_be_bytes();
        let masks = [0x16, high, low, 0, 0, a, b];
        bench.reply_is(&masks, &masks)?;
        let with_read = [0x17, high, low, 0, 1, high, low, 0, 1, 2, a, b];
        bench.reply_is(&with_read, &[0x17, 2, 0, 0])?;
    }
    bench.silence_of(0, &pdu(6, HEARTBEAT, 1), "a broadcast")?;
    bench.word_is(HEARTBEAT, 0)?;
    bench.word_is(KEY, 0)?;
    bench.word_is(state::STATUS, before)?;
    let serial = bench.read_word(SERIAL_LOW)?;
    bench.exception(&write_words(SERIAL_LOW, &[serial, 1]), 6)
}
