//! What happens until an image is confirmed, and the ways back.

use super::*;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_254_starts_the_other_image_until_the_next_power_on_or_an_order() {
    let mut switched = holding(UPDATED.clone(), 254);
    switched.patience = ERASE;
    for asked in [true, false] {
        answers_as(&mut switched, 255, START).expect("it starts");
        assert_eq!(runs_from(&mut switched), 0);
        let register = switched.ask(255, &[3, 2, 0x2A, 0, 1]);
        assert_eq!(register.as_deref(), Some(&[3, 2, 0, 0b101_0101][..]));
        // A restart keeps the choice, whatever the reason.
        if asked {
            let _ = switched.ask(255, &[6, 1, 0, 0x5A, 0x17]);
            let _ = switched.ask(255, &[6, 1, 8, 0, 2]);
        } else {
            switched.board.reset();
        }
        switched.board.run_for(Time::from_ms(20));
    }
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 0);
    let _ = switched.ask(255, &[6, 1, 0, 0x5A, 0x17]);
    let _ = switched.ask(255, &[6, 1, 8, 0xB0, 3]);
    switched.board.run_for(ERASE);
    switched.board.reset();
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 0, "it is preferred now");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn command_b007_restarts_once_as_with_switch_255() {
    let mut rig = running();
    assert_eq!(rig.order(Command::RestartAs255), Ok(()));
    rig.board.run_for(Time::from_ms(20));
    rig.settings(Settings::default());
    answers_as(&mut rig, 255, START).expect("it starts");
    rig.board.reset();
    rig.settings(FAST);
    answers(&mut rig, START).expect("it starts");
}

/// Patches code at the reset vector's target.
fn at_reset(code: &'static [u8]) -> impl FnOnce(&mut [u8]) {
    move |image| {
        let vector = &image[APPLICATION + 4..APPLICATION + 8];
        let vector = u32::from_le_bytes(vector.try_into().unwrap()) & !1;
        let at = APPLICATION + (vector - LAYOUT.board.layout().slots[1]) as usize - 512;
        image[at..at + code.len()].copy_from_slice(code);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_hangs_or_faults_is_rolled_back_without_help() {
    // An endless loop, and an undefined instruction.
    for code in [&[0xFE, 0xE7][..], &[0x00, 0xDE]] {
        let mut rig = with_changes(&signed(1, at_reset(code)));
        // Two starts on trial, each up to the loader's watchdog, 8 s at 40 kHz, 14 s at 30 kHz.
        rig.board.run_for(Time::from_ms(20));
        answers(&mut rig, CHECK + Time::from_ms(30_000)).expect("the old one serves");
        let status = rig.update_status();
        assert_eq!(runs_from(&mut rig), 0);
        assert_eq!((status.state, status.reason), (REJECTED, 10));
        // It may be tried again.
        assert_eq!(rig.order(Command::Finish), Ok(()));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_nobody_confirms_is_rolled_back_after_15_minutes_each_start() {
    let mut rig = starting(NEW.clone());
    assert_eq!(after(&mut rig).0, 1);
    let minutes = |rig: &mut Rig, minutes: u64| {
        rig.board.run_for(Time::from_ms(60_000 * minutes));
        runs_from(rig)
    };
    assert_eq!(minutes(&mut rig, 14), 1);
    assert_eq!(minutes(&mut rig, 2), 1, "the second start");
    assert_eq!(minutes(&mut rig, 15), 0);
    let (_, status) = after(&mut rig);
    assert_eq!((status.state, status.reason), (REJECTED, 10));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn power_cut_during_the_check_needs_only_the_order_again() {
    let mut rig = starting(NEW.clone());
    rig.board.run_for(Time::from_ms(700));
    assert!(rig.board.pc() < LAYOUT.board.layout().slots[0], "it checks");
    rig.board.cycle();
    let (slot, status) = after(&mut rig);
    assert_eq!((slot, status.state, status.reason), (0, REJECTED, 9));
    assert_eq!(rig.order(Command::Finish), Ok(()));
    assert_eq!(after(&mut rig).0, 1);
}
