//! The configuration's lock, and what the status register says of changes.

use sim::{Module, Time};

use crate::bench::{Bench, MODULE, SLOT, adu};

const COMM_TIMEOUT: u16 = 0x0104;
const FILTER: u16 = 0x0120 + SLOT;

const UNSAVED: u16 = 8;
const WAITING: u16 = 16;
const UNLOCKED: u16 = 32;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn while_it_is_closed_nothing_can_be_written_and_everything_read() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    for (address, value, code) in [
        (COMM_TIMEOUT, 10, 6),
        (0x0108, 1, 6),
        (0x0108, 2, 6),
        (MODULE, 2, 6),
        (FILTER, 0, 6),
        (0x01E0 + SLOT, 1, 6),
        // Value and address come first.
        (COMM_TIMEOUT, 36_001, 3),
        (0x0109, 1, 2),
        (0x0100, 0x5A16, 3),
        (0x0100, 0, 3),
    ] {
        assert_eq!(bench.write(address, &[value]), Err(code), "10 {address:#x}");
        assert_eq!(
            bench.write_single(6, address, value),
            Err(code),
            "06 {address:#x}"
        );
    }
    assert_eq!(
        bench.write(0x0100, &[0x5A17, 96]),
        Err(6),
        "KEY opens it alone"
    );
    assert_eq!(bench.register(0x0100), 0);
    assert!(!bench.status(UNLOCKED | UNSAVED | WAITING));
    assert_eq!(
        bench.registers(0x0100, 9),
        Ok(vec![0, 96, 0, 0, 0, 0, 0, 0, 0])
    );
    // A broadcast cannot either.
    bench.exchange(&adu(&[0, 6, 1, 4, 0, 10]));
    assert_eq!(bench.register(COMM_TIMEOUT), 0);
    assert_eq!(bench.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn it_closes_sixty_seconds_after_the_last_configuration_write() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.unlock();
    let opened = bench.sent;
    assert_eq!(bench.register(0x0100), 1);
    bench.board.run_until(opened + Time::from_ms(59_900));
    assert!(bench.status(UNLOCKED));
    // A write keeps it open, a refused one or a point's does not.
    bench.write(COMM_TIMEOUT, &[0]).unwrap();
    let written = bench.sent;
    bench.board.run_until(written + Time::from_ms(30_000));
    assert_eq!(bench.write(COMM_TIMEOUT, &[36_001]), Err(3));
    assert_eq!(bench.write(0x0300 + 2 * SLOT, &[0, 0]), Ok(()));
    bench.board.run_until(written + Time::from_ms(59_900));
    assert!(bench.status(UNLOCKED));
    bench.board.run_until(written + Time::from_ms(60_010));
    assert!(!bench.status(UNLOCKED));
    assert_eq!(bench.register(0x0100), 0);
    assert_eq!(bench.write(COMM_TIMEOUT, &[0]), Err(6));
    bench.unlock();
    bench.power_cycle();
    assert_eq!(bench.register(0x0100), 0, "closed at every start");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_write_is_whole_or_not_at_all() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.configure(COMM_TIMEOUT, &[10, 0, 0, 1]);
    for (address, words, code) in [
        (COMM_TIMEOUT, &[20, 1001][..], 3),
        (COMM_TIMEOUT, &[20, 5, 4, 0], 3),
        (COMM_TIMEOUT, &[20, 5, 0, 0, 7], 3),
        (COMM_TIMEOUT, &[20, 5, 0, 0, 1, 0], 2),
        (0x00FF, &[0, 0x5A17], 2),
        (0x011F, &[1, 1], 2),
        (FILTER, &[1, 2, 3, 1001], 3),
        (0x01FF, &[0, 0], 2),
    ] {
        assert_eq!(
            bench.write(address, words),
            Err(code),
            "{address:#x} {words:?}"
        );
    }
    assert_eq!(bench.registers(COMM_TIMEOUT, 4), Ok(vec![10, 0, 0, 1]));
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![5; 4]));
    assert_eq!(bench.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn gaps_are_not_there() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.unlock();
    for (gap, count) in [
        (0x00FF, 1),
        (0x00FF, 2),
        (0x0109, 1),
        (0x0108, 2),
        (0x010F, 2),
        (0x0118, 1),
        (0x0117, 2),
        (0x0146, 1),
        (0x0145, 2),
        (0x015F, 2),
        (0x0226, 1),
        (0x0225, 2),
        (0x0239, 1),
        (0x0270, 1),
        (0x02FF, 1),
        (0x0340, 1),
        (0x7FFF, 1),
    ] {
        for function in [3, 4] {
            assert_eq!(
                bench.words(function, gap, count),
                Err(2),
                "{gap:#x}+{count}"
            );
        }
        let zeros = vec![0; count.into()];
        assert_eq!(bench.write(gap, &zeros), Err(2), "{gap:#x}+{count}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_status_tells_unsaved_and_waiting_changes() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    let of = |bench: &mut Bench| (bench.status(UNSAVED), bench.status(WAITING));
    assert_eq!(of(&mut bench), (false, false));
    bench.configure(FILTER, &[50]);
    assert_eq!(of(&mut bench), (true, false));
    bench.configure(FILTER, &[5]);
    assert_eq!(of(&mut bench), (false, false), "as it was");
    bench.configure(FILTER, &[50]);
    bench.save();
    assert_eq!(
        of(&mut bench),
        (false, false),
        "saved, and in force already"
    );
    bench.configure(0x0101, &[192]);
    assert_eq!(of(&mut bench), (true, false));
    bench.save();
    assert_eq!(of(&mut bench), (false, true));
    bench.configure(0x0101, &[96]);
    bench.save();
    assert_eq!(of(&mut bench), (false, false), "as it was when it started");

    bench.configure(FILTER, &[60, 61, 62, 63]);
    bench.command(4);
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![50, 5, 5, 5]), "dropped");
    assert_eq!(of(&mut bench), (false, false));
    bench.command(3);
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![5; 4]), "defaults");
    assert_eq!(bench.register(MODULE), 0, "MODULE too");
    assert_eq!(of(&mut bench), (true, false));
    bench.power_cycle();
    assert_eq!(bench.register(FILTER), 50, "defaults that were not saved");
    assert_eq!(bench.register(MODULE), 1);
}
