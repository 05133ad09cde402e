//! The kept region: a reset at any instruction of an update loses at most that update.
//!
//! A reset keeps the RAM, and a start reads nothing of it but this region. So it is enough to start the unit once with
//! each content that the region has after some instruction.

use sim::{Module, Time};

use crate::bench::{Bench, SLOT};

const PULSES: u16 = 0x0300 + 2 * SLOT;
const FILTER: u16 = 0x0120 + SLOT;
/// Bytes of the region, and of its end, which holds the marks of the tasks.
const REGION: usize = 512;
const MARKS: usize = 16;

/// Contents of the region, with the pulses and the number of faults that the unit may report after each of them.
struct Contents(Vec<(Vec<u8>, [(u32, u16); 2])>);

fn region(bench: &mut Bench) -> &mut [u8] {
    let ram = bench.board.ram_mut();
    let end = ram.len();
    &mut ram[end - REGION..end - MARKS]
}

impl Contents {
    /// Runs up to `instructions` one by one, while pulses and faults change from `old` to `new`.
    fn collect(&mut self, bench: &mut Bench, instructions: u32, old: (u32, u16), new: (u32, u16)) {
        let mut last = region(bench).to_vec();
        for _ in 0..instructions {
            bench.board.step(1);
            let now = region(bench);
            if now != last {
                last = now.to_vec();
                self.0.push((last.clone(), [old, new]));
            }
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_at_any_instruction_of_an_update_loses_at_most_that_update() {
    let mut bench = Bench::set_up(Module::Di4, &[(FILTER, 0)]);
    bench.tolerant = true;
    // A unit that had lost the region would read the switch again, and not answer.
    bench.board.set_dip(2);
    let mut contents = Contents(Vec::new());
    for pulses in 0..2 {
        bench.board.set_energised(1, true).unwrap();
        contents.collect(&mut bench, 20_000, (pulses, 0), (pulses + 1, 0));
        bench.board.set_energised(1, false).unwrap();
        bench.board.run_for(Time::from_ms(3));
    }
    bench.configure(FILTER, &[1]);
    bench.write(0x0108, &[1]).unwrap();
    contents.collect(&mut bench, 200_000, (2, 0), (2, 0));
    bench.board.run_for(Time::from_ms(100));

    // A hard fault in the scan, and the start after it.
    let scan = bench.board.symbol("EXTI1").expect("the handler") & !1;
    assert!(
        bench
            .board
            .run_until_pc(scan, bench.board.now() + Time::from_ms(5))
    );
    let was = bench.board.patch_code(scan, &[0, 0xDE]).unwrap();
    contents.collect(&mut bench, 20_000, (2, 0), (2, 1));
    assert_eq!(bench.board.resets(), 1);
    bench.board.patch_code(scan, &was).unwrap();
    contents.collect(&mut bench, 20_000, (2, 1), (2, 1));
    bench.started();

    bench.write(PULSES, &[0, 0]).unwrap();
    contents.collect(&mut bench, 20_000, (2, 1), (0, 1));
    bench.restart();
    let mut seen = Vec::new();
    for (n, (content, allowed)) in contents.0.iter().enumerate() {
        region(&mut bench).copy_from_slice(content);
        bench.board.reset();
        bench.started();
        let found = (bench.long(PULSES), bench.register(0x0261));
        assert!(
            allowed.contains(&found),
            "content {n}: {found:?}, not of {allowed:?}"
        );
        seen.push(found);
    }
    seen.dedup();
    for all in [(0, 0), (1, 0), (2, 0), (2, 1), (0, 1)] {
        assert!(seen.contains(&all), "{all:?} is missing in {seen:?}");
    }
}
