//! Tests of drivers that are on at the wrong time, collisions, damaged characters and noise.

use super::*;

#[test]
fn character_sent_with_the_driver_off_is_lost_and_reported() {
    let mut rig = Rig::new();
    rig.write(DR, 0x55);
    rig.run_to(Time::from_ms(5));
    assert_eq!(rig.line.received().count(), 0);
    assert_eq!(rig.line.frames().count(), 0);
    let findings = rig.line.take_findings();
    assert_eq!(findings.len(), 1);
    assert_eq!(findings[0].0, TICK);
    assert!(findings[0].1.ends_with("it is lost"));
}

#[test]
fn character_that_begins_before_the_driver_is_on_is_reported_as_what_became_of_it() {
    // When the driver is switched on, in sixteenths of a bit; the byte that the master receives; the finding.
    for (sixteenths, byte, what) in [
        (0, Some(0x55), None),
        (
            1,
            Some(0x55),
            Some("began to send before the RS-485 driver was on"),
        ),
        (
            7,
            Some(0x55),
            Some("began to send before the RS-485 driver was on"),
        ),
        // Data bit 0 is high: the receiver takes bit 1 for the start bit.
        (9, Some(0xD5), Some("in the middle of a character")),
        (16 * 11 - 1, None, Some("in the middle of a character")),
        (16 * 11, None, Some("it is lost")),
    ] {
        let mut rig = Rig::new();
        rig.write(DR, 0x55);
        rig.run_to(TICK + Time::cycles(625 * sixteenths / 16, HZ));
        rig.driver(true);
        rig.run_to(Time::from_ms(5));
        let received = rig.line.received().map(|received| received.byte).next();
        assert_eq!(received, byte, "{sixteenths}");
        let findings = rig.line.take_findings();
        assert_eq!(findings.len(), usize::from(what.is_some()), "{findings:?}");
        if let Some(what) = what {
            assert!(findings[0].1.contains(what), "{findings:?}");
        }
    }
}

#[test]
fn character_is_reported_as_begun_before_its_pin_only_if_it_was() {
    for (sixteenths, what) in [
        (0, None),
        (1, Some("began to send before its TX pin")),
        (16 * 5, Some("in the middle of a character")),
        (16 * 11, Some("while its TX pin was not")),
    ] {
        let mut rig = Rig::new();
        rig.driver(true);
        rig.line.set_tx_pin(TxPin::Level(true), rig.now);
        rig.write(DR, 0x55);
        rig.run_to(TICK + Time::cycles(625 * sixteenths / 16, HZ));
        rig.line.set_tx_pin(TxPin::Usart, rig.now);
        rig.run_to(Time::from_ms(5));
        let findings = rig.line.take_findings();
        let texts: Vec<_> = findings.iter().map(|(_, text)| *text).collect();
        match what {
            None => assert_eq!(texts, [""; 0]),
            Some(what) => assert!(texts.len() == 1 && texts[0].contains(what), "{texts:?}"),
        }
    }
}

#[test]
fn driver_switched_off_early_cuts_the_character_and_is_reported() {
    let mut rig = Rig::new();
    rig.driver(true);
    rig.write(DR, 0x00);
    // Cut after the start bit and three and a half data bits. The rest is read from the idle bus as ones.
    let cut = rig.now + Time::cycles(625 * 9 / 2, HZ);
    rig.run_to(cut);
    rig.driver(false);
    rig.run_to(Time::from_ms(9));
    let received: Vec<_> = rig.line.received().map(|r| r.byte).collect();
    assert_eq!(received, [0xF8]);
    assert_eq!(rig.line.take_findings().len(), 1);

    // In the second stop bit nothing is lost, but switching off is still reported as too early.
    rig.driver(true);
    rig.write(DR, 0x00);
    rig.run_to(rig.now + Time::cycles(625 * 21 / 2, HZ));
    rig.driver(false);
    assert_eq!(rig.line.take_findings().len(), 1);
}

