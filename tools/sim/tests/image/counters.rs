//! The pulse counters of digital inputs, and their debounce filter.

use register_map::configuration::FILTER;
use sim::{Module, Time};

use crate::bench::{Bench, MODULE, SLOT};

const PULSES: u16 = 0x0300 + 2 * SLOT;

fn pulse(bench: &mut Bench, channel: usize, high_us: u64, low_us: u64) {
    bench.board.set_energised(channel, true).unwrap();
    bench.board.run_for(Time::from_us(high_us));
    bench.board.set_energised(channel, false).unwrap();
    bench.board.run_for(Time::from_us(low_us));
}

fn counts(bench: &mut Bench) -> [u32; 4] {
    let words = bench.registers(PULSES, 8).unwrap();
    [0, 1, 2, 3].map(|n| u32::from(words[2 * n]) << 16 | u32::from(words[2 * n + 1]))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn rising_edges_are_counted_on_each_channel_after_its_debounce() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    for (channel, debounce_ms) in (1..).zip([0, 2, 5, 100]) {
        bench.configure(FILTER + SLOT + channel as u16 - 1, &[debounce_ms]);
        let settled = u64::from(debounce_ms) * 1000 + 3_000;
        for _ in 0..5 {
            pulse(&mut bench, channel, settled, settled);
        }
        // Pulses that are shorter than the debounce time by more than a scan are not counted, high or low.
        if let Some(short) = (u64::from(debounce_ms) * 1000).checked_sub(1_500) {
            pulse(&mut bench, channel, short, settled);
            bench.board.set_energised(channel, true).unwrap();
            bench.board.run_for(Time::from_us(settled));
            bench.board.set_energised(channel, false).unwrap();
            bench.board.run_for(Time::from_us(short));
            pulse(&mut bench, channel, settled, settled);
        } else {
            pulse(&mut bench, channel, settled, settled);
        }
        let mut expected = [0; 4];
        expected[..channel].fill(6);
        assert_eq!(counts(&mut bench), expected, "{debounce_ms} ms");
    }
    // Both functions read the same counters, and all of them in one request; ports without a slot return 0.
    for function in [3, 4] {
        assert_eq!(bench.words(function, PULSES + 2, 2), Ok(vec![0, 6]));
        let all = bench.words(function, 0x0300, 64).unwrap();
        assert_eq!(all.iter().map(|w| u32::from(*w)).sum::<u32>(), 24);
    }
    assert_eq!(bench.registers(0x0300, 65), Err(2));
    assert_eq!(bench.registers(0x02FF, 2), Err(2));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn counters_survive_a_restart_but_neither_another_module_nor_a_power_cycle() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    for channel in [1, 4, 4] {
        pulse(&mut bench, channel, 8_000, 8_000);
    }
    bench.restart();
    assert_eq!(counts(&mut bench), [1, 0, 0, 2]);
    pulse(&mut bench, 1, 8_000, 8_000);
    bench.board.reset();
    bench.started();
    assert_eq!(counts(&mut bench), [2, 0, 0, 2]);
    bench.power_cycle();
    assert_eq!(counts(&mut bench), [0; 4]);
    pulse(&mut bench, 1, 8_000, 8_000);
    for module in [Module::Do4, Module::Di4] {
        bench.configure(MODULE, &[module.code()]);
        bench.save();
        bench.restart();
        assert_eq!(counts(&mut bench), [0; 4]);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_counter_is_read_as_one_snapshot_while_its_low_word_overflows() {
    // At 115200 bit/s, with continuous pulses: the 32 bits never decrease and never jump by a word.
    let mut bench = Bench::set_up(Module::Di4, &[(0x0101, 1152), (FILTER + SLOT, 0)]);
    // 65 536 pulses take minutes, so the test writes the counter in RAM to a value near its overflow.
    for _ in 0..5 {
        pulse(&mut bench, 1, 2_000, 2_000);
    }
    assert_eq!(counts(&mut bench)[0], 5);
    let place = find_counter(&mut bench);
    bench.board.ram_mut()[place..place + 4].copy_from_slice(&0x0000_FFF0_u32.to_le_bytes());
    let mut last = bench.long(PULSES);
    assert_eq!(last, 0xFFF0);
    let mut energised = false;
    let mut crossed = false;
    for n in 0..400 {
        energised = !energised;
        bench.board.set_energised(1, energised).unwrap();
        bench.board.run_for(Time::from_us(37 * (n % 27)));
        let now = bench.long(PULSES);
        assert!((last..=last + 2).contains(&now), "{last:#x} then {now:#x}");
        crossed |= last < 0x1_0000 && now >= 0x1_0000;
        last = now;
    }
    assert!(crossed, "the counter never overflowed: {last:#x}");
}

/// Returns the offset of channel 1's counter in RAM: the only word that follows its pulses.
fn find_counter(bench: &mut Bench) -> usize {
    let words = |bench: &Bench| -> Vec<u32> {
        let ram = bench.board.ram();
        // Without the kept region, which has a copy.
        let words = ram[..ram.len() - 512].chunks(4);
        words
            .map(|w| u32::from_le_bytes(w.try_into().unwrap()))
            .collect()
    };
    let mut count = bench.long(PULSES);
    let mut places: Vec<usize> = (0..words(bench).len()).collect();
    for _ in 0..4 {
        let now = words(bench);
        places.retain(|place| now[*place] == count);
        pulse(bench, 1, 2_000, 2_000);
        count = bench.long(PULSES);
    }
    assert_eq!(
        places.len(),
        1,
        "not exactly one word counts pulses: {places:?}"
    );
    places[0] * 4
}
