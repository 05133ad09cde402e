//! The points, the line and the watchdog during an update.

use super::*;

/// The slowest flash, writes of outputs all the time, and blocks faster than they are programmed.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_watchdog_is_refreshed_whatever_a_master_sends_during_an_update() {
    let stored = [(BAUD, Baud::B921600.code())];
    let module = Module::Do4;
    let mut rig = fitted(flash([&image(0), &[]], module, &stored), module, 1);
    rig.settings(FAST);
    answers(&mut rig, CHECK + START).expect("it starts");
    rig.patience = ERASE;
    rig.board.set_flash_durations(SLOWEST);
    assert_eq!(rig.order(Command::Prepare), Ok(()));
    let mut on = false;
    while rig.update_status().pages > 0 {
        for _ in 0..20 {
            on = !on;
            rig.write_bit(SLOT, on).unwrap();
        }
    }
    let silence = rig.t35() + rig.characters(1);
    let mut now = rig.board.now();
    for (number, block) in (0..).zip(image(1).chunks(BLOCK_BYTES)) {
        let (file, record) = place_of(Slot::B, number);
        let [[f1, f0], [r1, r0]] = [file, record].map(u16::to_be_bytes);
        let mut bytes = vec![0, 0x15, 135, 6, f1, f0, r1, r0, 0, 64];
        bytes.extend(block);
        bytes.resize(10 + BLOCK_BYTES, 0xFF);
        now = rig.board.line().send(now, &adu(&bytes)) + silence;
        rig.board.run_until(now);
    }
    rig.board.run_for(ERASE);
    let status = rig.update_status();
    assert!(
        status.missing > 0 && status.missing < status.blocks,
        "{status:?}"
    );
    assert_eq!(rig.board.resets(), 1, "that of the first start");
}

/// Points are read and outputs written all the time, at every kind of rate; a reply waits for the erase of a page at
/// most, which is what [`Rig::ask`] allows.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_points_are_served_and_no_byte_is_lost_during_an_update() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let stored = [(BAUD, baud.code())];
        let slots = [&image(0)[..], &[]];
        let mut rig = fitted(flash(slots, Module::Do4, &stored), Module::Do4, 1);
        rig.settings(Settings {
            baud: baud.bits_per_second(),
            ..Settings::default()
        });
        answers(&mut rig, CHECK + START).expect("it starts");
        rig.patience = ERASE;
        rig.configure(COMM_TIMEOUT, &[3]);
        rig.write_bits(SLOT, &[true, false, true, false]).unwrap();
        rig.board.run_for(Time::from_ms(10));
        (0..3).for_each(|pin| rig.board.watch_pin('A', pin));
        let mut switches = 0;
        let mut serve = |rig: &mut Rig| {
            switches += 1;
            let on = switches % 2 == 0;
            rig.write_bit(SLOT + 3, on).unwrap();
            let all = Ok(vec![true, false, true, on]);
            assert_eq!(rig.bits(1, SLOT, 4), all, "{baud:?}");
        };
        assert_eq!(rig.order(Command::Prepare), Ok(()));
        while rig.update_status().pages > 0 {
            serve(&mut rig);
        }
        for (number, block) in (0..20).zip(image(1).chunks(BLOCK_BYTES)) {
            while rig.block(Slot::B, number, block).is_err() {}
            serve(&mut rig);
        }
        for pin in 0..3 {
            assert_eq!(rig.board.pin_edges('A', pin), [], "{baud:?}");
        }
        // Errors, no response, overruns.
        let counted = [0x0231, 0x0234, 0x0237].map(|address| rig.register(address));
        assert_eq!(counted, [0; 3], "{baud:?}");
        assert!(switches > 20, "{switches}");
        // The communication watchdog trips at its time although a page is being erased.
        assert_eq!(rig.order(Command::Prepare), Ok(()));
        let last = rig.sent;
        rig.board.run_for(Time::from_ms(400));
        let edges = rig.board.pin_edges('A', 0);
        let &[(at, false)] = edges else {
            panic!("the output did not go off: {edges:?}");
        };
        let took = at - last;
        let due = Time::from_ms(298)..Time::from_ms(302) + ERASE;
        assert!(due.contains(&took), "{took:?}");
    }
}
