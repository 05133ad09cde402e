//! The clock: a crystal that is missing, or dies.

use sim::{Config, Module, Time};

use crate::bench::{Bench, adu, flash_with_settings, format};

/// The fault record's kind for a crystal that failed.
const CRYSTAL: u16 = 4;

fn without_crystal(settings: &[(u16, u16)]) -> Bench {
    Bench::with(Config {
        crystal: false,
        flash: Some(flash_with_settings(&[&[(0x0114, 2)], settings].concat())),
        module: Module::Do4,
        ..Config::default()
    })
}

/// That the unit's bits are as long as they should be: within half a percent over the last ten characters
/// of a reply, before which it may have been working out the rest.
fn assert_rate(bench: &mut Bench) {
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&[1, 3, 1, 0x60, 0, 20]));
    bench
        .board
        .run_until(end + bench.t35() + bench.characters(60));
    let reply = bench.board.line().take_received();
    assert_eq!(reply.len(), 45);
    assert!(reply.iter().all(sim::line::Received::is_good));
    let took = reply[44].start - reply[34].start;
    let nominal = bench.characters(10);
    let off = took.max(nominal) - took.min(nominal);
    assert!(off * 200 <= nominal, "{took:?}, not {nominal:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_a_crystal_every_rate_is_right() {
    for (baud, code) in [(96, 0), (1152, 1), (9216, 3)] {
        let mut bench = without_crystal(&[(0x0101, baud), (0x0102, code)]);
        bench.board.run_for(Time::from_ms(300));
        bench.settings(sim::line::Settings {
            baud: u32::from(baud) * 100,
            format: format(code),
        });
        assert_rate(&mut bench);
        bench.write_bits(0x10, &[true, false, true, false]).unwrap();
        assert_eq!(bench.bits(1, 0x10, 4), Ok(vec![true, false, true, false]));
        let log = bench.board.take_log();
        assert!(log.contains("crystal did not start"), "{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_a_crystal_a_second_is_a_second() {
    let mut bench = without_crystal(&[]);
    bench.board.run_for(Time::from_ms(300));
    let (from, uptime) = (bench.board.now(), bench.long(0x0208));
    bench.board.run_until(from + Time::from_secs(30));
    let passed = bench.long(0x0208) - uptime;
    assert!((29..=31).contains(&passed), "{passed} s in 30");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_crystal_that_dies_while_running_restarts_it_on_the_internal_oscillator() {
    let mut bench = Bench::set_up(Module::Do4, &[(0x0101, 1152)]);
    bench.tolerant = true;
    bench.write_bits(0x10, &[true; 4]).unwrap();
    bench.board.watch_pin('A', 0);
    let died = bench.board.now();
    bench.board.set_crystal(false);
    bench.board.run_for(Time::from_ms(600));
    assert_eq!(bench.board.resets(), 1, "it restarted");
    let (off, level) = bench.board.pin_edges('A', 0)[0];
    assert!(
        !level && off - died < Time::from_ms(1),
        "outputs off after {:?}",
        off - died
    );
    bench.board.line().take_received();
    assert_rate(&mut bench);
    assert_eq!(bench.register(0x0260), CRYSTAL);
    assert_eq!(bench.register(0x0261), 1);
    assert_eq!(bench.bits(1, 0x10, 4), Ok(vec![false; 4]));
    let log = bench.board.take_log();
    assert!(log.contains("crystal did not start"), "{log}");
    // With a new one it runs on that again.
    bench.board.set_crystal(true);
    bench.power_cycle();
    assert!(!bench.board.take_log().contains("crystal did not start"));
    assert_eq!(bench.board.hclk(), 72_000_000);
    assert_rate(&mut bench);
}
