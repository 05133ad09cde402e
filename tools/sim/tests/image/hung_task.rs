//! A task that hangs, or that no longer runs: the watchdog resets the device, the outputs are safe, and after the next
//! start the fault record has the watchdog as the cause and the tasks whose marks were missing.
//!
//! The watchdog's time is 900 ms with an LSI of 40 kHz (600 to 1,200 ms over the part's spread), counted from the last
//! refresh. A task sets its mark at least every 100 ms, so one more refresh may follow a hang. The device is reset
//! 1,000 ms after the hang at the latest.

use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST, SLOT, adu, corner, symbol};

/// Returns the longest time to the reset: 900 ms at 40 kHz, converted to the real LSI, and one more period of marks.
fn limit() -> Time {
    Time::cycles(36_000, corner().oscillators().lsi) + Time::from_ms(102)
}

const LINE: u16 = 1 << 0;
const SERVE: u16 = 1 << 1;
const SCAN: u16 = 1 << 2;
const BACKGROUND: u16 = 1 << 3;

/// A branch to its own address.
const SPIN: u16 = 0xE7FE;
/// The instruction that waits for an interrupt.
const WFI: u16 = 0xBF30;
/// A return from the function.
const RETURN: u16 = 0x4770;

/// A board whose outputs are all on.
fn bench() -> Bench {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    bench.tolerant = true;
    bench.write_bits(SLOT, &[true; 4]).unwrap();
    bench.board.run_for(Time::from_ms(1_230));
    bench
}

/// Writes `code` over the program at `address` until the device is reset, and checks the
/// effects of the hang. Returns the tasks whose marks were missing.
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
    if code == SPIN {
        // A handler may get to the address only when there is a request.
        bench.board.line().send(from, &adu(&[1, 1, 0, FIRST, 0, 4]));
    }
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
    assert!(!bench.board.driver_enable(), "{what}: the driver is off");
    bench.board.patch_code(address, &was).unwrap();
    bench.started();
    assert_eq!(bench.board.resets(), before + 1, "{what}: one reset");
    let log = bench.board.take_log();
    assert!(
        log.contains("WARN last fault: watchdog reset\n"),
        "{what}: {log}"
    );
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
        "{what}: the reset cause"
    );
    assert_eq!(bench.register(0x0260), 3, "{what}: the kind of the fault");
    assert_eq!(bench.register(0x0261), faults + 1, "{what}: one fault more");
    assert_eq!(bench.long(0x0262), 0, "the address of the fault is unknown");
    bench.register(0x026C)
}

/// Returns an address that a handler executes, some instructions after its entry.
fn within(bench: &mut Bench, handler: &str) -> u32 {
    let entry = symbol(handler) & !1;
    let now = bench.board.now();
    bench.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
    assert!(bench.board.run_until_pc(entry, now + Time::from_ms(50)));
    // The number of the exception. The other bits are flags (PM0056 2.1.3).
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
fn task_that_hangs_after_its_entry_is_named_in_the_record() {
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
fn endless_loop_in_idle_causes_a_watchdog_reset_although_all_tasks_run() {
    let mut bench = bench();
    while !bench.board.asleep() {
        bench.board.run_for(Time::from_us(1));
    }
    // The core sleeps in the WFI of the loop, so the next instruction is the one after it. The WFI itself is replaced:
    // every pass of the loop executes it, whatever code the compiler puts around it.
    let address = bench.board.pc() - 2;
    let wfi = WFI.to_le_bytes();
    assert_eq!(bench.board.patch_code(address, &wfi).unwrap(), wfi);
    let marks = break_at(&mut bench, "idle", address, SPIN);
    assert_eq!(marks, 0, "all tasks had set their marks");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn task_that_returns_without_setting_its_mark_causes_a_watchdog_reset() {
    let mut bench = bench();
    for (handler, missing) in [
        ("USART1", LINE),
        ("TIM2", LINE),
        ("TIM1_CC", LINE),
        ("TIM4", LINE),
        ("USART3", LINE),
        ("EXTI4", LINE),
        ("EXTI3", SERVE),
        ("EXTI0", BACKGROUND),
    ] {
        // A task that stops after its mark of this round has set that mark, so stop it in front of the mark.
        bench.board.run_for(Time::from_ms(20));
        let address = symbol(handler);
        let marks = break_at(&mut bench, handler, address, RETURN);
        assert_eq!(marks & missing, missing, "{handler}: {marks:#06b}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn record_has_the_uptime_and_survives_resets_but_not_a_power_cycle() {
    let mut bench = bench();
    bench.board.run_for(Time::from_secs(5));
    let scan = symbol("EXTI1");
    break_at(&mut bench, "scan", scan, SPIN);
    let uptime = bench.long(0x026A);
    assert!((6..=8).contains(&uptime), "{uptime} s");
    let record = bench.registers(0x0260, 16).unwrap();
    bench.board.reset();
    bench.started();
    assert_eq!(
        bench.register(0x0207),
        0b10_0000,
        "the reset cause is the pin"
    );
    assert_eq!(bench.registers(0x0260, 16), Ok(record));
    bench.power_cycle();
    assert_eq!(bench.registers(0x0260, 16), Ok(vec![0; 16]));
}
