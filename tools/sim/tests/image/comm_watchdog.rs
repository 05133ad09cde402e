//! The communication watchdog: its accuracy, the safe value of each point, and listen-only mode. Which frames restart it is
//! tested on the host, and by the conformance suite.

use register_map::configuration::{COMM_TIMEOUT, FRAME_GAP, HOLD, MODE, SAFE};
use sim::{Channel, Module, Time};

use crate::{
    analog_outputs::codes,
    rig::{FIRST, Rig, SLOT, ascii},
};

fn outputs(rig: &Rig) -> [bool; 4] {
    [1, 2, 3, 4].map(|n| match rig.board.channel(n) {
        Channel::Do { on } => on,
        other => panic!("channel {n} is {other:?}"),
    })
}

/// Asserts that `at` is the time-out after `from`, within 2 ms and the crystal's 100 ppm.
fn assert_on_time(from: Time, tenths: u16, at: Time) {
    let due = from + Time::from_ms(100 * u64::from(tenths));
    let off = at.max(due) - at.min(due);
    let side = if at > due { "late" } else { "early" };
    let crystal = Time::from_us(10 * u64::from(tenths));
    assert!(
        off <= Time::from_ms(2) + crystal,
        "{tenths}00 ms: {off:?} {side}"
    );
}

/// Sets a time-out in units of 100 ms and switches all outputs on.
fn armed(rig: &mut Rig, tenths: u16) {
    rig.configure(COMM_TIMEOUT, &[tenths]);
    rig.write_bits(SLOT, &[true; 4]).unwrap();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn digital_outputs_go_to_safe_two_milliseconds_around_the_time_out_at_any_rate() {
    for (baud, format) in [(96, 0), (1152, 1), (12, 0)] {
        let mut rig = Rig::set_up(Module::Do4, &[(0x0101, baud), (0x0102, format)]);
        // At 1200 bit/s a request and its reply take longer than the shortest time-out.
        let more = if baud == 12 { 2 } else { 0 };
        for (n, tenths) in (0..).zip([1, 2, 3, 7, 10, 1, 5, 1, 20, 1]) {
            let tenths = tenths + more;
            armed(&mut rig, tenths);
            // At any phase between two scans.
            rig.board.run_for(Time::from_us(n * 137));
            rig.board.watch_pin('A', 3);
            assert_eq!(rig.bits(1, SLOT, 4), Ok(vec![true; 4]));
            let last = rig.sent;
            rig.board
                .run_for(Time::from_ms(100 * u64::from(tenths) + 50));
            let edges = rig.board.pin_edges('A', 3);
            let &[.., (at, false)] = edges else {
                panic!("the output did not go off: {edges:?}");
            };
            assert!(at > last);
            assert_on_time(last, tenths, at);
            assert_eq!(outputs(&rig), [false; 4]);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_outputs_go_to_safe_two_milliseconds_around_the_time_out() {
    let safe = [4095, 0, HOLD, 1234];
    let stored: Vec<_> = (0..).zip(safe).map(|(n, v)| (SAFE + SLOT + n, v)).collect();
    let mut rig = Rig::set_up(Module::Ao4, &stored);
    for (n, tenths) in (0..).zip([1, 2, 1, 3, 1, 10, 1, 1, 2, 1]) {
        rig.configure(COMM_TIMEOUT, &[tenths]);
        rig.board.run_for(Time::from_us(n * 1_370));
        rig.write(SLOT, &[1, 2, 3, 4]).unwrap();
        let last = rig.sent;
        rig.board.run_for(Time::from_ms(30));
        assert_eq!(codes(&rig, [1, 2, 3, 4]), [1, 2, 3, 4]);
        rig.board
            .run_until(last + Time::from_ms(100 * u64::from(tenths) - 10));
        // Each of the four channels on its own: the DAC receives them one after another.
        let (mut first, mut all) = (None, None);
        while all.is_none() && rig.board.now() < last + Time::from_ms(100 * u64::from(tenths) + 50)
        {
            rig.board.run_for(Time::from_us(50));
            let now = codes(&rig, [1, 2, 3, 4]);
            if now != [1, 2, 3, 4] && first.is_none() {
                first = Some(rig.board.now());
            }
            if now == [4095, 0, 3, 1234] {
                all = Some(rig.board.now());
            }
        }
        assert_on_time(last, tenths, first.expect("the watchdog did not trip"));
        assert_on_time(last, tenths, all.expect("not all outputs went to SAFE"));
        assert_eq!(
            rig.registers(SLOT, 4),
            Ok(vec![4095, 0, 3, 1234]),
            "reads return the SAFE values"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn watchdog_counts_from_the_end_of_an_ascii_request() {
    let settings = [(MODE, 1), (FRAME_GAP, 500), (COMM_TIMEOUT, 2)];
    let mut rig = Rig::set_up(Module::Do4, &settings);
    rig.patience = Time::from_ms(60);
    let on = [0x05, 0, FIRST, 0xFF, 0];
    assert_eq!(
        rig.exchange(&ascii(&on, "\r\n")),
        ascii(&on, "\r\n"),
        "after 50 ms"
    );
    for (ms, is_on) in [(197, true), (203, false)] {
        rig.board.run_until(rig.sent + Time::from_ms(ms));
        assert_eq!(rig.board.channel(1), Channel::Do { on: is_on }, "{ms} ms");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_go_to_safe_in_listen_only_mode() {
    let mut rig = Rig::new(Module::Do4, 1);
    rig.unlock();
    rig.write(0x0104, &[2]).unwrap();
    rig.ask(1, &[0x05, 0, FIRST, 0xFF, 0]).expect("a reply");
    assert_eq!(rig.ask(1, &[0x08, 0, 4, 0, 0]), None);
    assert_eq!(rig.board.channel(1), Channel::Do { on: true });
    for _ in 0..10 {
        assert_eq!(rig.ask(1, &[0x05, 0, FIRST + 1, 0xFF, 0]), None);
        rig.board.run_for(Time::from_ms(30));
    }
    assert_eq!(rig.board.channel(1), Channel::Do { on: false });
    assert_eq!(rig.board.channel(2), Channel::Do { on: false });
    assert_eq!(
        rig.ask(1, &[0x08, 0, 1, 0, 0]),
        None,
        "the restart gets no reply"
    );
    // The status is: communication lost, not saved, unlocked.
    assert_eq!(rig.ask(1, &[0x07]), Some(vec![0x07, 0b10_1001]));
    rig.assert_sound();
}
