//! Several units on a line: a character of one unit reaches the other ends, in time and late.

use super::*;

/// Time and value of the byte that a unit receives from another unit, when the edges arrive `late` after the start bit.
fn received(byte: u8, late: Time) -> [Vec<(Time, u8)>; 2] {
    let (mut talker, mut listener) = (Bench::new(), Bench::new());
    let mut bus = Line::of_bus(TICK);
    bus.set_settings(talker.line.settings());
    talker.line.become_end();
    listener.line.become_end();
    talker.driver(true);
    talker.write(DR, u32::from(byte));
    let begin = talker.now;
    talker.run_to(begin);
    let said = talker.line.take_said().expect("a character");
    listener.run_to(begin + late);
    listener.line.hear(0, &said);
    let end = Time::from_ms(2);
    let mut bytes = Vec::new();
    while let Some(at) = listener.usart.next_exchange(&listener.line) {
        if at > end {
            break;
        }
        listener.run_to(at);
        if listener.read(SR) & RXNE != 0 {
            bytes.push((at, listener.read(DR) as u8));
        }
    }
    bus.hear(0, &said);
    bus.pass(end, None);
    let master = bus.take_received();
    assert!(master.iter().all(Received::is_good));
    let master = master.iter().map(|heard| (heard.start, heard.byte));
    [bytes, master.collect()]
}

#[test]
fn character_known_half_a_bit_late_is_received_at_its_own_time() {
    let sixteenth = Rate::from_clock(625, HZ).sixteenths(1);
    for byte in [0x00, 0x55, 0xA5, 0xFF] {
        let [in_time, master] = received(byte, Time::ZERO);
        assert_eq!(in_time.len(), 1);
        assert_eq!(in_time[0].1, byte);
        assert_eq!(master, [(TICK, byte)]);
        for n in 1..=9 {
            assert_eq!(received(byte, sixteenth * n)[0], in_time, "{n}/16 bit late");
        }
    }
}

#[test]
fn a_talker_that_lets_go_takes_back_what_it_has_announced() {
    let (mut talker, mut listener) = (Bench::new(), Bench::new());
    talker.line.become_end();
    listener.line.become_end();
    talker.driver(true);
    talker.write(DR, 0x00);
    talker.run_to(TICK);
    let said = talker.line.take_said().expect("a character");
    listener.line.hear(0, &said);
    assert!(talker.line.take_said().is_none());
    // After the start bit and three data bits and a half.
    let cut = TICK + Time::cycles(625 * 9 / 2, HZ);
    talker.run_to(cut);
    talker.driver(false);
    // The listener is already past it, by an instruction.
    listener.run_to(cut + Time::from_ns(100));
    let said = talker.line.take_said().expect("the driver's switching");
    listener.line.hear(0, &said);
    assert_eq!(listener.hear(Time::from_ms(2)), [0xF8]);
}

#[test]
fn two_drivers_at_the_same_time_collide_and_both_are_received() {
    let mut bus = Line::of_bus(TICK);
    let (mut one, mut other) = (Bench::new(), Bench::new());
    bus.set_settings(one.line.settings());
    for (n, (bench, byte)) in [(&mut one, 0x3C), (&mut other, 0xF1)]
        .into_iter()
        .enumerate()
    {
        bench.line.become_end();
        bench.driver(true);
        bench.write(DR, byte);
        bench.run_to(TICK + Time::cycles(11 * 625, HZ));
        bench.driver(false);
        bus.hear(n, &bench.line.take_said().expect("a character"));
    }
    bus.pass(Time::from_ms(3), None);
    let heard = bus.take_received();
    assert_eq!(heard.len(), 1);
    assert_eq!(heard[0].byte, 0x3C & 0xF1);
    assert!(heard[0].collided && !heard[0].is_good());
    let span = Span {
        start: TICK,
        end: TICK + Time::cycles(11 * 625, HZ),
    };
    assert_eq!(bus.collisions().collect::<Vec<_>>(), [span]);
    assert_eq!(
        bus.driver_edges().collect::<Vec<_>>(),
        [(span.start, true), (span.end, false)]
    );
}
