//! The image that runs without a loader, as on a Blue Pill with an STM32F103C8.

use register_map::configuration::FILTER;
use register_map::state::{BUILD, build};
use sim::{Board, Config, Image, Module, chip};

use crate::LAYOUT;
use crate::rig::{FIRST, MODULE, Rig, SLOT, START, file};

/// Returns a board with this switch and a 4DI, with time to start.
fn started(dip: u8) -> Rig {
    let image = Image::read(&file("modio")).expect("the image can be read");
    let flash = LAYOUT.flash_with(&[(MODULE, Module::Di4.code())]);
    let config = Config {
        dip,
        chip: chip::Config::holding(flash.expect("a setting fits in the store")),
        ..Config::default()
    };
    let mut rig = Rig::of(Board::new(&image, config).expect("the image fits"));
    rig.board.run_for(START);
    rig
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_without_a_loader_serves_and_keeps_a_setting_over_a_power_cut() {
    let mut rig = started(1);
    rig.board.set_energised(2, true).expect("a 4DI");
    rig.board.run_for(START);
    assert_eq!(rig.bits(2, SLOT, 4), Ok(vec![false, true, false, false]));
    assert_ne!(rig.register(BUILD) & build::NO_LOADER, 0);
    // Nothing begins an update.
    rig.unlock();
    assert_eq!(rig.write(0x0108, &[0xB001]), Err(3));
    rig.configure(FILTER + SLOT, &[77]);
    rig.save();
    rig.power_cycle();
    assert_eq!(rig.register(FILTER + SLOT), 77);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_without_a_loader_is_silent_with_switch_254() {
    let mut rig = started(254);
    for unit in [1, 254, 255] {
        assert_eq!(rig.ask(unit, &[2, 0, FIRST, 0, 4]), None, "unit {unit}");
    }
    let log = rig.board.take_log();
    assert!(log.contains("no unit address"), "{log}");
}
