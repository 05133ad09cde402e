//! Drivers at the wrong time, two talkers at once, damaged characters and noise.

use super::*;

#[test]
fn what_is_sent_with_the_driver_off_is_lost() {
    let mut bench = Bench::new();
    bench.write(DR, 0x55);
    bench.run_to(Time::from_ms(5));
    assert_eq!(bench.line.received().count(), 0);
    assert_eq!(bench.line.frames().count(), 0);
    let findings = bench.line.take_findings();
    assert_eq!(findings.len(), 1);
    assert_eq!(findings[0].0, TICK);
}

#[test]
fn a_driver_switched_off_early_truncates() {
    let mut bench = Bench::new();
    bench.driver(true);
    bench.write(DR, 0x00);
    // After the start bit and three data bits and a half; the rest is the idle bus: ones.
    let cut = bench.now + Time::cycles(625 * 9 / 2, HZ);
    bench.run_to(cut);
    bench.driver(false);
    bench.run_to(Time::from_ms(9));
    let heard: Vec<_> = bench.line.received().map(|r| r.byte).collect();
    assert_eq!(heard, [0xF8]);
    assert_eq!(bench.line.take_findings().len(), 1);

    // Within the second stop bit nothing is lost, and it is too early all the same.
    bench.driver(true);
    bench.write(DR, 0x00);
    bench.run_to(bench.now + Time::cycles(625 * 21 / 2, HZ));
    bench.driver(false);
    assert_eq!(bench.line.take_findings().len(), 1);
}

#[test]
fn the_driver_on_an_idle_transmitter_makes_no_edge() {
    let mut bench = Bench::new();
    for n in 0..10 {
        bench.driver(n % 2 == 0);
        bench.run_to(bench.now + Time::from_us(3));
    }
    bench.run_to(Time::from_ms(20));
    assert!(
        bench
            .line
            .falling_edges(Time::ZERO, bench.now)
            .next()
            .is_none()
    );
    assert_eq!(bench.line.received().count(), 0);
    // A low TX pin is another matter: a break.
    bench.line.set_tx_pin(TxPin::Level(false), bench.now);
    bench.driver(true);
    assert!(!bench.line.level_at(bench.now));
    bench.run_to(Time::from_ms(30));
    assert!(bench.line.received().all(|r| r.framing_error));
    assert_eq!(bench.line.received().count(), 1);
}

#[test]
fn both_at_once_collide_and_the_master_receives_the_mixture() {
    let mut bench = Bench::new();
    bench.line.send(bench.now, &[0xF0]);
    bench.driver(true);
    bench.write(DR, 0x3C);
    bench.run_to(Time::from_ms(5));
    let heard: Vec<_> = bench.line.received().copied().collect();
    assert_eq!(heard.len(), 1);
    assert_eq!(heard[0].byte, 0xF0 & 0x3C);
    assert!(heard[0].collided && !heard[0].is_good());
    assert!(bench.line.frames().next().expect("recorded").damaged);
    let spans: Vec<_> = bench.line.collisions().collect();
    assert_eq!(spans.len(), 1);
    assert_eq!(spans[0].start, TICK);
    assert_eq!(spans[0].end, TICK + Time::cycles(11, 115_200));
    // The unit was deaf: its receiver is off while it drives.
    assert_eq!(bench.read(SR) & RXNE, 0);
}

#[test]
fn a_driver_switched_off_during_the_masters_byte_receives_the_rest_of_it() {
    let mut bench = Bench::new();
    bench.driver(true);
    let t = Time::from_ms(2);
    // Start and eight low bits: nine bits low.
    bench.line.send(t, &[0x00]);
    bench.run_to(t + Time::cycles(625 * 3, HZ));
    assert!(bench.line.rx_level());
    bench.driver(false);
    assert!(!bench.line.rx_level());
    assert_eq!(bench.usart.next_exchange(&bench.line), Some(bench.now));
    // Six bits low from there: start and five zeros, then ones.
    assert_eq!(bench.hear(Time::from_ms(3)), [0xE0]);
}

#[test]
fn damage_and_gaps_arrive_as_made() {
    let mut bench = Bench::new();
    let settings = bench.line.settings();
    let good = Character::new(settings, 0x31);
    let mut at = Time::from_ms(2);
    for c in [
        good.with_bit_flipped(2),
        good.with_bad_stop(settings),
        Character::line_break(settings.rate(), 12),
    ] {
        bench.line.send_character(at, c);
        at += Time::from_ms(2);
        let before = bench.hear(at);
        assert_eq!(before.len(), 1);
    }
    // The flags went with the reading of DR; the record has them.
    let frames: Vec<_> = bench
        .line
        .frames()
        .map(|f| (f.bytes.clone(), f.damaged))
        .collect();
    assert_eq!(
        frames,
        [(vec![0x33], false), (vec![0x31], true), (vec![0], true)]
    );
    // Queued behind one another unless a gap is asked for.
    let end = bench.line.send(at, &[1]);
    assert_eq!(bench.line.send(at, &[2]), end + settings.characters(1));
    let gap = Time::from_us(800);
    let next = bench.line.master_free() + gap;
    bench.line.send(next, &[3]);
    assert_eq!(bench.hear(at + Time::from_ms(5)), [1, 2, 3]);
    let last = bench.line.frames().next_back().expect("recorded");
    assert_eq!(last.bytes, [1, 2, 3]);
    assert!(last.longest_gap.as_ps().abs_diff(gap.as_ps()) < 100);
}

#[test]
fn a_glitch_is_no_byte_but_noise_in_a_byte_is() {
    let mut bench = Bench::new();
    let bit = bench.line.settings().rate().bits(1);
    bench.line.noise(Time::from_ms(2), Time::from_us(2));
    assert_eq!(bench.hear(Time::from_ms(3)), []);
    let at = Time::from_ms(4);
    bench.line.send(at, &[0x0F]);
    // Data bit 6 turned over as a whole.
    bench.line.noise(at + bit * 7, bit);
    assert_eq!(bench.hear(Time::from_ms(6)), [0x4F]);
}
