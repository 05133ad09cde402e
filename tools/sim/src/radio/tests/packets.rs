//! Packets that a module sends and receives.

use super::host::{Host, bytes, ms, near};
use crate::radio::{Mode, Packet, Parameters, Sender, timing};
use f103::corner::Corner;
use f103::periph::usart::{TxPin, Wire};
use f103::time::Time;

/// Returns the duration of a byte at 9600 8N1.
fn byte() -> Time {
    Time::cycles(10, 9600)
}

fn normal() -> Host {
    Host::in_normal_mode(Parameters::FACTORY)
}

#[test]
fn packet_begins_after_three_byte_times_of_silence() {
    let mut host = normal();
    let begin = host.now();
    let end = host.send(&[1, 2, 3]);
    host.run_for(ms(300));
    let packet = host.air().packets().next().cloned().expect("a packet");
    assert_eq!((packet.sender, packet.number), (Sender::Board(0), 1));
    assert_eq!(packet.bytes, [1, 2, 3]);
    assert!(near(packet.start, end + byte() * 3));
    assert_eq!(
        packet.end - packet.start,
        timing::packet(3, 2400, Corner::Nominal)
    );
    // AUX falls with the first byte, and rises when the last packet begins.
    let edges = host.aux_since(begin);
    assert_eq!(edges.len(), 2, "{edges:?}");
    assert!(edges[0].0 < begin + byte() && !edges[0].1);
    assert_eq!(edges[1], (packet.start, true));
    let received = host.air().take_received();
    let received_bytes: Vec<u8> = received.iter().map(|byte| byte.byte).collect();
    assert_eq!(received_bytes, [1, 2, 3]);
    let first = received[0].start;
    assert_eq!(first, packet.end + timing::CHECK + timing::OUTPUT_DELAY);
    assert_eq!(host.module().packets_sent(), 1);
    assert_eq!(host.air().gateway().packets_received(), 1);
}

#[test]
fn pause_of_less_than_three_byte_times_does_not_end_a_packet() {
    let mut host = normal();
    let end = host.send(&[1, 2]);
    host.run_until(end + byte() * 2);
    let end = host.send(&[3]);
    host.run_until(end + byte() * 4);
    host.send(&[4]);
    host.run_for(ms(300));
    let sent: Vec<_> = host.air().packets().map(|p| p.bytes.clone()).collect();
    assert_eq!(sent, [vec![1, 2, 3], vec![4]]);
}

#[test]
fn long_message_is_sent_in_packets_of_58_bytes_and_received_with_a_pause() {
    let mut host = normal();
    let message: Vec<u8> = (0..150).collect();
    let end = host.send(&message);
    host.run_until(end + ms(1200));
    let packets: Vec<_> = host.air().packets().cloned().collect();
    let sizes: Vec<_> = packets.iter().map(|packet| packet.bytes.len()).collect();
    assert_eq!(sizes, [58, 58, 34]);
    assert!(
        packets[0].start < end,
        "the first packet begins during the message"
    );
    for pair in packets.windows(2) {
        assert_eq!(pair[1].start, pair[0].end + timing::TURNAROUND);
    }
    let received = host.air().take_received();
    let received_bytes: Vec<u8> = received.iter().map(|byte| byte.byte).collect();
    assert_eq!(received_bytes, message);
    for (n, pair) in received.windows(2).enumerate() {
        let gap = pair[1].start - pair[0].end;
        if (n + 1) % 58 == 0 {
            assert!(gap > ms(100), "{gap} after byte {n}");
        } else {
            assert!(gap < Time::from_ns(1), "{gap} after byte {n}");
        }
    }
}

#[test]
fn bytes_beyond_the_buffer_are_lost() {
    let slow = Parameters::FACTORY.with_air_rate_code(0);
    let mut host = Host::in_normal_mode(slow);
    let message: Vec<u8> = (0..=255).cycle().take(700).collect();
    let end = host.send(&message);
    host.run_until(end + Time::from_secs(40));
    let sent: Vec<u8> = host.air().packets().flat_map(|p| p.bytes.clone()).collect();
    // The first packet has left the buffer, and the second has not begun when the message ends.
    assert_eq!(sent.len(), 58 + 512);
    assert_eq!(sent, message[..570]);
    assert_eq!(bytes_received(&mut host), sent);
}

fn bytes_received(host: &mut Host) -> Vec<u8> {
    host.air().take_received().iter().map(|b| b.byte).collect()
}

