//! A task that hangs, or that no longer runs: the watchdog resets the device, the outputs are safe, and after the next
//! start the fault record has the watchdog as the cause and the tasks whose marks were missing.
//!
//! The watchdog's time is 900 ms with an LSI of 40 kHz (600 to 1,200 ms over the part's spread), counted from the last
//! refresh. A task sets its mark at least every 100 ms, so one more refresh may follow a hang. The device is reset
//! 1,000 ms after the hang at the latest.

use sim::{Channel, Module, Time};

use crate::rig::{FIRST, Rig, SLOT, adu, corner, symbol};

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
fn rig() -> Rig {
    let mut rig = Rig::set_up(Module::Do4, &[]);
    rig.tolerant = true;
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    rig.board.run_for(Time::from_ms(1_230));
    rig
}

/// Writes `code` over the program at `address` until the device is reset, and checks the
/// effects of the hang. Returns the tasks whose marks were missing.
fn break_at(rig: &mut Rig, what: &str, address: u32, code: u16) -> u16 {
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    let faults = rig.register(0x0261);
    let before = rig.board.resets();
    (0..4).for_each(|pin| rig.board.watch_pin('A', pin));
    let address = address & !1;
    let was = rig.board.patch_code(address, &code.to_le_bytes()).unwrap();
    let from = rig.board.now();
    if code == SPIN {
        // A handler may get to the address only when there is a request.
        rig.board.line().send(from, &adu(&[1, 1, 0, FIRST, 0, 4]));
    }
    while rig.board.resets() == before {
        assert!(rig.board.now() < from + limit(), "{what}: no reset");
        rig.board.run_for(Time::from_us(100));
    }
    for channel in 1..=4 {
        assert_eq!(
            rig.board.channel(channel),
            Channel::Do { on: false },
            "{what}"
        );
    }
    assert!(!rig.board.driver_enable(), "{what}: the driver is off");
    rig.board.patch_code(address, &was).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), before + 1, "{what}: one reset");
    let log = rig.board.take_log();
    assert!(
        log.contains("WARN last fault: watchdog reset\n"),
        "{what}: {log}"
    );
    for pin in 0..4 {
        let edges = rig.board.pin_edges('A', pin).iter();
        let edges: Vec<_> = edges.filter(|(at, _)| *at > from).collect();
        assert!(
            matches!(edges[..], [(_, false)]),
            "{what}: off once, {edges:?}"
        );
    }
    assert_eq!(
        rig.register(0x0207) & 0x3F,
        0b10_0100,
        "{what}: the reset cause"
    );
    assert_eq!(rig.register(0x0260), 3, "{what}: the kind of the fault");
    assert_eq!(rig.register(0x0261), faults + 1, "{what}: one fault more");
    assert_eq!(rig.long(0x0262), 0, "the address of the fault is unknown");
    rig.register(0x026C)
}

/// Returns an address that a handler executes, some instructions after its entry.
fn within(rig: &mut Rig, handler: &str) -> u32 {
    let entry = symbol(handler) & !1;
    let now = rig.board.now();
    rig.board.line().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
    assert!(rig.board.run_until_pc(entry, now + Time::from_ms(50)));
    // The number of the exception. The other bits are flags (PM0056 2.1.3).
    let exception = |rig: &Rig| rig.board.register(16).map(|xpsr| xpsr & 0x1FF);
    let entered = exception(rig);
    rig.board.step(40);
    assert_eq!(exception(rig), entered, "still in {handler}");
    let address = rig.board.pc();
    rig.board.run_for(Time::from_ms(30));
    rig.board.line().take_received();
    address
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn task_that_hangs_after_its_entry_is_named_in_the_record() {
    let mut rig = rig();
    for (handler, own) in [
        ("USART1", LINE),
        ("TIM2", LINE),
        ("EXTI3", SERVE),
        ("TIM4", LINE),
        ("EXTI1", SCAN),
        ("EXTI0", BACKGROUND),
    ] {
        let address = within(&mut rig, handler);
        let marks = break_at(&mut rig, handler, address, SPIN);
        assert_eq!(marks & own, own, "{handler}: {marks:#06b}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn endless_loop_in_idle_causes_a_watchdog_reset_although_all_tasks_run() {
    let mut rig = rig();
    while !rig.board.asleep() {
        rig.board.run_for(Time::from_us(1));
    }
    // The core sleeps in the WFI of the loop, so the next instruction is the one after it. The WFI itself is replaced:
    // every pass of the loop executes it, whatever code the compiler puts around it.
    let address = rig.board.pc() - 2;
    let wfi = WFI.to_le_bytes();
    assert_eq!(rig.board.patch_code(address, &wfi).unwrap(), wfi);
    let marks = break_at(&mut rig, "idle", address, SPIN);
    assert_eq!(marks, 0, "all tasks had set their marks");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn task_that_returns_without_setting_its_mark_causes_a_watchdog_reset() {
    let mut rig = rig();
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
        rig.board.run_for(Time::from_ms(20));
        let address = symbol(handler);
        let marks = break_at(&mut rig, handler, address, RETURN);
        assert_eq!(marks & missing, missing, "{handler}: {marks:#06b}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn record_has_the_uptime_and_survives_resets_but_not_a_power_cycle() {
    let mut rig = rig();
    rig.board.run_for(Time::from_secs(5));
    let scan = symbol("EXTI1");
    break_at(&mut rig, "scan", scan, SPIN);
    let uptime = rig.long(0x026A);
    assert!((6..=8).contains(&uptime), "{uptime} s");
    let record = rig.registers(0x0260, 16).unwrap();
    rig.board.reset();
    rig.started();
    assert_eq!(
        rig.register(0x0207),
        0b10_0000,
        "the reset cause is the pin"
    );
    assert_eq!(rig.registers(0x0260, 16), Ok(record));
    rig.power_cycle();
    assert_eq!(rig.registers(0x0260, 16), Ok(vec![0; 16]));
}
