//! A task that hangs, or is never run any more: the watchdog resets the device, outputs are safe, and
//! the next start can tell that it was the watchdog, and whose mark was missing.
//!
//! The watchdog's time is 500 ms on an LSI of 40 kHz (333 to 667 ms over the part's spread), counted from
//! the last feed. A task shows that it is alive every 100 ms at least, so a hang between two proofs may
//! see one feed more: the device is reset 600 ms after it at the latest.

use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST, SLOT, adu, corner};

/// 500 ms at 40 kHz, by the LSI there is, and a proof more.
fn limit() -> Time {
    Time::cycles(20_000, corner().oscillators().lsi) + Time::from_ms(102)
}

const LINE: u16 = 1 << 0;
const SERVE: u16 = 1 << 1;
const SCAN: u16 = 1 << 2;
const BACKGROUND: u16 = 1 << 3;

/// A branch to itself.
const SPIN: u16 = 0xE7FE;
/// Return at once.
const RETURN: u16 = 0x4770;

/// A board whose outputs are all on.
fn bench() -> Bench {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    bench.tolerant = true;
    bench.write_bits(SLOT, &[true; 4]).unwrap();
    bench.board.run_for(Time::from_ms(1_230));
    bench
}

/// Writes `code` over the program at `address` until the device is reset, with requests coming in, and
/// checks what a hang must lead to. The tasks whose marks were missing.
fn break_at(bench: &mut Bench, what: &str, address: u32, code: u16) -> u16 {
    bench.write_bits(SLOT, &[true; 4]).unwrap();
    let faults = bench.register(0x0261);
    let before = bench.board.resets();
    (0..4).for_each(|pin| bench.board.watch_pin('A', pin));
    let address = address & !1;
    let was = bench
        .board
        .patch_code(address, &code.to_le_bytes())
        .unwrap();
    let from = bench.board.now();
    // The timers' and the line's handlers need a request to be called.
    bench.board.line().send(from, &adu(&[1, 1, 0, FIRST, 0, 4]));
    while bench.board.resets() == before {
        assert!(bench.board.now() < from + limit(), "{what}: no reset");
        bench.board.run_for(Time::from_us(100));
    }
    for channel in 1..=4 {
        assert_eq!(
            bench.board.channel(channel),
            Channel::Do { on: false },
            "{what}"
        );
    }
    assert!(!bench.board.driver_enable(), "{what}: the bus is free");
    bench.board.patch_code(address, &was).unwrap();
    bench.started();
    assert_eq!(bench.board.resets(), before + 1, "{what}: one reset");
    for pin in 0..4 {
        let edges = bench.board.pin_edges('A', pin).iter();
        let edges: Vec<_> = edges.filter(|(at, _)| *at > from).collect();
        assert!(
            matches!(edges[..], [(_, false)]),
            "{what}: off once, {edges:?}"
        );
    }
    assert_eq!(
        bench.register(0x0207) & 0x3F,
        0b10_0100,
        "{what}: watchdog, pin"
    );
    assert_eq!(bench.register(0x0260), 3, "{what}: the watchdog bit");
    assert_eq!(bench.register(0x0261), faults + 1, "{what}: one fault more");
    assert_eq!(bench.long(0x0262), 0, "nobody knows where");
    bench.register(0x026C)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_task_that_spins_is_bitten_out_of_it() {
    let mut bench = bench();
    for handler in ["USART1", "TIM2", "TIM4", "EXTI3", "EXTI1", "EXTI0"] {
        let address = bench.board.symbol(handler).expect("the task's handler");
        break_at(&mut bench, handler, address, SPIN);
    }
}

/// An address that a handler comes by, some way behind its entry.
fn within(bench: &mut Bench, handler: &str) -> u32 {
    let entry = bench.board.symbol(handler).expect("the task's handler") & !1;
    let now = bench.board.now();
    bench.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
    assert!(bench.board.run_until_pc(entry, now + Time::from_ms(50)));
    // The number of the exception, the rest are flags (PM0056 2.1.3).
    let exception = |bench: &Bench| bench.board.register(16).map(|xpsr| xpsr & 0x1FF);
    let entered = exception(bench);
    bench.board.step(40);
    assert_eq!(exception(bench), entered, "still in {handler}");
    let address = bench.board.pc();
    bench.board.run_for(Time::from_ms(30));
    bench.board.line().take_received();
    address
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_task_that_hangs_on_its_way_is_named() {
    let mut bench = bench();
    for (handler, own) in [
        ("USART1", LINE),
        ("TIM2", LINE),
        ("EXTI3", SERVE),
        ("TIM4", LINE),
        ("EXTI1", SCAN),
        ("EXTI0", BACKGROUND),
    ] {
        let address = within(&mut bench, handler);
        let marks = break_at(&mut bench, handler, address, SPIN);
        assert_eq!(marks & own, own, "{handler}: {marks:#06b}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn idle_that_spins_is_bitten_though_all_others_live() {
    let mut bench = bench();
    while !bench.board.asleep() {
        bench.board.run_for(Time::from_us(1));
    }
    // Behind its WFI.
    let address = bench.board.pc();
    let marks = break_at(&mut bench, "idle", address, SPIN);
    assert_eq!(marks, 0, "all had left their marks");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_task_that_does_nothing_any_more_is_missed() {
    let mut bench = bench();
    for (handler, missing) in [("USART1", LINE), ("EXTI3", SERVE), ("EXTI0", BACKGROUND)] {
        // A task that stops after its mark of this round has left one. Stop it in front of that.
        bench.board.run_for(Time::from_ms(20));
        let address = bench.board.symbol(handler).expect("the task's handler");
        let marks = break_at(&mut bench, handler, address, RETURN);
        assert_eq!(marks & missing, missing, "{handler}: {marks:#06b}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_record_keeps_the_uptime_and_outlives_other_resets_but_not_the_power() {
    let mut bench = bench();
    bench.board.run_for(Time::from_secs(5));
    let scan = bench.board.symbol("EXTI1").unwrap();
    break_at(&mut bench, "scan", scan, SPIN);
    let uptime = bench.long(0x026A);
    assert!((6..=8).contains(&uptime), "{uptime} s");
    let record = bench.registers(0x0260, 16).unwrap();
    bench.board.reset();
    bench.started();
    assert_eq!(bench.register(0x0207), 0b10_0000, "by the pin");
    assert_eq!(bench.registers(0x0260, 16), Ok(record));
    assert_eq!(bench.registers(0x0260, 17), Err(2), "the record ends here");
    assert_eq!(bench.write(0x0260, &[0]), Err(2), "and cannot be written");
    bench.power_cycle();
    assert_eq!(bench.registers(0x0260, 16), Ok(vec![0; 16]));
}
