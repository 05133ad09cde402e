//! The air: which packets reach which receiver, collisions, losses, and the gateway.

use super::host::{Host, bytes, ms};
use crate::radio::{Air, Packet, Parameters, timing};
use f103::corner::Corner;
use f103::periph::usart::Wire;
use f103::time::Time;

fn normal() -> Host {
    Host::in_normal_mode(Parameters::FACTORY)
}

/// Transmits packets with these starts and parameters, and returns the bytes that the module has received.
fn received(host: &mut Host, packets: &[(Time, Parameters, &[u8])]) -> Vec<u8> {
    let begin = host.now();
    let mut end = begin;
    for &(at, parameters, bytes) in packets {
        end = end.max(host.air().transmit(begin + at, parameters, bytes).end);
    }
    host.run_until(end + ms(100));
    bytes(&host.received())
}

#[test]
fn packets_of_other_channels_rates_and_addresses_are_not_received() {
    let mut host = normal();
    let factory = Parameters::FACTORY;
    for other in [
        factory.with_channel(22),
        factory.with_air_rate_code(3),
        factory.with_address(5),
        Parameters::from_bytes([0, 0, 0x1A, 0x17, 0x40]),
    ] {
        let got = received(&mut host, &[(ms(0), other, b"foreign")]);
        assert!(got.is_empty(), "{other:?}");
    }
    let every = factory.with_address(Parameters::EVERY_ADDRESS);
    assert_eq!(received(&mut host, &[(ms(0), every, b"all")]), b"all");
    assert_eq!(host.module().packets_received(), 1);
}

#[test]
fn packets_that_overlap_on_a_channel_destroy_each_other_for_every_receiver() {
    let mut host = normal();
    let factory = Parameters::FACTORY;
    let length = timing::packet(1, 2400, Corner::Nominal);
    // Another address or rate does not matter, only the channel.
    for other in [factory.with_address(9), factory.with_air_rate_code(4)] {
        let late = length - Time::from_us(1);
        let both = [(ms(0), factory, &b"a"[..]), (late, other, b"b")];
        assert!(received(&mut host, &both).is_empty());
        assert!(host.air().take_received().is_empty());
    }
    let other_channel = [
        (ms(0), factory, &b"a"[..]),
        (ms(1), factory.with_channel(1), b"b"),
    ];
    assert_eq!(received(&mut host, &other_channel), b"a");
    let after = [(ms(0), factory, &b"a"[..]), (length, factory, b"b")];
    assert_eq!(received(&mut host, &after), b"ab");
    // Three packets: the middle one destroys both others, which do not overlap each other.
    let half = Time::from_ps(length.as_ps() / 2);
    let three = [
        (ms(0), factory, &b"a"[..]),
        (half, factory, b"b"),
        (length, factory, b"c"),
    ];
    assert!(received(&mut host, &three).is_empty());
}

#[test]
fn lost_packets_are_the_same_in_every_run_and_at_the_rate() {
    let lost = |loss: f64| -> Vec<u8> {
        let fast = Parameters::FACTORY.with_air_rate_code(5);
        let mut host = Host::in_normal_mode(fast);
        host.air().set_loss(loss);
        let packets: Vec<Vec<u8>> = (0..200).map(|n| vec![n]).collect();
        let packets: Vec<_> = (0..).map(|n| ms(20 * n)).zip(&packets).collect();
        let packets: Vec<_> = packets
            .iter()
            .map(|(at, bytes)| (*at, fast, &bytes[..]))
            .collect();
        received(&mut host, &packets)
    };
    assert_eq!(lost(0.0).len(), 200);
    assert!(lost(1.0).is_empty());
    let some = lost(0.25);
    assert!((135..=165).contains(&some.len()), "{} of 150", some.len());
    assert_eq!(some, lost(0.25));
}

