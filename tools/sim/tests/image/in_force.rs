//! FRAME_GAP on the timer of the line: in force after the restart, with the time that it says.

use sim::{Module, Time};

use crate::bench::{Bench, FIRST, SLOT, adu};

const BAUD: u16 = 0x0101;
const FORMAT: u16 = 0x0102;
const FRAME_GAP: u16 = 0x0106;

/// Returns the time from the end of the request to the start of the reply to a read.
fn turnaround(bench: &mut Bench) -> Time {
    bench.bits(1, SLOT, 4).unwrap();
    let sent = bench.sent;
    let line = bench.board.line();
    line.frames().next_back().expect("a reply").start - sent
}

/// Asserts that `at` is at `due` or up to `slack` later.
fn assert_at(at: Time, due: Time, slack: Time) {
    assert!(at >= due && at <= due + slack, "{at:?}, due at {due:?}");
}

/// Sends a read with a pause of `gap` in its middle. Returns whether the unit answers.
fn answered_with_gap(bench: &mut Bench, gap: Time) -> bool {
    let frame = adu(&[1, 1, 0, FIRST, 0, 4]);
    let now = bench.board.now();
    let end = bench.board.line().send(now, &frame[..4]);
    let end = bench.board.line().send(end + gap, &frame[4..]);
    // The longest gap tried here is 10 ms.
    bench.board.run_until(end + Time::from_ms(12));
    !bench.answer_after(end).is_empty()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn longer_frame_gap_is_in_force_after_the_restart() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    bench.configure(FRAME_GAP, &[100]);
    bench.save();
    assert_at(
        turnaround(&mut bench),
        bench.t35(),
        Time::from_us(60) + bench.bit(),
    );
    assert!(!answered_with_gap(&mut bench, Time::from_ms(6)));
    bench.restart();
    assert!(answered_with_gap(&mut bench, Time::from_ms(6)));
    assert!(answered_with_gap(&mut bench, Time::from_us(9_500)));
    assert!(!answered_with_gap(&mut bench, Time::from_us(10_500)));
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
    bench.board.run_until(end + Time::from_ms(11));
    assert!(!bench.answer_after(end).is_empty());
    let start = bench.board.line().frames().next_back().unwrap().start - end;
    assert_at(start, Time::from_ms(10), Time::from_us(60) + bench.bit());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn requests_are_answered_with_every_frame_gap() {
    for (baud, format, gap) in [
        (12, 0, 2),
        (12, 3, 36),
        (48, 0, 5),
        (96, 1, 2),
        (576, 1, 2),
        (1152, 0, 2),
        (1152, 0, 5),
    ] {
        let settings = [(BAUD, baud), (FORMAT, format), (FRAME_GAP, gap)];
        let mut bench = Bench::set_up(Module::Di4, &settings);
        for _ in 0..3 {
            bench.assert_answers(1);
        }
        // With and without edges in the data bytes.
        bench.configure(0x01C0, &[0; 32]);
        let gap = Time::from_us(100 * u64::from(gap));
        let shortest = Time::from_ps(bench.characters(3).as_ps() / 2);
        let (due, slack) = (gap.max(shortest), Time::from_us(60) + bench.bit() * 2);
        assert_at(turnaround(&mut bench), due, slack);
    }
}
