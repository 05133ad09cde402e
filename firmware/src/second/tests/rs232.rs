//! Tests of the second line as RS-232.

extern crate std;
use std::vec::Vec;

use modbus_server::{Counters, Outcome};

use super::rig::*;
use crate::second::Rs232;

/// Milliseconds from the call that finds the last byte of a complete frame to its end, one before that in which the reply
/// begins. t3.5 of 9600 8N1 is 3.65.
const GAP_MS: u16 = 3;

/// Receives a request and returns the reply.
fn reply_to(rig: &mut Rig<Rs232<Shared>>, request: &[u8]) -> Vec<u8> {
    rig.receive(request);
    rig.pass(1 + 4 + 1);
    rig.sent()
}

#[test]
fn complete_request_is_answered_after_t35() {
    let mut rig = Rig::rs232();
    for _ in 0..3 {
        rig.receive(&READ);
        assert_eq!(rig.pass(GAP_MS), None);
        assert_eq!(rig.pass(1), Some(Outcome::Accepted));
        assert_eq!(rig.sent(), []);
        rig.pass(1);
        assert_eq!(rig.sent(), REPLY);
    }
    assert_eq!(rig.line.works(), None, "there is no radio");
}

#[test]
fn request_has_ended_with_its_last_byte() {
    super::assert_ends_with_its_last_byte(Rig::rs232(), &READ, GAP_MS + 1);
}

#[test]
fn two_requests_without_t35_between_them_are_one_damaged_frame() {
    let mut rig = Rig::rs232();
    rig.receive(&READ);
    assert_eq!(rig.pass(GAP_MS), None);
    assert_eq!(reply_to(&mut rig, &READ), []);
    assert_eq!(rig.counters().communication_errors, 1);
    assert_eq!(reply_to(&mut rig, &READ), REPLY);
}

#[test]
fn requests_with_t35_between_them_are_two() {
    let mut rig = Rig::rs232();
    rig.receive(&[0x00, 0x06, 0x00, 0x02, 0xAB, 0xCD, 0x97, 0x7E]);
    assert_eq!(rig.pass(1 + GAP_MS), Some(Outcome::Accepted));
    assert_eq!(reply_to(&mut rig, &READ), REPLY);
    assert_eq!(rig.counters().communication_errors, 0);
    assert_eq!(rig.registers[2], 0xABCD);
}

#[test]
fn request_of_unknown_length_ends_after_a_longer_silence() {
    let mut rig = Rig::rs232();
    rig.receive(&echo());
    assert_eq!(rig.pass(1 + GAP_MS), None);
    assert_eq!(rig.pass(1), Some(Outcome::Accepted));
}

#[test]
fn pause_of_t15_is_counted_and_one_of_t35_ends_the_frame() {
    for (pause_ms, gaps, errors) in [(2, 0, 0), (3, 0, 0), (4, 1, 0), (5, 0, 2), (40, 0, 2)] {
        let mut rig = Rig::rs232();
        rig.receive(&READ[..4]);
        rig.pass(pause_ms);
        let reply = reply_to(&mut rig, &READ[4..]);
        assert_eq!(reply == REPLY, errors == 0, "{pause_ms}");
        let counters = rig.counters();
        assert_eq!(
            (counters.gaps, counters.communication_errors),
            (gaps, errors),
            "{pause_ms}"
        );
    }
}

#[test]
fn damaged_byte_spoils_its_frame_only() {
    let mut rig = Rig::rs232();
    rig.receive(&READ[..4]);
    rig.module.0.borrow_mut().to_unit.push_back(None);
    assert_eq!(reply_to(&mut rig, &READ[4..]), []);
    assert_eq!(rig.counters().communication_errors, 1);
    assert_eq!(reply_to(&mut rig, &READ), REPLY);
}

#[test]
fn rest_of_a_frame_at_the_start_is_ignored() {
    let mut rig = Rig::rs232_starting();
    assert_eq!(reply_to(&mut rig, &READ), []);
    assert_eq!(rig.counters(), Counters::default());
    assert_eq!(reply_to(&mut rig, &READ), REPLY);
}

#[test]
fn reply_is_ending_while_the_uart_sends_its_last_two_bytes() {
    let mut rig = Rig::rs232();
    rig.module.0.borrow_mut().unflushed = true;
    assert_eq!(reply_to(&mut rig, &READ), REPLY);
    rig.pass(10);
    assert!(rig.line.is_replying() && !rig.line.is_ending());
    rig.module.0.borrow_mut().unflushed = false;
    rig.pass(1);
    // Two bytes take 2.1 ms.
    for _ in 0..3 {
        assert!(!rig.line.is_replying() && rig.line.is_ending());
        rig.pass(1);
    }
    assert!(!rig.line.is_ending());
}

#[test]
fn address_can_change() {
    let mut rig = Rig::rs232();
    rig.line.set_units(18);
    assert_eq!(reply_to(&mut rig, &READ), []);
    let request = frame(&[0x12, 0x03, 0, 4, 0, 1]);
    assert_eq!(reply_to(&mut rig, &request)[..3], [0x12, 3, 2]);
}
