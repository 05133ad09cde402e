//! Tests of the second line as a radio, with a simulated module.

extern crate std;
mod rig;
mod rs232;

use std::vec::Vec;

use modbus_server::{Counters, Outcome};

use rig::*;

#[test]
fn complete_request_is_answered_without_a_silence() {
    let mut rig = Rig::new();
    for byte in &READ[..7] {
        rig.receive(&[*byte]);
        assert_eq!(rig.pass(1), None);
    }
    rig.receive(&READ[7..]);
    assert_eq!(rig.pass(1), Some(Outcome::Accepted));
    rig.pass(2);
    assert_eq!(rig.sent(), REPLY);
    rig.is_well();
    let counters = rig.counters();
    assert_eq!(
        (counters.bus_messages, counters.communication_errors),
        (4, 0)
    );
}

#[test]
fn request_that_is_never_complete_is_answered_after_the_frame_gap() {
    for request in [echo(), frame(&[0x11, 0x09, 0])] {
        let mut rig = Rig::new();
        rig.receive(&request);
        assert_eq!(rig.pass(GAP_MS), None);
        let outcome = rig.pass(1);
        assert!(outcome.is_some(), "{request:02X?}");
        rig.pass(2);
        let reply = rig.sent();
        assert_eq!(reply == request, outcome == Some(Outcome::Accepted));
        assert_eq!(
            reply[..2],
            [0x11, if reply == request { 0x08 } else { 0x89 }]
        );
        rig.is_well();
    }
}

#[test]
fn request_has_ended_with_its_last_byte() {
    for (request, wait) in [(READ.to_vec(), 1), (echo(), GAP_MS + 1)] {
        assert_ends_with_its_last_byte(Rig::new(), &request, wait);
    }
}

/// Asserts that a request is served within `wait` milliseconds, and has ended with its last byte.
fn assert_ends_with_its_last_byte<P: super::Peer>(mut rig: Rig<P>, request: &[u8], wait: u16) {
    rig.receive(request);
    let received_at = rig.now_ms + 1;
    let served = (0..wait).any(|_| {
        rig.now_ms += 1;
        rig.line.poll(rig.now_ms, 1)
    });
    assert!(served);
    let request = rig.line.take().expect("a request");
    assert_eq!(request.ended(), received_at);
}

/// Units 18 and 19 are asked in turn with this one, and no silence is as long as the frame gap.
#[test]
fn other_units_requests_and_replies_end_when_they_are_complete() {
    let mut rig = Rig::new();
    let mut others = 0;
    for length in (2..=52).step_by(2) {
        let request = frame(&[0x12, 0x03, 0, 4, 0, length / 2]);
        let data: Vec<u8> = (0..length).collect();
        let reply = frame(&[&[0x12, 0x03, length], &data[..]].concat());
        let write = frame(&[0x13, 0x06, 0, length, 0x12, 0x34]);
        for other in [&request, &reply, &write, &write] {
            rig.receive(other);
            assert_eq!(rig.pass(GAP_MS - 1), None);
            others += 1;
        }
        rig.receive(&READ);
        assert_eq!(rig.pass(1), Some(Outcome::Accepted));
        rig.pass(GAP_MS - 1);
        assert_eq!(rig.sent(), REPLY);
        // A broadcast begins with 0.
        rig.receive(&reply);
        rig.pass(10);
        rig.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
        assert_eq!(rig.pass(1), Some(Outcome::Accepted));
        assert_eq!(core::mem::take(&mut rig.registers[2]), 0xABCD);
        others += 1;
    }
    let counters = rig.counters();
    assert_eq!(counters.bus_messages, others + 2 * 26);
    assert_eq!(counters.communication_errors, 0);
}

