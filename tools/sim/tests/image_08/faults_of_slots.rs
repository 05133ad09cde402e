//! A fault of the core makes the lines of all slots inputs.

use sim::{Module, Time};

use crate::bench::symbol;
use crate::fitted::{LINES, fitted};

/// `udf #0`
const UNDEFINED: [u8; 2] = [0x00, 0xDE];

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_fault_makes_the_lines_of_all_slots_floating_before_the_reset() {
    let mut bench = fitted([Module::Do4; 4], &[]);
    bench.tolerant = true;
    for handler in ["USART1", "EXTI1"] {
        bench.write_bits(0, &[true; 16]).unwrap();
        bench.board.run_for(Time::from_ms(5));
        let lines = LINES.as_flattened();
        for &(port, pin) in lines {
            assert!(bench.board.is_output(port, pin) && bench.board.pin(port, pin));
        }
        let resets = bench.board.resets();
        let address = symbol(handler) & !1;
        let was = bench.board.patch_code(address, &UNDEFINED).unwrap();
        let from = bench.board.now();
        bench.board.line().send(from, &[1]);
        assert!(bench.board.run_until_pc(address, from + Time::from_ms(10)));
        let called = bench.board.now();
        // Keep the last state before the reset, because the reset itself makes all pins inputs.
        let mut floating = Vec::new();
        loop {
            bench.board.step(1);
            if bench.board.resets() > resets {
                break;
            }
            let is_input = |&(port, pin): &(char, u8)| !bench.board.is_output(port, pin);
            floating = lines.iter().map(is_input).collect();
            assert!(bench.board.now() < called + Time::from_ms(5), "no reset");
        }
        assert_eq!(floating, [true; 16], "{handler}");
        bench.board.patch_code(address, &was).unwrap();
        bench.started();
        assert_eq!(bench.register(0x0260), 2, "the fault is a hard fault");
        assert_eq!(bench.bits(1, 0, 16), Ok(vec![false; 16]));
    }
}
