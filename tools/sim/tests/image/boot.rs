//! Start-up.

use register_map::layout::HEADER;
use register_map::part::FLASH_BASE;
use sim::{Config, Module, Time};

use crate::LAYOUT;
use crate::rig::{FIRST, PORT, Rig, START, config, corner, on_crystal, symbol};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn log_reports_module_line_settings_reset_cause_and_unit_address() {
    let mut rig = Rig::new(Module::Do4, 17);
    let log = rig.board.take_log();
    let slot = format!("slot {PORT}: 4do");
    for line in [
        "modio ",
        "9600 8N2",
        "reset: power-on",
        "unit address 17",
        &slot,
    ] {
        assert!(log.contains(line), "{line:?} in:\n{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_reports_the_commit_that_it_was_built_from() {
    let commit = register_map::commit!().get(..8).unwrap_or_default();
    // Outside a repository the commit is not known.
    let commit = u32::from_str_radix(commit, 16).unwrap_or_default();
    let mut rig = Rig::new(Module::Do4, 1);
    let words = [0x020C, 0x020D].map(|address| u32::from(rig.register(address)));
    assert_eq!(words, [commit >> 16, commit & 0xFFFF]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_answers_within_170_milliseconds_of_power_on() {
    let mut rig = Rig::cold(config(Module::Di4, &[]));
    // The request takes 9 ms, and t3.5 4 ms.
    rig.board.run_for(Time::from_ms(156));
    rig.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_a_crystal_the_unit_logs_it_and_runs_on_the_internal_oscillator() {
    let mut config = config(Module::Di4, &[]);
    config.chip.crystal = false;
    let mut rig = Rig::with(config);
    rig.board.run_for(Time::from_ms(500));
    rig.assert_answers(1);
    let log = rig.board.take_log();
    assert!(log.contains("crystal did not start"), "{log}");
    rig.board.watch_pin('B', 9);
    rig.board.run_for(Time::from_secs(4));
    assert_eq!(
        rig.board.pin_edges('B', 9).len(),
        4,
        "a flash every two seconds"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_run_led_blinks_and_the_watchdog_does_not_reset() {
    let mut rig = Rig::new(Module::Di4, 1);
    rig.board.watch_pin('C', 13);
    rig.board.run_for(Time::from_secs(10));
    let edges = rig.board.pin_edges('C', 13).len();
    assert!((19..=21).contains(&edges), "{edges} edges in ten seconds");
    assert_eq!(rig.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_request_lights_the_activity_led() {
    let mut rig = Rig::new(Module::Di4, 1);
    rig.board.run_for(Time::from_ms(200));
    assert!(!rig.board.leds().activity);
    // A request to another unit does not light the LED.
    rig.ask(2, &[1, 0, FIRST, 0, 4]);
    assert!(!rig.board.leds().activity);
    rig.assert_answers(1);
    assert!(rig.board.leds().activity);
    rig.board.run_for(Time::from_ms(200));
    assert!(!rig.board.leds().activity);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn identify_makes_all_leds_blink_and_then_ends() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.command(6);
    rig.board.run_for(Time::from_ms(200));
    let all_lit = (0..20).filter(|_| {
        rig.board.run_for(Time::from_ms(50));
        let leds = rig.board.leds();
        leds.activity && leds.fault && leds.run
    });
    let all_lit = all_lit.count();
    assert!((8..=12).contains(&all_lit), "{all_lit} of 20 times 50 ms");
    rig.board.run_for(Time::from_secs(10));
    assert!(!rig.board.leds().fault);
}

/// Code that leaves the crystal and the PLL running, as another loader may, and branches to the application: HSE on, the
/// PLL at HSE x4, then a branch to the address in the last word.
fn boot_loader(entry: u32) -> Vec<u8> {
    let code: [u16; 18] = [
        0x4808, // ldr r0, RCC
        0x4909, // ldr r1, HSEON
        0x6001, // str r1, [r0]
        0x6802, 0x0392, 0xD5FC, // ldr r2, [r0]; lsls r2, #14; bpl: until HSERDY
        0x4907, // ldr r1, CFGR
        0x6041, // str r1, [r0, #4]
        0x4907, // ldr r1, PLLON
        0x6001, // str r1, [r0]
        0x6802, 0x0192, 0xD5FC, // until PLLRDY
        0x4B06, // ldr r3, entry
        0x4718, // bx r3
        0xBF00, 0xBF00, 0xBF00,
    ];
    let words = [
        0x4002_1000,
        0x0001_0083,
        0x0009_0000,
        0x0101_0083,
        entry | 1,
    ];
    let code = code.iter().flat_map(|half| half.to_le_bytes());
    let words = words.iter().flat_map(|word: &u32| word.to_le_bytes());
    code.chain(words).collect()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_entered_with_the_pll_running_waits_until_the_pll_has_stopped() {
    const LOADER: u32 = 0x2000_4800;
    let mut rig = Rig::cold(config(Module::Di4, &[]));
    let entry = symbol("Reset") & !1;
    assert!(rig.board.run_until_pc(entry, START));
    rig.board.write_memory(LOADER, &boot_loader(entry)).unwrap();
    rig.board.set_register(15, LOADER).unwrap();
    rig.board.run_for(START);
    assert_eq!(rig.board.hclk(), on_crystal(72_000_000));
    rig.assert_answers(1);
}

/// Returns the real duration of a watchdog time given for an LSI of 40 kHz.
fn lsi_ms(milliseconds: u64) -> Time {
    Time::cycles(40 * milliseconds, corner().oscillators().lsi)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn start_that_hangs_is_reset_by_the_watchdog() {
    let cold = || Rig::cold(config(Module::Di4, &[]));
    // When the clock changes, the crystal has just started. Before that the stack has been painted and the watchdog has
    // its settings.
    let mut rehearsal = cold();
    let first_clock = rehearsal.board.hclk();
    while rehearsal.board.hclk() == first_clock {
        rehearsal.board.run_for(Time::from_us(50));
    }
    let mut rig = cold();
    rig.tolerant = true;
    rig.board
        .run_until(rehearsal.board.now() - Time::from_us(300));
    let (hung, from) = (rig.board.pc(), rig.board.now());
    let at = (hung - 0x0800_0000) as usize;
    let was = rig.board.flash()[at..at + 2].to_vec();
    rig.board.patch_code(hung, &[0xFE, 0xE7]).unwrap();
    while rig.board.resets() == 0 {
        rig.board.run_for(Time::from_ms(1));
        let hangs = rig.board.now() - from;
        assert!(hangs < lsi_ms(2_100), "the watchdog did not reset the unit");
    }
    assert!(rig.board.now() - from > lsi_ms(1_800));
    rig.board.patch_code(hung, &was).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), 1);
    assert_eq!(
        rig.register(0x0207) & 4,
        4,
        "the reset cause is the watchdog"
    );
}

/// At some corners the flags of the update event that loads the prescaler are late.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn second_beat_is_a_millisecond_after_the_first() {
    const TIM4: usize = 16 + 30;
    let mut rig = Rig::cold(Config::default());
    let board = &mut rig.board;
    let vectors = (LAYOUT.board.layout().slots[0] + HEADER - FLASH_BASE) as usize;
    let vector = board.flash()[vectors + 4 * TIM4..].first_chunk();
    let handler = u32::from_le_bytes(*vector.expect("a vector"));
    let mut beat = || {
        let limit = board.now() + START;
        assert!(board.run_until_pc(handler, limit), "no beat");
        let at = board.now();
        board.step(1);
        at
    };
    let (first, second) = (beat(), beat());
    let off = (second - first).as_us().abs_diff(1_000);
    assert!(off < 5, "{off} us");
}