/// No silence is as long as the frame gap, because the others answer sooner.
#[test]
fn unit_that_is_out_of_step_with_a_busy_air_receives_again() {
    let reply_of_two_packets = frame(&[&[0x12, 0x03, 64][..], &[7; 64]].concat());
    let after_a_lost_packet = || {
        let mut rig = Rig::new();
        rig.receive(&reply_of_two_packets[..58]);
        rig
    };
    let after_the_start = || {
        let mut rig = Rig::starting();
        while rig.line.works().is_none() {
            rig.pass(1);
        }
        rig
    };
    for mut rig in [after_a_lost_packet(), after_the_start()] {
        let mut received = Vec::new();
        for _ in 0..20 {
            for other in [&[0x12, 0x03, 0, 4, 0, 1][..], &[0x12, 0x03, 2, 0, 1]] {
                rig.pass(GAP_MS - 1);
                rig.receive(&frame(other));
            }
            rig.pass(GAP_MS - 1);
            rig.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
            received.push(rig.pass(GAP_MS - 1).is_some());
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
            let mut rig = Rig::new();
            for byte in &other {
                rig.receive(&[*byte]);
                rig.pass(ms_per_byte);
            }
            rig.pass(GAP_MS - 1);
            rig.receive(&READ);
            assert_eq!(rig.pass(1), Some(Outcome::Accepted), "{other:02X?}");
            assert_eq!(rig.counters().bus_messages, 2);
        }
        ends_in_0 += 1;
    }
    assert!(ends_in_0 >= 2, "{ends_in_0}");
}

#[test]
fn another_units_reply_and_a_request_without_a_silence_between_them_are_two_frames() {
    let mut rig = Rig::new();
    rig.receive(&frame(&[0x12, 0x03, 2, 0, 1]));
    rig.receive(&READ);
    assert_eq!(rig.pass(2), Some(Outcome::Accepted));
    rig.pass(2);
    assert_eq!(rig.sent(), REPLY);
}

#[test]
fn pauses_below_the_frame_gap_do_not_end_a_frame_and_are_not_counted() {
    let mut rig = Rig::new();
    for part in READ.chunks(3) {
        assert_eq!(rig.pass(GAP_MS), None);
        rig.receive(part);
    }
    assert_eq!(rig.pass(1), Some(Outcome::Accepted));
    assert_eq!(rig.counters().gaps, 0);
}

#[test]
fn pause_of_the_frame_gap_ends_a_frame() {
    let mut rig = Rig::new();
    rig.receive(&READ[..4]);
    rig.pass(GAP_MS + 1);
    rig.receive(&READ[4..]);
    assert_eq!(rig.pass(GAP_MS + 1), None);
    assert_eq!(rig.counters().communication_errors, 2);
    rig.is_well();
}

#[test]
fn silence_is_not_shorter_when_the_task_was_late() {
    let mut rig = Rig::new();
    rig.receive(&echo()[..4]);
    rig.pass(1);
    rig.receive(&echo()[4..]);
    // Stopped for longer than the frame gap, while the rest of the frame was received.
    rig.now_ms += 60;
    assert!(!rig.line.poll(rig.now_ms, 60));
    assert_eq!(rig.pass(GAP_MS), Some(Outcome::Accepted));
}

#[test]
fn damaged_byte_spoils_its_frame_only() {
    let mut rig = Rig::new();
    rig.receive(&READ[..4]);
    rig.module.0.borrow_mut().to_unit.push_back(None);
    rig.receive(&READ[4..]);
    assert_eq!(rig.pass(GAP_MS + 5), None);
    assert_eq!(rig.counters().communication_errors, 1);
    rig.is_well();
}

#[test]
fn rest_of_a_frame_at_the_start_is_ignored() {
    let mut rig = Rig::starting();
    while rig.line.works().is_none() {
        rig.pass(1);
    }
    rig.receive(&READ);
    assert_eq!(rig.pass(GAP_MS + 1), None);
    assert_eq!(rig.counters(), Counters::default());
    rig.is_well();
}

#[test]
fn reply_waits_while_the_radio_is_busy() {
    let mut rig = Rig::new();
    rig.receive(&READ);
    rig.module.0.borrow_mut().busy = true;
    assert_eq!(rig.pass(1), Some(Outcome::Accepted));
    rig.pass(500);
    assert_eq!(rig.sent(), []);
    assert!(rig.line.is_replying());
    rig.module.0.borrow_mut().busy = false;
    rig.pass(1);
    assert_eq!(rig.sent(), REPLY);
}

