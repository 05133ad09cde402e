//! Configuration over the line, and that it survives.

use sim::{
    Module, Time,
    line::{Format, Settings},
};

use crate::bench::Bench;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn settings_need_the_lock_open_and_their_ranges_kept() {
    let mut bench = Bench::new(Module::Di4, 1);
    assert_eq!(bench.write(0x0104, &[10]), Err(6));
    assert_eq!(
        bench.write(0x0104, &[36_001]),
        Err(3),
        "the value comes first"
    );
    assert_eq!(bench.write(0x0100, &[0x1234]), Err(3));
    bench.unlock();
    assert_eq!(bench.register(0x0100), 1);
    assert_eq!(bench.register(0x020A) & 32, 32);
    bench.write(0x0104, &[10, 0]).unwrap();
    assert_eq!(bench.registers(0x0104, 2), Ok(vec![10, 0]));
    assert_eq!(bench.write(0x0104, &[20, 1001]), Err(3));
    assert_eq!(
        bench.registers(0x0104, 2),
        Ok(vec![10, 0]),
        "all or nothing"
    );
    assert_eq!(bench.register(0x020A) & 8, 8, "changed, not saved");
    for (gap, count) in [
        (0x0109, 1),
        (0x0108, 2),
        (0x0118, 1),
        (0x0146, 1),
        (0x015F, 2),
    ] {
        assert_eq!(bench.registers(gap, count), Err(2), "{gap:#x}");
    }
    bench.board.run_for(Time::from_secs(61));
    assert_eq!(bench.register(0x0100), 0, "closed after a minute");
    assert_eq!(bench.write(0x0104, &[0]), Err(6));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn what_is_saved_survives_and_what_is_not_does_not() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    bench.write(0x0120 + 0x10, &[50, 60, 70, 80]).unwrap();
    bench.save();
    bench.write(0x0120 + 0x10, &[1, 2, 3, 4]).unwrap();
    bench.power_cycle();
    assert_eq!(bench.registers(0x0130, 4), Ok(vec![50, 60, 70, 80]));
    assert_eq!(bench.register(0x0114), 1);
    bench.unlock();
    bench.write(0x0130, &[9]).unwrap();
    bench.write(0x0108, &[4]).unwrap();
    assert_eq!(bench.register(0x0130), 50, "changes dropped");
    bench.write(0x0108, &[3]).unwrap();
    assert_eq!(bench.register(0x0130), 5, "defaults");
    // Thirty saves and as many restarts: pages fill and are made room in.
    for n in 0..30 {
        bench.unlock();
        bench.write(0x0114, &[1]).unwrap();
        bench.write(0x0130, &[100 + n]).unwrap();
        bench.save();
        if n % 3 == 0 {
            bench.power_cycle();
        }
        assert_eq!(bench.register(0x0130), 100 + n);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_line_changes_at_the_restart_which_is_answered_first() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    bench.write(0x0101, &[1152, 1]).unwrap();
    bench.save();
    bench.assert_answers(1);
    bench.write(0x0108, &[2]).unwrap();
    bench.board.run_for(Time::from_ms(300));
    assert_eq!(bench.board.resets(), 1);
    bench.settings(Settings {
        baud: 115_200,
        format: Format::E1,
    });
    bench.assert_answers(1);
    assert_eq!(bench.register(0x0207) & 8, 8, "software reset");
    // All switches on: the factory's line, whatever is stored.
    bench.board.set_dip(255);
    bench.power_cycle();
    bench.settings(Settings::default());
    assert!(bench.ask(255, &[3, 1, 1, 0, 2]).is_some());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_power_cut_at_any_operation_of_a_save_leaves_old_or_new() {
    let mut old = Bench::new(Module::Di4, 1);
    old.unlock();
    old.write(0x0130, &[11, 12, 13, 14]).unwrap();
    old.save();
    let stored = old.board.flash().to_vec();
    drop(old);

    let mut seen = [0, 0];
    for operation in 1.. {
        for fraction in [0.0, 0.5, 1.0] {
            let mut bench = Bench::with(sim::Config {
                flash: Some(stored.clone()),
                ..sim::Config::default()
            });
            bench.tolerant = true;
            bench.unlock();
            bench.write(0x0130, &[21, 22, 23, 24]).unwrap();
            bench.board.cut_in_flash_operation(operation, fraction);
            bench.write(0x0108, &[1]).unwrap();
            bench.board.run_for(Time::from_ms(100));
            if bench.board.powered() {
                // It had fewer operations than this.
                assert!(operation > 10, "a save is more than {operation} operations");
                assert!(seen[0] > 0 && seen[1] > 0, "{seen:?}");
                return;
            }
            bench.board.power_on();
            bench.board.run_for(Time::from_ms(400));
            let values = bench.registers(0x0130, 4).unwrap();
            let place = [[11, 12, 13, 14], [21, 22, 23, 24]]
                .iter()
                .position(|set| set[..] == values);
            let place = place.unwrap_or_else(|| panic!("{operation} {fraction}: {values:?}"));
            seen[place] += 1;
            assert_eq!(bench.register(0x020A) & 2, 0, "the store is not damaged");
            assert_eq!(bench.register(0x0114), 1);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_damaged_store_leaves_defaults_and_says_so() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.board.power_off();
    for byte in &mut bench.board.flash_mut().unwrap()[0xF800..0x1_0000] {
        *byte = byte.wrapping_mul(31).wrapping_add(7);
    }
    bench.board.power_on();
    bench.board.run_for(Time::from_ms(400));
    assert_eq!(bench.register(0x020A) & 2, 2);
    assert_eq!(bench.register(0x0101), 96);
    bench.unlock();
    bench.write(0x0114, &[1]).unwrap();
    bench.save();
    bench.power_cycle();
    assert_eq!(bench.register(0x020A) & 2, 0);
    assert_eq!(bench.register(0x0114), 1);
}
