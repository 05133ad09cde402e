//! Tests of several units on a line: the other ends receive a character of one unit, in time and late.

use super::*;

/// Returns the time and value of the byte that another unit receives, and the same for the master. The other unit gets
/// the edges `late` after the start bit.
fn received(byte: u8, late: Time) -> [Vec<(Time, u8)>; 2] {
    let (mut sender, mut listener) = (Rig::new(), Rig::new());
    let mut bus = Line::of_bus(TICK);
    bus.set_settings(sender.line.settings());
    sender.line.become_end();
    listener.line.become_end();
    sender.driver(true);
    sender.write(DR, u32::from(byte));
    let begin = sender.now;
    sender.run_to(begin);
    let output = sender.line.take_output().expect("a character");
    listener.run_to(begin + late);
    listener.line.add_output(0, &output, Time::ZERO);
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
    bus.add_output(0, &output, Time::ZERO);
    bus.pass(end, None);
    let master = bus.take_received();
    assert!(master.iter().all(Received::is_good));
    let master = master
        .iter()
        .map(|received| (received.start, received.byte));
    [bytes, master.collect()]
}

#[test]
fn character_that_is_half_a_bit_late_is_received_at_its_true_time() {
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
fn character_arrives_later_at_the_end_of_a_long_cable() {
    let (mut sender, mut listener) = (Rig::new(), Rig::new());
    for end in [&mut sender.line, &mut listener.line] {
        end.become_end();
    }
    sender.driver(true);
    sender.write(DR, 0x55);
    let begin = sender.now;
    sender.run_to(begin);
    let output = sender.line.take_output().expect("a character");
    let delay = Time::from_us(6);
    listener.line.add_output(0, &output, delay);
    // Its start bit.
    assert_eq!(listener.line.next_edge(), Some(TICK + delay));
    assert_eq!(listener.receive(Time::from_ms(2)), [0x55]);
}

#[test]
fn character_cut_by_the_driver_is_also_cut_at_the_other_end() {
    let (mut sender, mut listener) = (Rig::new(), Rig::new());
    sender.line.become_end();
    listener.line.become_end();
    sender.driver(true);
    sender.write(DR, 0x00);
    sender.run_to(TICK);
    let output = sender.line.take_output().expect("a character");
    listener.line.add_output(0, &output, Time::ZERO);
    assert!(sender.line.take_output().is_none());
    // After the start bit and three and a half data bits.
    let cut = TICK + Time::cycles(625 * 9 / 2, HZ);
    sender.run_to(cut);
    sender.driver(false);
    // The listener is already past this instant, by an instruction.
    listener.run_to(cut + Time::from_ns(100));
    let output = sender.line.take_output().expect("the driver's switching");
    listener.line.add_output(0, &output, Time::ZERO);
    assert_eq!(listener.receive(Time::from_ms(2)), [0xF8]);
}

#[test]
fn two_units_at_the_same_time_collide_and_the_master_receives_the_wired_and() {
    let mut bus = Line::of_bus(TICK);
    let (mut one, mut other) = (Rig::new(), Rig::new());
    bus.set_settings(one.line.settings());
    for (n, (rig, byte)) in [(&mut one, 0x3C), (&mut other, 0xF1)]
        .into_iter()
        .enumerate()
    {
        rig.line.become_end();
        rig.driver(true);
        rig.write(DR, byte);
        rig.run_to(TICK + Time::cycles(11 * 625, HZ));
        rig.driver(false);
        let output = rig.line.take_output().expect("a character");
        bus.add_output(n, &output, Time::ZERO);
    }
    bus.pass(Time::from_ms(3), None);
    let received = bus.take_received();
    assert_eq!(received.len(), 1);
    assert_eq!(received[0].byte, 0x3C & 0xF1);
    assert!(received[0].collided && !received[0].is_good());
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
