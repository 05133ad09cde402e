//! The clock with a missing crystal, and with a crystal that fails.
//!
//! Every frequency is that of the oscillator at the corner.

use sim::{Module, Time};

use crate::rig::{Rig, SLOT, adu, config, format, on_crystal, on_hsi};

/// Status bit: the unit runs on the internal oscillator.
const INTERNAL: u16 = 1 << 6;

/// Kind of the fault record for a failed crystal.
const CRYSTAL: u16 = 4;

fn without_crystal(settings: &[(u16, u16)]) -> Rig {
    let mut config = config(Module::Do4, settings);
    config.chip.crystal = false;
    Rig::with(config)
}

/// Asserts that the unit's bits have the right length: within half a percent over the last ten characters of a reply.
/// Before those, the unit may still be calculating the reply.
fn assert_rate(rig: &mut Rig) {
    let now = rig.board.now();
    let end = rig.board.line().send(now, &adu(&[1, 3, 1, 0x60, 0, 20]));
    rig.board.run_until(end + rig.t35() + rig.characters(60));
    let reply = rig.board.line().take_received();
    assert_eq!(reply.len(), 45);
    assert!(reply.iter().all(sim::line::Received::is_good));
    let took = reply[44].start - reply[34].start;
    // The error of the oscillator that the board uses is not an error of the firmware.
    let (is, exact) = match rig.board.hclk() {
        hclk if hclk == on_crystal(72_000_000) => (hclk, 72e6),
        hclk => (hclk, 60e6),
    };
    let exact = rig.characters(10).as_ps() as f64 * exact / f64::from(is);
    let nominal = Time::from_ps(exact as u64);
    let off = took.max(nominal) - took.min(nominal);
    assert!(off * 200 <= nominal, "took {took:?}, nominal {nominal:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_rate_is_accurate_without_a_crystal() {
    for (baud, code) in [(96, 0), (1152, 1), (9216, 3)] {
        let mut rig = without_crystal(&[(0x0101, baud), (0x0102, code)]);
        rig.board.run_for(Time::from_ms(300));
        rig.settings(sim::line::Settings {
            baud: u32::from(baud) * 100,
            format: format(code),
        });
        assert_rate(&mut rig);
        rig.write_bits(SLOT, &[true, false, true, false]).unwrap();
        assert_eq!(rig.bits(1, SLOT, 4), Ok(vec![true, false, true, false]));
        // At every phase of the unit's other work, which takes longer with this clock.
        for n in 0..400 {
            rig.board.run_for(Time::from_us(n * 37 % 1_100));
            rig.assert_answers(1);
        }
        let log = rig.board.take_log();
        assert!(log.contains("crystal did not start"), "{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn uptime_is_accurate_without_a_crystal() {
    let mut rig = without_crystal(&[]);
    rig.board.run_for(Time::from_ms(300));
    let (from, uptime) = (rig.board.now(), rig.long(0x0208));
    rig.board.run_until(from + Time::from_secs(30));
    let passed = rig.long(0x0208) - uptime;
    assert!((29..=31).contains(&passed), "{passed} s in 30");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn crystal_failure_while_running_restarts_the_unit_on_the_internal_oscillator() {
    let mut rig = Rig::set_up(Module::Do4, &[(0x0101, 1152)]);
    rig.tolerant = true;
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    rig.board.watch_pin('A', 0);
    let died = rig.board.now();
    rig.board.set_crystal(false);
    rig.board.run_for(Time::from_ms(600));
    assert_eq!(rig.board.resets(), 1, "one restart");
    let (off, level) = rig.board.pin_edges('A', 0)[0];
    assert!(
        !level && off - died < Time::from_ms(1),
        "outputs off after {:?}",
        off - died
    );
    rig.board.line().take_received();
    assert_rate(&mut rig);
    assert_eq!(rig.register(0x0260), CRYSTAL);
    assert_eq!(rig.register(0x0261), 1);
    assert_eq!(rig.bits(1, SLOT, 4), Ok(vec![false; 4]));
    let log = rig.board.take_log();
    assert!(log.contains("crystal did not start"), "{log}");
    // With a new crystal the unit runs on the crystal again.
    rig.board.set_crystal(true);
    rig.power_cycle();
    assert!(!rig.board.take_log().contains("crystal did not start"));
    assert_eq!(rig.board.hclk(), on_crystal(72_000_000));
    assert_rate(&mut rig);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn crystal_that_fails_after_each_start_is_not_used_after_two_faults_until_power_on() {
    // START switches output 1 on.
    let mut rig = Rig::set_up(Module::Do4, &[(0x0101, 1152), (0x01E0 + SLOT, 1)]);
    rig.tolerant = true;
    assert!(!rig.status(INTERNAL));
    rig.board.watch_pin('A', 0);
    for fault in 1..=2 {
        rig.board.run_for(Time::from_ms(100));
        assert_eq!(rig.board.hclk(), on_crystal(72_000_000), "fault {fault}");
        rig.board.set_crystal(false);
        rig.board.run_for(Time::from_ms(1));
        rig.board.set_crystal(true);
        rig.board.run_for(Time::from_ms(200));
        assert_eq!(rig.board.resets(), fault);
    }
    assert_eq!(rig.board.hclk(), on_hsi(60_000_000));
    for _ in 0..10 {
        rig.board.set_crystal(false);
        rig.board.run_for(Time::from_ms(100));
        rig.board.set_crystal(true);
        rig.board.run_for(Time::from_ms(100));
    }
    assert_eq!(rig.board.resets(), 2);
    // Output 1 goes off at each fault and on at the next start, and does not change again.
    let levels = rig.board.pin_edges('A', 0).iter().map(|edge| edge.1);
    assert_eq!(levels.collect::<Vec<_>>(), [false, true, false, true]);
    rig.board.line().take_received();
    assert_rate(&mut rig);
    assert!(rig.status(INTERNAL));
    assert_eq!((rig.register(0x0260), rig.register(0x0261)), (CRYSTAL, 2));
    let log = rig.board.take_log();
    assert!(log.contains("crystal failed twice"), "{log}");
    // A reset by software keeps the count of faults, a power-on clears it.
    rig.restart();
    assert_eq!(rig.board.hclk(), on_hsi(60_000_000));
    assert!(rig.status(INTERNAL));
    rig.power_cycle();
    assert_eq!(rig.board.hclk(), on_crystal(72_000_000));
    assert!(!rig.status(INTERNAL));
}