#[test]
fn receivers_lose_packets_independently() {
    let mut host = normal();
    host.air().set_loss(0.5);
    let sent: Vec<Vec<u8>> = (0..40).map(|n| vec![n]).collect();
    let mut mine = Vec::new();
    for bytes in &sent {
        mine.extend(received(&mut host, &[(ms(0), Parameters::FACTORY, bytes)]));
    }
    let gateway: Vec<u8> = host.air().take_received().iter().map(|b| b.byte).collect();
    assert_ne!(mine, gateway);
    assert!(mine.iter().any(|byte| gateway.contains(byte)));
}

#[test]
fn gateway_follows_the_parameters_of_the_module_in_normal_mode() {
    let mut host = Host::in_sleep();
    assert_eq!(host.air().gateway().parameters(), Parameters::FACTORY);
    let set = [0xC0, 0x00, 0x05, 0b10_100_011, 0x0A, 0x47];
    host.command(&set);
    host.run_for(ms(100));
    assert_eq!(host.air().gateway().parameters(), Parameters::FACTORY);
    host.set_pins(false, false);
    host.run_for(ms(110));
    let gateway = host.air().gateway().parameters();
    // All but the UART, which stays at 9600 8N1.
    assert_eq!(gateway.bytes(), [0x00, 0x05, 0b00_011_011, 0x0A, 0x47]);
    host.settings = host.module().parameters().uart();
    let now = host.now();
    host.air().send(now, b"there");
    host.run_for(ms(200));
    assert_eq!(bytes(&host.received()), b"there");
}

#[test]
fn gateway_that_does_not_follow_keeps_its_parameters() {
    let mut host = Host::off(Parameters::FACTORY.with_channel(3));
    host.air().set_follow(false);
    host.set_pins(false, false);
    host.radio.module.set_power(true);
    host.run_for(timing::START_UP + ms(10));
    assert_eq!(host.air().gateway().parameters(), Parameters::FACTORY);
    let now = host.now();
    host.air().send(now, b"unheard");
    host.run_for(ms(300));
    assert!(host.received().is_empty());
    let there = host.module().parameters();
    host.air().set_parameters(there);
    let now = host.now();
    host.air().send(now, b"here");
    host.run_for(ms(300));
    assert_eq!(bytes(&host.received()), b"here");
}

#[test]
fn gateway_takes_over_parameters_only_when_it_is_idle() {
    let mut host = normal();
    let now = host.now();
    host.air().send(now, &[0x55; 20]);
    host.run_for(ms(10));
    let other = Parameters::FACTORY.with_channel(3);
    host.air().set_parameters(other);
    host.run_for(ms(50));
    assert_eq!(host.air().gateway().parameters(), Parameters::FACTORY);
    host.run_for(ms(300));
    assert_eq!(bytes(&host.received()), [0x55; 20]);
    assert_eq!(host.air().gateway().parameters(), other);
}

#[test]
fn two_runs_with_different_steps_are_the_same() {
    let run = |step: u64| -> (Vec<Packet>, Vec<(u8, Time, Time)>) {
        let mut host = normal();
        host.air().set_loss(0.2);
        let begin = host.now();
        let first: Vec<u8> = (0..100).collect();
        host.air().send(begin, &first);
        host.send(b"at the same time");
        let end = begin + Time::from_secs(3);
        while host.now() < end {
            host.run_until(end.min(host.now() + Time::from_us(step)));
        }
        let packets = host.air().packets().cloned().collect();
        (packets, host.received())
    };
    let (packets, received) = run(100);
    assert_eq!(packets.len(), 3);
    assert!(!received.is_empty());
    for step in [7_919, 100_000, 3_000_000] {
        assert_eq!(run(step), (packets.clone(), received.clone()), "{step}");
    }
}

#[test]
fn idle_air_has_no_events() {
    let mut host = normal();
    host.run_for(ms(10));
    assert_eq!(host.radio.next_event(), None);
    let air: &mut Air = host.air();
    assert_eq!(air.next_event(), None);
}
