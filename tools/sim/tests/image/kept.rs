//! The kept region: a reset at any instruction of an update loses at most that update.
//!
//! A reset keeps the RAM, and a start reads nothing of it but this region. So it is enough to start the unit once with
//! each content that the region has after some instruction.

use sim::{Module, Time};

use crate::bench::{Bench, SLOT, adu, symbol};

const PULSES: u16 = 0x0300 + 2 * SLOT;
const FILTER: u16 = 0x0120 + SLOT;
/// Bytes of the region, and of its end, which holds the marks of the tasks.
const REGION: usize = 512;
const MARKS: usize = 16;

/// What the unit reports: pulses of the first input and the number of faults.
type Reported = (u32, u16);

fn range(bench: &Bench) -> std::ops::Range<usize> {
    let end = bench.board.ram().len();
    end - REGION..end - MARKS
}

/// Contents of the region, each with what the unit may report after it.
struct Contents(Vec<(Vec<u8>, [Reported; 2])>);

impl Contents {
    /// Runs instructions one by one, while the reported values change from `old` to `new`.
    fn collect(&mut self, bench: &mut Bench, instructions: u32, old: Reported, new: Reported) {
        let range = range(bench);
        let mut last = bench.board.ram()[range.clone()].to_vec();
        for _ in 0..instructions {
            bench.board.step(1);
            let now = &bench.board.ram()[range.clone()];
            if now != last {
                last = now.to_vec();
                self.0.push((last.clone(), [old, new]));
            }
        }
    }
}

/// Sends a request and runs until shortly before the unit executes it: the end of the frame, or of the echo.
fn send(bench: &mut Bench, pdu: &[u8], characters: u64) {
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&[&[1], pdu].concat()));
    let silence = bench.t35() + bench.characters(characters);
    bench.board.run_until(end + silence - Time::from_us(200));
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
    send(&mut bench, &[6, 1, 8, 0, 1], 8);
    let updates = contents.0.len();
    contents.collect(&mut bench, 200_000, (2, 0), (2, 0));
    assert!(contents.0.len() > updates, "the budget of saves");
    bench.started();

    // A hard fault in the scan, and the start after it.
    let scan = symbol("EXTI1") & !1;
    let limit = bench.board.now() + Time::from_ms(5);
    assert!(bench.board.run_until_pc(scan, limit));
    let was = bench.board.patch_code(scan, &[0, 0xDE]).unwrap();
    contents.collect(&mut bench, 20_000, (2, 0), (2, 1));
    assert_eq!(bench.board.resets(), 1);
    bench.board.patch_code(scan, &was).unwrap();
    contents.collect(&mut bench, 60_000, (2, 1), (2, 1));
    bench.started();

    send(&mut bench, &[16, 3, 32, 0, 2, 4, 0, 0, 0, 0], 0);
    contents.collect(&mut bench, 40_000, (2, 1), (0, 1));
    bench.started();
    let mut seen = Vec::new();
    for (n, (content, allowed)) in contents.0.iter().enumerate() {
        let range = range(&bench);
        bench.board.ram_mut()[range].copy_from_slice(content);
        bench.board.reset();
        bench.started();
        let found = (bench.long(PULSES), bench.register(0x0261));
        let fits = allowed.contains(&found);
        assert!(fits, "content {n}: {found:?}, not of {allowed:?}");
        seen.push(found);
    }
    seen.dedup();
    assert!(
        seen.ends_with(&[(1, 0), (2, 0), (2, 1), (0, 1)]),
        "{seen:?}"
    );
}
