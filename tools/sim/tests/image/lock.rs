//! The time after which the configuration's lock closes.

use sim::{Module, Time};

use crate::bench::{Bench, SLOT};

const COMM_TIMEOUT: u16 = 0x0104;
const UNLOCKED: u16 = 32;

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
