//! Tests of the radio line with a simulated module.

mod bench;

use modbus_server::{Counters, Outcome};

use super::*;
use bench::*;

#[test]
fn request_is_answered_after_the_frame_gap() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    assert_eq!(bench.pass(GAP_MS), None);
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    bench.pass(2);
    assert_eq!(bench.sent(), REPLY);
    bench.is_well();
    let counters = bench.counters();
    assert_eq!(
        (counters.bus_messages, counters.communication_errors),
        (4, 0)
    );
}

#[test]
fn pauses_below_the_frame_gap_do_not_end_a_frame_and_are_not_counted() {
    let mut bench = Bench::new();
    for part in READ.chunks(3) {
        bench.receive(part);
        assert_eq!(bench.pass(GAP_MS), None);
    }
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    assert_eq!(bench.counters().gaps, 0);
}

#[test]
fn pause_of_the_frame_gap_ends_a_frame() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.pass(GAP_MS + 1);
    bench.receive(&READ[4..]);
    assert_eq!(bench.pass(GAP_MS + 1), None);
    assert_eq!(bench.counters().communication_errors, 2);
    bench.is_well();
}

#[test]
fn silence_is_not_shorter_when_the_task_was_late() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.pass(1);
    bench.receive(&READ[4..]);
    // Stopped for longer than the frame gap, while the rest of the frame was received.
    bench.now_ms += 60;
    assert!(!bench.line.poll(bench.now_ms, 60));
    assert_eq!(bench.pass(GAP_MS), Some(Outcome::Accepted));
}

#[test]
fn damaged_byte_spoils_its_frame_only() {
    let mut bench = Bench::new();
    bench.receive(&READ[..4]);
    bench.module.0.borrow_mut().to_unit.push_back(None);
    bench.receive(&READ[4..]);
    assert_eq!(bench.pass(GAP_MS + 5), None);
    assert_eq!(bench.counters().communication_errors, 1);
    bench.is_well();
}

#[test]
fn rest_of_a_frame_at_the_start_is_ignored() {
    let mut bench = Bench::starting();
    while bench.line.works().is_none() {
        bench.pass(1);
    }
    bench.receive(&READ);
    assert_eq!(bench.pass(GAP_MS + 1), None);
    assert_eq!(bench.counters(), Counters::default());
    bench.is_well();
}

#[test]
fn reply_waits_while_the_radio_is_busy() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    bench.pass(GAP_MS);
    bench.module.0.borrow_mut().busy = true;
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
    bench.pass(500);
    assert_eq!(bench.sent(), []);
    assert!(bench.line.is_replying());
    bench.module.0.borrow_mut().busy = false;
    bench.pass(1);
    assert_eq!(bench.sent(), REPLY);
}

#[test]
fn reply_ends_when_the_radio_has_sent_it() {
    let mut bench = Bench::new();
    bench.module.0.borrow_mut().room = 3;
    bench.receive(&READ);
    bench.pass(GAP_MS + 10);
    assert_eq!(
        bench.module.0.borrow().from_unit,
        REPLY[..3],
        "the UART is full"
    );
    bench.module.0.borrow_mut().room = 1000;
    bench.module.0.borrow_mut().unflushed = true;
    bench.pass(1);
    assert_eq!(bench.sent(), REPLY);
    assert!(
        bench.line.is_replying(),
        "bytes are still on their way to the radio"
    );
    bench.module.0.borrow_mut().unflushed = false;
    bench.module.0.borrow_mut().busy = true;
    bench.pass(100);
    assert!(bench.line.is_replying(), "the radio sends");
    bench.module.0.borrow_mut().busy = false;
    bench.now_ms += 1;
    assert!(bench.line.poll(bench.now_ms, 1), "the module has the reply");
    assert!(!bench.line.is_replying());
    assert!(bench.line.is_on_air(), "the last packet");
    for _ in 1..SETTINGS.packet_ms() {
        bench.now_ms += 1;
        assert!(!bench.line.poll(bench.now_ms, 1));
        assert!(bench.line.is_on_air());
    }
    bench.now_ms += 1;
    assert!(bench.line.poll(bench.now_ms, 1), "the reply has been sent");
    assert!(!bench.line.is_on_air());
    bench.is_well();
}

#[test]
fn request_while_the_last_packet_may_be_on_the_air_is_served() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.receive(&READ);
        assert_eq!(bench.pass(GAP_MS + 1), Some(Outcome::Accepted));
        bench.pass(2);
        assert_eq!(bench.sent(), REPLY);
    }
}

#[test]
fn bytes_received_during_a_reply_are_discarded() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    bench.module.0.borrow_mut().unflushed = true;
    bench.pass(GAP_MS + 2);
    bench.receive(&READ);
    bench.pass(10);
    bench.module.0.borrow_mut().unflushed = false;
    assert_eq!(bench.pass(100), None);
    assert_eq!(bench.sent(), REPLY);
    bench.is_well();
}

#[test]
fn broadcast_write_is_done_in_silence() {
    let mut bench = Bench::new();
    bench.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
    assert_eq!(bench.pass(GAP_MS + 1), Some(Outcome::Accepted));
    bench.pass(10);
    assert_eq!(bench.registers[2], 0xABCD);
    assert_eq!(bench.sent(), []);
    bench.is_well();
}

#[test]
fn request_for_another_unit_is_ignored() {
    let mut bench = Bench::new();
    bench.receive(&[0x12, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x68]);
    assert_eq!(bench.pass(GAP_MS + 10), None);
    assert_eq!(bench.sent(), []);
    assert_eq!(bench.counters().bus_messages, 1);
    bench.is_well();
}

#[test]
fn radio_that_does_not_answer_is_reported_until_it_does() {
    let mut bench = Bench::starting();
    bench.module.0.borrow_mut().silent = true;
    bench.pass(2000);
    assert_eq!(bench.line.works(), Some(false));
    bench.pass(5000);
    assert_eq!(bench.line.works(), Some(false), "another attempt");
    bench.module.0.borrow_mut().silent = false;
    bench.pass(12_000);
    assert_eq!(bench.line.works(), Some(true));
    bench.pass(GAP_MS);
    bench.sent();
    bench.is_well();
}

#[test]
fn reply_is_aborted_when_the_radio_fails_and_later_requests_are_served() {
    for begun in [false, true] {
        let mut bench = Bench::new();
        bench.receive(&READ);
        bench.pass(GAP_MS);
        bench.module.0.borrow_mut().busy = !begun;
        bench.module.0.borrow_mut().unflushed = true;
        bench.pass(2);
        assert_eq!(bench.sent().is_empty(), !begun);
        bench.module.0.borrow_mut().busy = true;
        while bench.line.works() == Some(true) {
            assert!(bench.line.is_replying());
            bench.now_ms += 1;
            let ended = bench.line.poll(bench.now_ms, 1);
            assert_eq!(ended, bench.line.works() == Some(false));
        }
        assert!(!bench.line.is_replying(), "begun: {begun}");
        bench.module.0.borrow_mut().busy = false;
        bench.module.0.borrow_mut().unflushed = false;
        bench.pass(12_000);
        bench.sent();
        bench.is_well();
    }
}