#[test]
fn switching_the_driver_makes_no_edge_while_the_tx_pin_is_high() {
    let mut rig = Rig::new();
    for n in 0..10 {
        rig.driver(n % 2 == 0);
        rig.run_to(rig.now + Time::from_us(3));
    }
    rig.run_to(Time::from_ms(20));
    assert!(rig.line.falling_edges(Time::ZERO, rig.now).next().is_none());
    assert_eq!(rig.line.received().count(), 0);
    // With a low TX pin the driver sends a break.
    rig.line.set_tx_pin(TxPin::Level(false), rig.now);
    rig.driver(true);
    assert!(!rig.line.level_at(rig.now));
    rig.run_to(Time::from_ms(30));
    assert!(rig.line.received().all(|r| r.framing_error));
    assert_eq!(rig.line.received().count(), 1);
}

#[test]
fn master_and_unit_at_the_same_time_collide_and_the_master_receives_the_wired_and() {
    let mut rig = Rig::new();
    rig.line.send(rig.now, &[0xF0]);
    rig.driver(true);
    rig.write(DR, 0x3C);
    rig.run_to(Time::from_ms(5));
    let received: Vec<_> = rig.line.received().copied().collect();
    assert_eq!(received.len(), 1);
    assert_eq!(received[0].byte, 0xF0 & 0x3C);
    assert!(received[0].collided && !received[0].is_good());
    assert!(rig.line.frames().next().expect("recorded").damaged);
    let spans: Vec<_> = rig.line.collisions().collect();
    assert_eq!(spans.len(), 1);
    assert_eq!(spans[0].start, TICK);
    assert_eq!(spans[0].end, TICK + Time::cycles(11, 115_200));
    // The unit has received nothing, because its receiver is off while its driver is on.
    assert_eq!(rig.read(SR) & RXNE, 0);
}

#[test]
fn unit_receives_the_rest_of_a_byte_after_its_driver_is_switched_off() {
    let mut rig = Rig::new();
    rig.driver(true);
    let t = Time::from_ms(2);
    // The start bit and eight data bits: nine low bits.
    rig.line.send(t, &[0x00]);
    rig.run_to(t + Time::cycles(625 * 3, HZ));
    assert!(rig.line.rx_level());
    rig.driver(false);
    assert!(!rig.line.rx_level());
    assert_eq!(rig.usart.next_exchange(&rig.line), Some(rig.now));
    // Six low bits are left: the unit receives a start bit and five zeros, then ones.
    assert_eq!(rig.receive(Time::from_ms(3)), [0xE0]);
}

#[test]
fn damaged_characters_and_gaps_are_received_as_sent() {
    let mut rig = Rig::new();
    let settings = rig.line.settings();
    let good = Character::new(settings, 0x31);
    let mut at = Time::from_ms(2);
    for c in [
        good.with_bit_flipped(2),
        good.with_bad_stop(settings),
        Character::line_break(settings.rate(), 12),
    ] {
        rig.line.send_character(at, c);
        at += Time::from_ms(2);
        let before = rig.receive(at);
        assert_eq!(before.len(), 1);
    }
    // Reading DR has cleared the flags of the USART. The record has them.
    let frames: Vec<_> = rig
        .line
        .frames()
        .map(|f| (f.bytes.clone(), f.damaged))
        .collect();
    assert_eq!(
        frames,
        [(vec![0x33], false), (vec![0x31], true), (vec![0], true)]
    );
    // Bytes follow each other directly unless a gap is asked for.
    let end = rig.line.send(at, &[1]);
    assert_eq!(rig.line.send(at, &[2]), end + settings.characters(1));
    let gap = Time::from_us(800);
    let next = rig.line.master_free() + gap;
    rig.line.send(next, &[3]);
    assert_eq!(rig.receive(at + Time::from_ms(5)), [1, 2, 3]);
    let last = rig.line.frames().next_back().expect("recorded");
    assert_eq!(last.bytes, [1, 2, 3]);
    assert!(last.longest_gap.as_ps().abs_diff(gap.as_ps()) < 100);
}

#[test]
fn glitch_on_the_idle_line_is_ignored_and_noise_in_a_byte_inverts_its_bit() {
    let mut rig = Rig::new();
    let bit = rig.line.settings().rate().bits(1);
    rig.line.noise(Time::from_ms(2), Time::from_us(2));
    assert_eq!(rig.receive(Time::from_ms(3)), []);
    let at = Time::from_ms(4);
    rig.line.send(at, &[0x0F]);
    // Invert the whole of data bit 6.
    rig.line.noise(at + bit * 7, bit);
    assert_eq!(rig.receive(Time::from_ms(6)), [0x4F]);
}
