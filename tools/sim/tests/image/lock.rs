//! The configuration's lock, and the status bits for changed settings.

use sim::{Module, Time};

use crate::bench::{Bench, MODULE, SLOT, adu};

const COMM_TIMEOUT: u16 = 0x0104;
const FILTER: u16 = 0x0120 + SLOT;

const UNSAVED: u16 = 8;
const WAITING: u16 = 16;
const UNLOCKED: u16 = 32;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn closed_lock_refuses_every_write_and_allows_every_read() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    for (address, value, code) in [
        (COMM_TIMEOUT, 10, 6),
        (0x0108, 1, 6),
        (0x0108, 2, 6),
        (MODULE, 2, 6),
        (FILTER, 0, 6),
        (0x01E0 + SLOT, 1, 6),
        // The checks of value and address come before the check of the lock.
        (COMM_TIMEOUT, 36_001, 3),
        (0x010A, 1, 2),
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
        "only KEY opens the lock"
    );
    assert_eq!(bench.register(0x0100), 0);
    assert!(!bench.status(UNLOCKED | UNSAVED | WAITING));
    assert_eq!(
        bench.registers(0x0100, 9),
        Ok(vec![0, 96, 0, 0, 0, 0, 0, 0, 0])
    );
    // A broadcast cannot write either.
    bench.exchange(&adu(&[0, 6, 1, 4, 0, 10]));
    assert_eq!(bench.register(COMM_TIMEOUT), 0);
    assert_eq!(bench.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn lock_closes_sixty_seconds_after_the_last_configuration_write() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.unlock();
    let opened = bench.sent;
    assert_eq!(bench.register(0x0100), 1);
    bench.board.run_until(opened + Time::from_ms(59_900));
    assert!(bench.status(UNLOCKED));
    // A successful configuration write keeps the lock open; a refused write or a write to a point does not.
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
    assert_eq!(
        bench.register(0x0100),
        0,
        "the lock is closed after every start"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn refused_write_changes_no_register_of_its_range() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.configure(COMM_TIMEOUT, &[10, 0, 0, 1]);
    for (address, words, code) in [
        (COMM_TIMEOUT, &[20, 1001][..], 3),
        (COMM_TIMEOUT, &[20, 5, 1, 0], 3),
        (COMM_TIMEOUT, &[20, 5, 0, 0, 7], 3),
        (COMM_TIMEOUT, &[20, 5, 0, 0, 1, 0, 0], 2),
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
fn access_to_a_gap_between_registers_gets_exception_02() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.unlock();
    for (gap, count) in [
        (0x00FF, 1),
        (0x00FF, 2),
        (0x010A, 1),
        (0x0109, 2),
        (0x010F, 2),
        (0x0118, 1),
        (0x0117, 2),
        (0x0146, 1),
        (0x0145, 2),
        (0x015F, 2),
        (0x0226, 1),
        (0x0225, 2),
        (0x0239, 1),
        (0x026F, 2),
        (0x0279, 1),
        (0x0278, 2),
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
fn status_reports_unsaved_changes_and_changes_that_wait_for_a_restart() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    let of = |bench: &mut Bench| (bench.status(UNSAVED), bench.status(WAITING));
    assert_eq!(of(&mut bench), (false, false));
    bench.configure(FILTER, &[50]);
    assert_eq!(of(&mut bench), (true, false));
    bench.configure(FILTER, &[5]);
    assert_eq!(of(&mut bench), (false, false), "the old value is back");
    bench.configure(FILTER, &[50]);
    bench.save();
    assert_eq!(
        of(&mut bench),
        (false, false),
        "the value is saved and in force"
    );
    bench.configure(0x0101, &[192]);
    assert_eq!(of(&mut bench), (true, false));
    bench.save();
    assert_eq!(of(&mut bench), (false, true));
    bench.configure(0x0101, &[96]);
    bench.save();
    assert_eq!(
        of(&mut bench),
        (false, false),
        "the value is that of the start"
    );

    bench.configure(FILTER, &[60, 61, 62, 63]);
    bench.command(4);
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![50, 5, 5, 5]), "dropped");
    assert_eq!(of(&mut bench), (false, false));
    bench.command(3);
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![5; 4]), "defaults");
    assert_eq!(bench.register(MODULE), 0, "MODULE has its default, too");
    assert_eq!(of(&mut bench), (true, false));
    bench.power_cycle();
    assert_eq!(
        bench.register(FILTER),
        50,
        "the default, which is not saved"
    );
    assert_eq!(bench.register(MODULE), 1);
}
