//! A fault of the core makes the lines of all slots inputs.

use sim::{Module, Time};

use crate::fitted::{LINES, fitted};
use crate::rig::symbol;

/// `udf #0`
const UNDEFINED: [u8; 2] = [0x00, 0xDE];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_fault_makes_the_lines_of_all_slots_floating_before_the_reset() {
    let mut rig = fitted([Module::Do4; 4], &[]);
    rig.tolerant = true;
    for handler in ["USART1", "EXTI1"] {
        rig.write_bits(0, &[true; 16]).unwrap();
        rig.board.run_for(Time::from_ms(5));
        let lines = LINES.as_flattened();
        for &(port, pin) in lines {
            assert!(rig.board.is_output(port, pin) && rig.board.pin(port, pin));
        }
        let resets = rig.board.resets();
        let address = symbol(handler) & !1;
        let was = rig.board.patch_code(address, &UNDEFINED).unwrap();
        let from = rig.board.now();
        rig.board.line().send(from, &[1]);
        assert!(rig.board.run_until_pc(address, from + Time::from_ms(10)));
        let called = rig.board.now();
        // Keep the last state before the reset, because the reset itself makes all pins inputs.
        let mut floating = Vec::new();
        loop {
            rig.board.step(1);
            if rig.board.resets() > resets {
                break;
            }
            let is_input = |&(port, pin): &(char, u8)| !rig.board.is_output(port, pin);
            floating = lines.iter().map(is_input).collect();
            assert!(rig.board.now() < called + Time::from_ms(5), "no reset");
        }
        assert_eq!(floating, [true; 16], "{handler}");
        rig.board.patch_code(address, &was).unwrap();
        rig.started();
        assert_eq!(rig.register(0x0260), 2, "the fault is a hard fault");
        assert_eq!(rig.bits(1, 0, 16), Ok(vec![false; 16]));
    }
}
