//! Tests of the second line as a radio, with a simulated module.

extern crate std;
mod bench;
mod rs232;

use std::vec::Vec;

use modbus_server::{Counters, Outcome};

use bench::*;

#[test]
fn complete_request_is_answered_without_a_silence() {
    let mut bench = Bench::new();
    for byte in &READ[..7] {
        bench.receive(&[*byte]);
        assert_eq!(bench.pass(1), None);
    }
    bench.receive(&READ[7..]);
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
fn request_that_is_never_complete_is_answered_after_the_frame_gap() {
    for request in [echo(), frame(&[0x11, 0x09, 0])] {
        let mut bench = Bench::new();
        bench.receive(&request);
        assert_eq!(bench.pass(GAP_MS), None);
        let outcome = bench.pass(1);
        assert!(outcome.is_some(), "{request:02X?}");
        bench.pass(2);
        let reply = bench.sent();
        assert_eq!(reply == request, outcome == Some(Outcome::Accepted));
        assert_eq!(
            reply[..2],
            [0x11, if reply == request { 0x08 } else { 0x89 }]
        );
        bench.is_well();
    }
}

#[test]
fn request_has_ended_with_its_last_byte() {
    for (request, wait) in [(READ.to_vec(), 1), (echo(), GAP_MS + 1)] {
        assert_ends_with_its_last_byte(Bench::new(), &request, wait);
    }
}

/// Asserts that a request is served within `wait` milliseconds, and has ended with its last byte.
fn assert_ends_with_its_last_byte<P: super::Peer>(mut bench: Bench<P>, request: &[u8], wait: u16) {
    bench.receive(request);
    let received_at = bench.now_ms + 1;
    let served = (0..wait).any(|_| {
        bench.now_ms += 1;
        bench.line.poll(bench.now_ms, 1)
    });
    assert!(served);
    let request = bench.line.take().expect("a request");
    assert_eq!(request.ended(), received_at);
}

/// Units 18 and 19 are asked in turn with this one, and no silence is as long as the frame gap.
#[test]
fn other_units_requests_and_replies_end_when_they_are_complete() {
    let mut bench = Bench::new();
    let mut others = 0;
    for length in (2..=52).step_by(2) {
        let request = frame(&[0x12, 0x03, 0, 4, 0, length / 2]);
        let data: Vec<u8> = (0..length).collect();
        let reply = frame(&[&[0x12, 0x03, length], &data[..]].concat());
        let write = frame(&[0x13, 0x06, 0, length, 0x12, 0x34]);
        for other in [&request, &reply, &write, &write] {
            bench.receive(other);
            assert_eq!(bench.pass(GAP_MS - 1), None);
            others += 1;
        }
        bench.receive(&READ);
        assert_eq!(bench.pass(1), Some(Outcome::Accepted));
        bench.pass(GAP_MS - 1);
        assert_eq!(bench.sent(), REPLY);
        // A broadcast begins with 0.
        bench.receive(&reply);
        bench.pass(10);
        bench.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
        assert_eq!(bench.pass(1), Some(Outcome::Accepted));
        assert_eq!(core::mem::take(&mut bench.registers[2]), 0xABCD);
        others += 1;
    }
    let counters = bench.counters();
    assert_eq!(counters.bus_messages, others + 2 * 26);
    assert_eq!(counters.communication_errors, 0);
}

/// No silence is as long as the frame gap, because the others answer sooner.
#[test]
fn unit_that_is_out_of_step_with_a_busy_air_receives_again() {
    let reply_of_two_packets = frame(&[&[0x12, 0x03, 64][..], &[7; 64]].concat());
    let after_a_lost_packet = || {
        let mut bench = Bench::new();
        bench.receive(&reply_of_two_packets[..58]);
        bench
    };
    let after_the_start = || {
        let mut bench = Bench::starting();
        while bench.line.works().is_none() {
            bench.pass(1);
        }
        bench
    };
    for mut bench in [after_a_lost_packet(), after_the_start()] {
        let mut received = Vec::new();
        for _ in 0..20 {
            for other in [&[0x12, 0x03, 0, 4, 0, 1][..], &[0x12, 0x03, 2, 0, 1]] {
                bench.pass(GAP_MS - 1);
                bench.receive(&frame(other));
            }
            bench.pass(GAP_MS - 1);
            bench.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
            received.push(bench.pass(GAP_MS - 1).is_some());
        }
        assert_eq!(received[10..], [true; 10], "{received:?}");
    }
}

/// A frame whose CRC ends in 0 can be complete one byte before its end. The byte 0 is not the beginning of a frame.
#[test]
fn last_byte_of_another_units_crc_is_not_the_beginning_of_the_next_frame() {
    let requests = (0x0200_u16..0x0300).map(|at| {
        let [high, low] = at.to_be_bytes();
        frame(&[0x12, 0x03, high, low, 0, 1])
    });
    let replies = (0..=255).map(|low| frame(&[0x12, 0x03, 4, 0, 0, 0, low]));
    let mut ends_in_0 = 0;
    for other in requests
        .chain(replies)
        .filter(|frame| frame.ends_with(&[0]))
    {
        for ms_per_byte in [0, 1, 2] {
            let mut bench = Bench::new();
            for byte in &other {
                bench.receive(&[*byte]);
                bench.pass(ms_per_byte);
            }
            bench.pass(GAP_MS - 1);
            bench.receive(&READ);
            assert_eq!(bench.pass(1), Some(Outcome::Accepted), "{other:02X?}");
            assert_eq!(bench.counters().bus_messages, 2);
        }
        ends_in_0 += 1;
    }
    assert!(ends_in_0 >= 2, "{ends_in_0}");
}

#[test]
fn another_units_reply_and_a_request_without_a_silence_between_them_are_two_frames() {
    let mut bench = Bench::new();
    bench.receive(&frame(&[0x12, 0x03, 2, 0, 1]));
    bench.receive(&READ);
    assert_eq!(bench.pass(2), Some(Outcome::Accepted));
    bench.pass(2);
    assert_eq!(bench.sent(), REPLY);
}

#[test]
fn pauses_below_the_frame_gap_do_not_end_a_frame_and_are_not_counted() {
    let mut bench = Bench::new();
    for part in READ.chunks(3) {
        assert_eq!(bench.pass(GAP_MS), None);
        bench.receive(part);
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
    bench.receive(&echo()[..4]);
    bench.pass(1);
    bench.receive(&echo()[4..]);
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
    bench.pass(10);
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
    assert!(bench.line.is_ending(), "the last packet");
    for _ in 1..SETTINGS.packet_ms() {
        bench.now_ms += 1;
        assert!(!bench.line.poll(bench.now_ms, 1));
        assert!(bench.line.is_ending());
    }
    bench.now_ms += 1;
    assert!(bench.line.poll(bench.now_ms, 1), "the reply has been sent");
    assert!(!bench.line.is_ending());
    bench.is_well();
}

#[test]
fn request_while_the_last_packet_may_be_on_the_air_is_served() {
    let mut bench = Bench::new();
    for _ in 0..3 {
        bench.receive(&READ);
        assert_eq!(bench.pass(1), Some(Outcome::Accepted));
        bench.pass(2);
        assert_eq!(bench.sent(), REPLY);
    }
}

#[test]
fn bytes_received_during_a_reply_are_discarded() {
    let mut bench = Bench::new();
    bench.receive(&READ);
    bench.module.0.borrow_mut().unflushed = true;
    bench.pass(2);
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
    assert_eq!(bench.pass(1), Some(Outcome::Accepted));
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
