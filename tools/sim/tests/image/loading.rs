//! The loader, with signed images in its slots: which one it starts at the first power-on, and what it refuses.

use register_map::state::RESET_CAUSE;
use register_map::state::reset_cause::{PIN, POWER_ON, SOFTWARE};
use sim::Time;

use crate::{
    LAYOUT,
    in_slots::{
        APPLICATION, CHECK, CRC, HASH, KEY, LENGTH, SIGNATURE, START, answers, image, runs_from,
        unit, with_crc,
    },
};

const RAM: u32 = 0x2000_0000;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_first_genuine_image_starts_and_the_next_start_checks_no_signature() {
    let (a, b) = (image(0), image(1));
    for (slots, starts) in [
        ([&a[..], &[]], 0),
        ([&[], &b[..]], 1),
        ([&a[..], &b[..]], 0),
    ] {
        let mut rig = unit(slots, &[]);
        answers(&mut rig, CHECK + START).expect("it starts");
        assert_eq!(runs_from(&mut rig), starts);
        assert_eq!(rig.board.resets(), 1, "the loader's, after the check");
        assert_eq!(rig.register(RESET_CAUSE), POWER_ON | PIN | SOFTWARE);
        rig.board.cycle();
        let operations = rig.board.flash_operations();
        answers(&mut rig, START).expect("it starts again");
        assert_eq!(rig.board.resets(), 0);
        assert_eq!(runs_from(&mut rig), starts);
        assert_eq!(rig.board.flash_operations(), operations);
        assert_eq!(rig.register(RESET_CAUSE), POWER_ON | PIN);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_application_starts_within_100_ms_of_the_reset() {
    let (a, b) = (image(0), image(1));
    let mut rig = unit([&a, &b], &[]);
    answers(&mut rig, CHECK + START).expect("it starts");
    let [slot, _] = LAYOUT.board.layout().slots;
    rig.board.cycle();
    let from = rig.board.now();
    while !(slot..RAM).contains(&rig.board.pc()) {
        rig.board.run_for(Time::from_us(100));
    }
    let took = rig.board.now() - from;
    println!("the loader takes {took:?}");
    assert!(took < Time::from_ms(100), "{took:?}");
}

/// Returns the image for slot A with these bytes, and the CRC-32 that belongs to them.
fn changed(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut image = image(0);
    image[at..at + bytes.len()].copy_from_slice(bytes);
    with_crc(&mut image);
    image
}

/// The loader's own tests sign images for another board, slot or epoch.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_with_anything_wrong_is_not_started() {
    let a = image(0);
    let last = a.len() - 1;
    let length = |length: u32| changed(LENGTH, &length.to_le_bytes());
    let whole = (a.len() - APPLICATION) as u32;
    let mut crc = a.clone();
    crc[CRC] ^= 1;
    for (what, wrong) in [
        ("magic", changed(0, b"MODJ")),
        ("version of the header", changed(4, &[3])),
        ("length 0", length(0)),
        ("longest length", length(0xFFFF_FFFC)),
        ("longer", length(whole + 4)),
        ("shorter", length(whole - 4)),
        ("odd length", length(whole - 1)),
        ("CRC", crc),
        ("commit", changed(24, &[a[24] ^ 1])),
        ("hash", changed(HASH, &[a[HASH] ^ 1])),
        ("signature", changed(SIGNATURE, &[a[SIGNATURE] ^ 1])),
        ("key", changed(KEY, &[a[KEY] ^ 1])),
        ("zero area", changed(511, &[1])),
        ("code", changed(last, &[a[last] ^ 0x80])),
        ("cut short", a[..last].to_vec()),
        ("image for slot B", image(1)),
    ] {
        let mut rig = unit([&wrong, &[]], &[]);
        while !rig.board.leds().fault {
            rig.board.run_for(Time::from_ms(20));
            assert!(rig.board.now() < CHECK, "{what}");
        }
        assert!(rig.board.pc() < LAYOUT.board.layout().slots[0], "{what}");
        assert_eq!(rig.board.resets(), 0, "{what}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_an_image_the_leds_say_so_and_nothing_is_driven() {
    // After the check of a signature the clocks are again those after a reset.
    let forged = changed(SIGNATURE, &[image(0)[SIGNATURE] ^ 1]);
    let mut rig = unit([&forged, &[]], &[]);
    rig.board.run_for(CHECK);
    let mut blinks = 0;
    let mut lit = rig.board.leds().run;
    for _ in 0..1000 {
        rig.board.run_for(Time::from_ms(10));
        let leds = rig.board.leds();
        assert!(leds.fault && !leds.activity, "{leds:?}");
        blinks += u32::from(leds.run != lit);
        lit = leds.run;
        assert!(!rig.board.driver_enable());
    }
    // On or off ten times a second for 10 s, by the internal oscillator.
    assert!((90..110).contains(&blinks), "{blinks}");
    assert_eq!(rig.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn power_cut_in_a_flash_operation_of_the_first_start_does_no_harm() {
    let (a, b) = (image(0), image(1));
    // The erase of a page, half-words of the record, the first of its CRC-32, and both seals. The tests of the loader's
    // journal cut every operation.
    for (n, operation) in [1, 2, 5, 8, 10, 11].into_iter().enumerate() {
        let mut rig = unit([&a, &b], &[]);
        let fraction = [0.0, 0.5, 0.75, 1.0][n % 4];
        rig.board.cut_in_flash_operation(operation, fraction);
        rig.board.run_for(CHECK);
        assert!(!rig.board.powered(), "{operation}");
        rig.board.run_for(Time::from_ms(100));
        rig.board.power_on();
        let what = format!("operation {operation}, {fraction} of it");
        answers(&mut rig, CHECK + START).expect(&what);
        rig.board.cycle();
        answers(&mut rig, START).expect(&what);
        assert_eq!(runs_from(&mut rig), 0);
    }
}