#[test]
fn reply_ends_when_the_radio_has_sent_it() {
    let mut rig = Rig::new();
    rig.module.0.borrow_mut().room = 3;
    rig.receive(&READ);
    rig.pass(10);
    assert_eq!(
        rig.module.0.borrow().from_unit,
        REPLY[..3],
        "the UART is full"
    );
    rig.module.0.borrow_mut().room = 1000;
    rig.module.0.borrow_mut().unflushed = true;
    rig.pass(1);
    assert_eq!(rig.sent(), REPLY);
    assert!(
        rig.line.is_replying(),
        "bytes are still on their way to the radio"
    );
    rig.module.0.borrow_mut().unflushed = false;
    rig.module.0.borrow_mut().busy = true;
    rig.pass(100);
    assert!(rig.line.is_replying(), "the radio sends");
    rig.module.0.borrow_mut().busy = false;
    rig.now_ms += 1;
    assert!(rig.line.poll(rig.now_ms, 1), "the module has the reply");
    assert!(!rig.line.is_replying());
    assert!(rig.line.is_ending(), "the last packet");
    for _ in 1..SETTINGS.packet_ms() {
        rig.now_ms += 1;
        assert!(!rig.line.poll(rig.now_ms, 1));
        assert!(rig.line.is_ending());
    }
    rig.now_ms += 1;
    assert!(rig.line.poll(rig.now_ms, 1), "the reply has been sent");
    assert!(!rig.line.is_ending());
    rig.is_well();
}

#[test]
fn request_while_the_last_packet_may_be_on_the_air_is_served() {
    let mut rig = Rig::new();
    for _ in 0..3 {
        rig.receive(&READ);
        assert_eq!(rig.pass(1), Some(Outcome::Accepted));
        rig.pass(2);
        assert_eq!(rig.sent(), REPLY);
    }
}

#[test]
fn bytes_received_during_a_reply_are_discarded() {
    let mut rig = Rig::new();
    rig.receive(&READ);
    rig.module.0.borrow_mut().unflushed = true;
    rig.pass(2);
    rig.receive(&READ);
    rig.pass(10);
    rig.module.0.borrow_mut().unflushed = false;
    assert_eq!(rig.pass(100), None);
    assert_eq!(rig.sent(), REPLY);
    rig.is_well();
}

#[test]
fn broadcast_write_is_done_in_silence() {
    let mut rig = Rig::new();
    rig.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
    assert_eq!(rig.pass(1), Some(Outcome::Accepted));
    rig.pass(10);
    assert_eq!(rig.registers[2], 0xABCD);
    assert_eq!(rig.sent(), []);
    rig.is_well();
}

#[test]
fn request_for_another_unit_is_ignored() {
    let mut rig = Rig::new();
    rig.receive(&[0x12, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x68]);
    assert_eq!(rig.pass(GAP_MS + 10), None);
    assert_eq!(rig.sent(), []);
    assert_eq!(rig.counters().bus_messages, 1);
    rig.is_well();
}

#[test]
fn radio_that_does_not_answer_is_reported_until_it_does() {
    let mut rig = Rig::starting();
    rig.module.0.borrow_mut().silent = true;
    rig.pass(2000);
    assert_eq!(rig.line.works(), Some(false));
    rig.pass(5000);
    assert_eq!(rig.line.works(), Some(false), "another attempt");
    rig.module.0.borrow_mut().silent = false;
    rig.pass(12_000);
    assert_eq!(rig.line.works(), Some(true));
    rig.pass(GAP_MS);
    rig.sent();
    rig.is_well();
}

#[test]
fn reply_is_aborted_when_the_radio_fails_and_later_requests_are_served() {
    for begun in [false, true] {
        let mut rig = Rig::new();
        rig.receive(&READ);
        rig.module.0.borrow_mut().busy = !begun;
        rig.module.0.borrow_mut().unflushed = true;
        rig.pass(2);
        assert_eq!(rig.sent().is_empty(), !begun);
        rig.module.0.borrow_mut().busy = true;
        while rig.line.works() == Some(true) {
            assert!(rig.line.is_replying());
            rig.now_ms += 1;
            let ended = rig.line.poll(rig.now_ms, 1);
            assert_eq!(ended, rig.line.works() == Some(false));
        }
        assert!(!rig.line.is_replying(), "begun: {begun}");
        rig.module.0.borrow_mut().busy = false;
        rig.module.0.borrow_mut().unflushed = false;
        rig.pass(12_000);
        rig.sent();
        rig.is_well();
    }
}
