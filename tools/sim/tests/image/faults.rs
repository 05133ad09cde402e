//! Faults of the core: the outputs go to a safe state immediately, the record has the place of the fault, and the unit
//! restarts.

use sim::{Channel, Module, Time};

use crate::rig::{FIRST, Rig, SLOT, adu, symbol};

const HARD_FAULT: u16 = 2;
const STACK_OVERFLOW: u16 = 5;

/// `udf #0`
const UNDEFINED: &[u16] = &[0xDE00];
/// `movs r0, #0; ldr r0, [r0]` would read the vector table. This code reads address 0xFFFFFFF0, where there is no
/// memory:
/// `movs r0, #15; mvns r0, r0; ldr r0, [r0]`.
const WILD_READ: &[u16] = &[0x200F, 0x43C0, 0x6800];
/// `push {r0-r7, lr}; b .-2`: pushes until the stack overflows.
const RECURSION: &[u16] = &[0xB5FF, 0xE7FD];

const HANDLERS: [&str; 6] = ["USART1", "TIM2", "TIM4", "EXTI3", "EXTI1", "EXTI0"];

fn rig() -> Rig {
    let mut rig = Rig::set_up(Module::Do4, &[]);
    rig.tolerant = true;
    rig
}

/// Replaces the start of a handler by `code`, at the instant at which it is called, until the device has reset itself
/// because of it.
fn fault_in(rig: &mut Rig, handler: &str, code: &[u16]) -> u32 {
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    let before = rig.board.resets();
    rig.board.watch_pin('A', 3);
    let address = symbol(handler) & !1;
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    let from = rig.board.now();
    rig.board.line().send(from, &adu(&[1, 1, 0, FIRST, 0, 4]));
    let called = rig.board.run_until_pc(address, from + Time::from_ms(120));
    assert!(called, "{handler} did not run");
    let called = rig.board.now();
    let was = rig.board.patch_code(address, &bytes).unwrap();
    while rig.board.resets() == before {
        rig.board.run_for(Time::from_us(20));
        assert!(!rig.board.locked_up(), "{handler}: locked up");
        assert!(
            rig.board.now() < called + Time::from_ms(5),
            "{handler}: no reset"
        );
    }
    let edges = rig.board.pin_edges('A', 3);
    let &[.., (off, false)] = edges else {
        panic!("{handler}: the output did not go off: {edges:?}");
    };
    let after = off - called;
    assert!(
        after < Time::from_ms(1),
        "{handler}: off {after:?} after the fault"
    );
    for channel in 1..=4 {
        assert_eq!(rig.board.channel(channel), Channel::Do { on: false });
    }
    rig.board.patch_code(address, &was).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), before + 1);
    assert_eq!(rig.register(0x0207) & 8, 8, "{handler}: reset by software");
    address
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn undefined_instruction_is_recorded_with_its_address() {
    let mut rig = rig();
    for (count, handler) in (1..).zip(HANDLERS) {
        let address = fault_in(&mut rig, handler, UNDEFINED);
        assert_eq!(rig.register(0x0260), HARD_FAULT, "{handler}");
        assert_eq!(rig.register(0x0261), count, "{handler}");
        assert_eq!(rig.long(0x0262), address, "{handler}: the program counter");
        assert_eq!(
            rig.long(0x0266) >> 16 & 1,
            1,
            "{handler}: CFSR says UNDEFINSTR"
        );
        assert_eq!(rig.long(0x0268), 0, "no faulty address");
        assert_eq!(rig.register(0x026C), 0, "no watchdog marks");
    }
    let log = rig.board.take_log();
    assert!(log.contains("hard fault"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn access_outside_of_memory_is_recorded_with_its_address() {
    let mut rig = rig();
    let address = fault_in(&mut rig, "EXTI1", WILD_READ);
    assert_eq!(rig.register(0x0260), HARD_FAULT);
    assert_eq!(rig.long(0x0262), address + 4);
    assert_eq!(rig.long(0x0266) >> 8 & 0x82, 0x82, "PRECISERR, BFARVALID");
    assert_eq!(rig.long(0x0268), 0xFFFF_FFF0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn stack_overflow_is_recorded_and_overwrites_no_data() {
    let mut rig = rig();
    for handler in HANDLERS {
        fault_in(&mut rig, handler, RECURSION);
        assert_eq!(rig.register(0x0260), STACK_OVERFLOW, "{handler}");
        assert_eq!(rig.write_bits(SLOT, &[true; 4]), Ok(()));
    }
    assert_eq!(rig.register(0x0261), HANDLERS.len() as u16);
}
