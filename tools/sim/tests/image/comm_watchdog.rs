//! The communication watchdog: its accuracy, the safe value of each point, the frames that restart it, and its end.

use register_map::configuration::{COMM_TIMEOUT, FRAME_GAP, HOLD, MODE, SAFE};
use sim::{Channel, Module, Time};

use crate::{
    analog_outputs::codes,
    bench::{Bench, FIRST, SLOT, adu, ascii},
};

const TRIPPED: u16 = 1;

fn outputs(bench: &Bench) -> [bool; 4] {
    [1, 2, 3, 4].map(|n| match bench.board.channel(n) {
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
fn armed(bench: &mut Bench, tenths: u16) {
    bench.configure(COMM_TIMEOUT, &[tenths]);
    bench.write_bits(SLOT, &[true; 4]).unwrap();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn digital_outputs_go_to_safe_two_milliseconds_around_the_time_out_at_any_rate() {
    for (baud, format) in [(96, 0), (1152, 1), (12, 0)] {
        let mut bench = Bench::set_up(Module::Do4, &[(0x0101, baud), (0x0102, format)]);
        // At 1200 bit/s a request and its reply take longer than the shortest time-out.
        let more = if baud == 12 { 2 } else { 0 };
        for (n, tenths) in (0..).zip([1, 2, 3, 7, 10, 1, 5, 1, 20, 1]) {
            let tenths = tenths + more;
            armed(&mut bench, tenths);
            // At any phase between two scans.
            bench.board.run_for(Time::from_us(n * 137));
            bench.board.watch_pin('A', 3);
            assert_eq!(bench.bits(1, SLOT, 4), Ok(vec![true; 4]));
            let last = bench.sent;
            bench
                .board
                .run_for(Time::from_ms(100 * u64::from(tenths) + 50));
            let edges = bench.board.pin_edges('A', 3);
            let &[.., (at, false)] = edges else {
                panic!("the output did not go off: {edges:?}");
            };
            assert!(at > last);
            assert_on_time(last, tenths, at);
            assert_eq!(outputs(&bench), [false; 4]);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_outputs_go_to_safe_two_milliseconds_around_the_time_out() {
    let safe = [4095, 0, HOLD, 1234];
    let stored: Vec<_> = (0..).zip(safe).map(|(n, v)| (SAFE + SLOT + n, v)).collect();
    let mut bench = Bench::set_up(Module::Ao4, &stored);
    for (n, tenths) in (0..).zip([1, 2, 1, 3, 1, 10, 1, 1, 2, 1]) {
        bench.configure(COMM_TIMEOUT, &[tenths]);
        bench.board.run_for(Time::from_us(n * 1_370));
        bench.write(SLOT, &[1, 2, 3, 4]).unwrap();
        let last = bench.sent;
        bench.board.run_for(Time::from_ms(30));
        assert_eq!(codes(&bench, [1, 2, 3, 4]), [1, 2, 3, 4]);
        bench
            .board
            .run_until(last + Time::from_ms(100 * u64::from(tenths) - 10));
        // Each of the four channels on its own: the DAC receives them one after another.
        let (mut first, mut all) = (None, None);
        while all.is_none()
            && bench.board.now() < last + Time::from_ms(100 * u64::from(tenths) + 50)
        {
            bench.board.run_for(Time::from_us(50));
            let now = codes(&bench, [1, 2, 3, 4]);
            if now != [1, 2, 3, 4] && first.is_none() {
                first = Some(bench.board.now());
            }
            if now == [4095, 0, 3, 1234] {
                all = Some(bench.board.now());
            }
        }
        assert_on_time(last, tenths, first.expect("the watchdog did not trip"));
        assert_on_time(last, tenths, all.expect("not all outputs went to SAFE"));
        assert_eq!(
            bench.registers(SLOT, 4),
            Ok(vec![4095, 0, 3, 1234]),
            "reads return the SAFE values"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn only_requests_and_broadcasts_restart_the_watchdog() {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    // A pause of 60 ms, and 15 to 25 ms for the frame and its reply, always stay below 100 ms.
    let hold = |bench: &mut Bench, what: &str, frame: &[u8]| {
        armed(bench, 1);
        for _ in 0..10 {
            bench.board.run_for(Time::from_ms(60));
            bench.exchange(frame);
        }
        assert_eq!(
            outputs(bench)[1..],
            [true; 3],
            "{what} restarts the watchdog"
        );
        assert!(!bench.status(TRIPPED), "{what} restarts the watchdog");
    };
    hold(&mut bench, "a request", &adu(&[1, 1, 0, FIRST, 0, 4]));
    hold(&mut bench, "a broadcast", &adu(&[0, 5, 0, FIRST, 0, 0]));

    let mut spoilt = adu(&[1, 1, 0, FIRST, 0, 4]);
    spoilt[6] ^= 1;
    let mut spoilt_broadcast = adu(&[0, 5, 0, FIRST, 0xFF, 0]);
    spoilt_broadcast[7] ^= 0x80;
    for (what, frame) in [
        ("another unit's request", adu(&[2, 1, 0, FIRST, 0, 4])),
        ("another unit's reply", adu(&[2, 1, 1, 0x0F])),
        ("a bad CRC", spoilt),
        ("a broadcast with a bad CRC", spoilt_broadcast),
        ("noise", vec![0x00]),
        ("half a request", vec![1, 1, 0, FIRST]),
    ] {
        armed(&mut bench, 3);
        let last = bench.sent;
        bench.board.watch_pin('A', 0);
        while bench.board.now() < last + Time::from_ms(350) {
            bench.exchange(&frame);
            bench.board.run_for(Time::from_ms(20));
        }
        let edges = bench.board.pin_edges('A', 0);
        let &[.., (at, false)] = edges else {
            panic!("{what} restarted the watchdog: {edges:?}");
        };
        assert_on_time(last, 3, at);
        assert!(bench.status(TRIPPED), "{what}");
        bench.command(5);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn time_out_of_zero_never_trips_and_a_new_time_out_is_in_force_immediately() {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    armed(&mut bench, 0);
    bench.board.run_for(Time::from_secs(20));
    assert_eq!(outputs(&bench), [true; 4]);
    assert!(!bench.status(TRIPPED));
    // Change a long time-out to a short one before it ends: the write is a request, too.
    armed(&mut bench, 36_000);
    bench.board.run_for(Time::from_secs(10));
    assert_eq!(outputs(&bench), [true; 4]);
    bench.board.watch_pin('A', 0);
    bench.configure(COMM_TIMEOUT, &[2]);
    let last = bench.sent;
    bench.board.run_for(Time::from_ms(250));
    assert_on_time(last, 2, bench.board.pin_edges('A', 0)[0].0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn watchdog_counts_from_the_end_of_an_ascii_request() {
    let settings = [(MODE, 1), (FRAME_GAP, 500), (COMM_TIMEOUT, 2)];
    let mut bench = Bench::set_up(Module::Do4, &settings);
    bench.patience = Time::from_ms(60);
    let on = [0x05, 0, FIRST, 0xFF, 0];
    assert_eq!(
        bench.exchange(&ascii(&on, "\r\n")),
        ascii(&on, "\r\n"),
        "after 50 ms"
    );
    for (ms, is_on) in [(197, true), (203, false)] {
        bench.board.run_until(bench.sent + Time::from_ms(ms));
        assert_eq!(bench.board.channel(1), Channel::Do { on: is_on }, "{ms} ms");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_go_to_safe_in_listen_only_mode() {
    let mut bench = Bench::new(Module::Do4, 1);
    bench.unlock();
    bench.write(0x0104, &[2]).unwrap();
    bench.ask(1, &[0x05, 0, FIRST, 0xFF, 0]).expect("a reply");
    assert_eq!(bench.ask(1, &[0x08, 0, 4, 0, 0]), None);
    assert_eq!(bench.board.channel(1), Channel::Do { on: true });
    for _ in 0..10 {
        assert_eq!(bench.ask(1, &[0x05, 0, FIRST + 1, 0xFF, 0]), None);
        bench.board.run_for(Time::from_ms(30));
    }
    assert_eq!(bench.board.channel(1), Channel::Do { on: false });
    assert_eq!(bench.board.channel(2), Channel::Do { on: false });
    assert_eq!(
        bench.ask(1, &[0x08, 0, 1, 0, 0]),
        None,
        "the restart gets no reply"
    );
    // The status is: communication lost, not saved, unlocked.
    assert_eq!(bench.ask(1, &[0x07]), Some(vec![0x07, 0b10_1001]));
    bench.assert_sound();
}
