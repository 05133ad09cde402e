//! The diagnostic counters (V1.02 appendix A), and the use of the buffers.

mod common;

use common::{Points, UNIT, Unit, frame, pdu, send};
use modbus_server::line::{Faults, Receiver};
use modbus_server::{Adu, Counters, Exception};

fn unit() -> Unit {
    Unit::new(Points::new(4, 4))
}

#[test]
fn each_request_increments_the_right_counters() {
    let mut unit = unit();
    let mut expected = Counters::default();
    let good = pdu(0x03, &[0, 1]);
    let beyond = pdu(0x03, &[4, 1]);

    unit.raw(&frame(UNIT, &good));
    expected.bus_messages += 1;
    expected.unit_messages += 1;
    assert_eq!(unit.counters(), expected, "a valid request");

    unit.raw(&frame(UNIT, &beyond));
    expected.bus_messages += 1;
    expected.unit_messages += 1;
    expected.exceptions += 1;
    assert_eq!(unit.counters(), expected, "a rejected request");

    unit.raw(&frame(0, &pdu(0x06, &[0, 1])));
    expected.bus_messages += 1;
    expected.unit_messages += 1;
    expected.no_response += 1;
    assert_eq!(unit.counters(), expected, "a broadcast");

    unit.raw(&frame(0, &beyond));
    expected.bus_messages += 1;
    expected.unit_messages += 1;
    expected.no_response += 1;
    expected.exceptions += 1;
    assert_eq!(unit.counters(), expected, "a rejected broadcast");

    unit.raw(&frame(UNIT + 1, &good));
    expected.bus_messages += 1;
    assert_eq!(unit.counters(), expected, "a request for another unit");

    unit.raw(&frame(UNIT, &good)[..7]);
    expected.communication_errors += 1;
    assert_eq!(unit.counters(), expected, "a truncated request");

    for (state, nak, busy) in [
        (Exception::ServerDeviceFailure, 0, 0),
        (Exception::NegativeAcknowledge, 1, 0),
        (Exception::ServerDeviceBusy, 0, 1),
    ] {
        unit.points.state = Some(state.code());
        unit.raw(&frame(UNIT, &good));
        expected.bus_messages += 1;
        expected.unit_messages += 1;
        expected.exceptions += 1;
        expected.nak += nak;
        expected.busy += busy;
        assert_eq!(unit.counters(), expected, "{state:?}");
    }

    // For a broadcast no exception is returned, so neither is counted.
    unit.points.state = Some(Exception::ServerDeviceBusy.code());
    unit.raw(&frame(0, &pdu(0x06, &[0, 1])));
    expected.bus_messages += 1;
    expected.unit_messages += 1;
    expected.no_response += 1;
    expected.exceptions += 1;
    assert_eq!(unit.counters(), expected, "a busy broadcast");
}

/// Returns a receiver that has detected its first silence and has no buffer.
fn receiver() -> Receiver<'static> {
    let mut receiver = Receiver::rtu(UNIT, false);
    receiver.close();
    receiver
}

fn receive(receiver: &mut Receiver<'_>, bytes: &[u8]) {
    bytes.iter().for_each(|byte| {
        receiver.character(*byte, Faults::NONE);
    });
}

fn buffer() -> &'static mut Adu {
    Box::leak(Box::default())
}

#[test]
fn request_without_a_free_buffer_is_counted_as_unanswered_not_as_busy() {
    let mut receiver = receiver();
    let ours = frame(UNIT, &pdu(0x03, &[0, 1]));
    receiver.give_back(buffer());
    receive(&mut receiver, &ours);
    let first = receiver.close().expect("a buffer was free");

    receive(&mut receiver, &ours);
    receiver.pause();
    assert!(receiver.close().is_none());
    assert_eq!(receiver.counters().dropped, 1);
    // Frames that would not have been served anyway are not counted as dropped.
    receive(&mut receiver, &frame(UNIT + 1, &pdu(0x03, &[0, 1])));
    assert!(receiver.close().is_none());
    receive(&mut receiver, &ours[..7]);
    assert!(receiver.close().is_none());
    receive(&mut receiver, &frame(UNIT, &[]));
    assert!(receiver.close().is_none());
    // One byte too long.
    receive(&mut receiver, &frame(UNIT, &[0x63; 254]));
    assert!(receiver.close().is_none());
    receiver.character(UNIT, Faults::PARITY);
    assert!(receiver.close().is_none());
    let line = *receiver.counters();
    assert_eq!(
        (line.dropped, line.bus_messages, line.communication_errors),
        (1, 3, 4)
    );

    receiver.give_back(first);
    receive(&mut receiver, &ours);
    let closed = receiver.close().expect("a buffer is free again");
    assert_eq!(closed.as_slice(), &ours[..6]);

    assert_eq!(receiver.counters().dropped, 1);
}

