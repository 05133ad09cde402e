//! FRAME_GAP on the timer of the line: in force after the restart, with the time that it says.

use sim::{Module, Time};

use crate::rig::{FIRST, Rig, SLOT, adu};

const BAUD: u16 = 0x0101;
const FORMAT: u16 = 0x0102;
const FRAME_GAP: u16 = 0x0106;

/// Returns the time from the end of the request to the start of the reply to a read.
fn turnaround(rig: &mut Rig) -> Time {
    rig.bits(1, SLOT, 4).unwrap();
    let sent = rig.sent;
    let line = rig.board.line();
    line.frames().next_back().expect("a reply").start - sent
}

/// Asserts that `at` is at `due` or up to `slack` later.
fn assert_at(at: Time, due: Time, slack: Time) {
    assert!(at >= due && at <= due + slack, "{at:?}, due at {due:?}");
}

/// Sends a read with a pause of `gap` in its middle. Returns whether the unit answers.
fn answered_with_gap(rig: &mut Rig, gap: Time) -> bool {
    let frame = adu(&[1, 1, 0, FIRST, 0, 4]);
    let now = rig.board.now();
    let end = rig.board.line().send(now, &frame[..4]);
    let end = rig.board.line().send(end + gap, &frame[4..]);
    // The longest gap tried here is 10 ms.
    rig.board.run_until(end + Time::from_ms(12));
    !rig.answer_after(end).is_empty()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn longer_frame_gap_is_in_force_after_the_restart() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.tolerant = true;
    rig.configure(FRAME_GAP, &[100]);
    rig.save();
    assert_at(
        turnaround(&mut rig),
        rig.t35(),
        Time::from_us(60) + rig.bit(),
    );
    assert!(!answered_with_gap(&mut rig, Time::from_ms(6)));
    rig.restart();
    assert!(answered_with_gap(&mut rig, Time::from_ms(6)));
    assert!(answered_with_gap(&mut rig, Time::from_us(9_500)));
    assert!(!answered_with_gap(&mut rig, Time::from_us(10_500)));
    let now = rig.board.now();
    let end = rig.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
    rig.board.run_until(end + Time::from_ms(11));
    assert!(!rig.answer_after(end).is_empty());
    let start = rig.board.line().frames().next_back().unwrap().start - end;
    assert_at(start, Time::from_ms(10), Time::from_us(60) + rig.bit());
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
        let mut rig = Rig::set_up(Module::Di4, &settings);
        for _ in 0..3 {
            rig.assert_answers(1);
        }
        // With and without edges in the data bytes.
        rig.configure(0x01C0, &[0; 32]);
        let gap = Time::from_us(100 * u64::from(gap));
        let shortest = Time::from_ps(rig.characters(3).as_ps() / 2);
        let (due, slack) = (gap.max(shortest), Time::from_us(60) + rig.bit() * 2);
        assert_at(turnaround(&mut rig), due, slack);
    }
}