#[test]
fn aux_falls_when_a_packet_was_received_and_rises_after_its_bytes() {
    let mut host = normal();
    let now = host.now();
    host.air().send(now, b"request");
    host.run_for(ms(300));
    let packet = host.air().packets().next().cloned().expect("a packet");
    let received = host.received();
    assert_eq!(bytes(&received), b"request");
    let checked = packet.end + timing::CHECK;
    let (_, start, _) = received[0];
    assert_eq!(start, checked + timing::OUTPUT_DELAY);
    let edges = host.aux_since(now);
    assert_eq!(edges.len(), 2);
    assert_eq!(edges[0], (checked, false));
    assert!(near(edges[1].0, start + byte() * 7));
}

#[test]
fn module_that_sends_receives_nothing() {
    let mut host = normal();
    let channel = host.module().parameters();
    host.send(b"mine");
    host.run_for(ms(20));
    let now = host.now();
    let end = host.air().transmit(now, channel, b"lost").end;
    host.run_until(end + ms(300));
    assert!(host.received().is_empty());
    assert!(bytes_received(&mut host).is_empty(), "both are destroyed");
    // It receives again after its own packet.
    let now = host.now();
    let end = host.air().transmit(now, channel, b"heard").end;
    host.run_until(end + ms(50));
    assert_eq!(bytes(&host.received()), b"heard");
}

#[test]
fn module_begins_to_send_while_it_receives() {
    let mut host = normal();
    let now = host.now();
    host.air().send(now, b"request");
    host.run_for(ms(50));
    assert_eq!(host.air().packets().count(), 1);
    host.send(b"mine");
    host.run_for(ms(500));
    assert_eq!(host.air().packets().count(), 2);
    assert!(host.received().is_empty());
}

#[test]
fn module_without_power_sends_and_receives_nothing_and_cuts_its_packet() {
    let mut host = normal();
    host.send(b"cut");
    host.run_for(ms(30));
    host.radio.module.set_power(false);
    let cut = host.now();
    host.run_for(ms(10));
    let packet = host.air().packets().next().cloned().expect("a packet");
    assert_eq!(packet.end, cut);
    host.send(b"nothing");
    let now = host.now();
    host.air().send(now, b"request");
    host.run_for(ms(600));
    assert!(host.received().is_empty());
    assert!(bytes_received(&mut host).is_empty());
    assert_eq!(host.air().packets().count(), 2);
}

#[test]
fn packet_that_begins_after_a_power_cycle_is_received() {
    let mut host = normal();
    let later = host.now() + timing::START_UP + ms(20);
    let end = host
        .air()
        .transmit(later, Parameters::FACTORY, b"later")
        .end;
    host.radio.module.set_power(false);
    host.run_for(ms(10));
    host.radio.module.set_power(true);
    host.run_until(end + ms(100));
    assert_eq!(bytes(&host.received()), b"later");
}

#[test]
fn module_in_power_saving_mode_receives_only_packets_with_a_preamble() {
    let mut host = normal();
    host.set_pins(false, true);
    host.run_for(ms(10));
    assert_eq!(host.module().mode(), Some(Mode::PowerSaving));
    host.send(b"closed");
    let now = host.now();
    let end = host.air().send(now, b"short");
    host.run_until(end + ms(300));
    assert!(host.received().is_empty());
    assert_eq!(host.air().packets().count(), 1);
    let factory = Parameters::FACTORY;
    for (number, wake_up, expected) in [(1, ms(240), &b""[..]), (2, ms(250), b"long")] {
        let bytes_sent = b"long".to_vec();
        let sender = Sender::Board(7);
        let packet = Packet::new(
            Corner::Nominal,
            sender,
            number,
            host.now(),
            factory,
            wake_up,
            bytes_sent,
        );
        host.radio.module.add(&packet, 0.0);
        host.run_until(packet.end + ms(100));
        assert_eq!(bytes(&host.received()), expected);
    }
}

#[test]
fn packet_in_wake_up_mode_has_a_preamble() {
    let mut other = normal();
    other.set_pins(true, false);
    other.run_for(ms(10));
    assert_eq!(other.module().mode(), Some(Mode::WakeUp));
    other.send(b"x");
    other.run_for(ms(500));
    let packet = other.air().packets().next().cloned().expect("a packet");
    assert_eq!(packet.wake_up, ms(250));
    assert_eq!(
        packet.end - packet.start,
        ms(250) + timing::packet(1, 2400, Corner::Nominal)
    );
    assert_eq!(bytes_received(&mut other), b"x");
}

#[test]
fn pin_that_is_held_low_is_a_break_and_not_the_end_of_the_module() {
    let mut host = normal();
    let now = host.now();
    host.radio.set_tx_pin(TxPin::Level(false), now);
    host.run_for(ms(20));
    let now = host.now();
    host.radio.set_tx_pin(TxPin::Usart, now);
    host.run_for(ms(20));
    host.send(b"after");
    host.run_for(ms(300));
    let sent: Vec<u8> = host.air().packets().flat_map(|p| p.bytes.clone()).collect();
    assert_eq!(sent, b"\0after");
}