#[test]
fn buffers_given_back_during_a_frame_are_used_for_the_next() {
    let ours = frame(UNIT, &pdu(0x03, &[0, 1]));
    for at in 1..ours.len() {
        let mut receiver = receiver();
        receive(&mut receiver, &ours[..at]);
        receiver.give_back(buffer());
        receiver.give_back(buffer());
        receive(&mut receiver, &ours[at..]);
        receiver.pause();
        assert!(receiver.close().is_none());
        assert_eq!(receiver.counters().dropped, 1);
        for _ in 0..2 {
            receive(&mut receiver, &ours);
            assert_eq!(receiver.close().expect("a buffer").as_slice(), &ours[..6]);
        }
    }
}

#[test]
fn two_requests_can_be_held_at_once() {
    let mut receiver = receiver();
    receiver.give_back(buffer());
    receiver.give_back(buffer());
    let [one, two] = [1, 2].map(|count| frame(UNIT, &pdu(0x03, &[0, count])));
    receive(&mut receiver, &one);
    let first = receiver.close().expect("the first");
    receive(&mut receiver, &two);
    let second = receiver.close().expect("the second");
    assert_eq!(first.as_slice(), &one[..6]);
    assert_eq!(second.as_slice(), &two[..6]);
}

#[test]
fn frames_for_other_units_use_no_buffer() {
    let mut receiver = receiver();
    receiver.give_back(buffer());
    for _ in 0..5 {
        receive(&mut receiver, &frame(UNIT + 1, &pdu(0x03, &[0, 1])));
        assert!(receiver.close().is_none());
    }
    receive(&mut receiver, &frame(UNIT, &pdu(0x03, &[0, 1])));
    assert!(receiver.close().is_some());
}

#[test]
fn a_third_buffer_does_not_disturb_a_frame() {
    let mut receiver = receiver();
    receiver.give_back(buffer());
    receiver.give_back(buffer());
    let ours = frame(UNIT, &pdu(0x03, &[0, 1]));
    receive(&mut receiver, &ours);
    let first = receiver.close().expect("the first");
    receive(&mut receiver, &ours[..3]);
    receiver.give_back(first);
    receiver.give_back(buffer());
    receive(&mut receiver, &ours[3..]);
    assert_eq!(receiver.close().expect("whole").as_slice(), &ours[..6]);
}

#[test]
fn counters_read_while_a_request_is_pending_do_not_wrap() {
    let mut unit = unit();
    let at_port = |unit: &Unit| unit.counters().as_words();
    unit.characters(&frame(UNIT, &[0x0C]));
    assert!(unit.port.long_silence(0));
    let pending = unit.port.take().expect("a request");
    // A damaged frame is received while the request is pending.
    unit.characters(&[0x55; 5]);
    assert!(!unit.port.long_silence(0));
    assert_eq!(at_port(&unit), [1, 1, 0, 0, 0, 0, 0, 0, 0]);
    let reply = unit.server.serve(pending, &mut unit.points);
    unit.port.send(reply, 0);
    let reply = send(&mut unit.port).expect("a reply");
    // Byte count, status, event count, message count, events.
    let expected = [0x0C, 7, 0, 0, 0, 0, 0, 1, 0x80];
    assert_eq!(reply, frame(UNIT, &expected));
    let at_request = unit.server.counters().as_words();
    assert_eq!(at_request, [1, 0, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(at_port(&unit), [1, 1, 0, 1, 0, 0, 0, 0, 0]);

    let reply = unit.request(&[0x0C]).expect("a reply");
    let expected = [0x0C, 10, 0, 0, 0, 0, 0, 2, 0x80, 0x82, 0x40, 0x80];
    assert_eq!(reply, expected);
}
