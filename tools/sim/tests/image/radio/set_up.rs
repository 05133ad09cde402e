//! The set-up of the module: its settings, when they are written, and when the radio is off.

use register_map::{
    configuration::{LORA, LORA_ADDRESS, LORA_AIR_RATE, LORA_CHANNEL, LORA_POWER},
    second, state,
};
use sim::radio::{Mode, Parameters};
use sim::{Config, Module, Time};

use super::{SET_UP, rig};
use crate::rig::{FIRST, Rig, config};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn module_gets_the_stored_settings_and_requests_over_the_air_are_answered() {
    let mut rig = rig(&[
        (LORA_ADDRESS, 0x1234),
        (LORA_CHANNEL, 31),
        (LORA_AIR_RATE, 5),
        (LORA_POWER, 3),
    ]);
    let module = rig.module();
    assert_eq!(module.mode(), Some(Mode::Normal));
    assert_eq!(module.parameters().bytes(), [0x12, 0x34, 0x1D, 0x1F, 0x47]);
    assert_eq!(module.stored(), module.parameters());
    rig.board.set_energised(2, true).unwrap();
    rig.board.run_for(Time::from_ms(20));
    let reply = rig.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]);
    assert_eq!(reply, Some(vec![1, 1, 0b0010]));
    assert_eq!(
        rig.ask_over_the_air(1, &[1, 0x7F, 0, 0, 1]),
        Some(vec![0x81, 2])
    );
    assert!(rig.board.take_log().ends_with("radio: ready\n"));
    assert!(!rig.status(state::status::MODULE_FAULT));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_that_is_off_leaves_its_pins_alone() {
    let mut rig = Rig::with(Config {
        radio: Some(Parameters::FACTORY),
        ..config(Module::Di4, &[])
    });
    rig.board.run_for(SET_UP);
    // The module's own pull-ups keep it in sleep.
    assert_eq!(rig.module().mode(), Some(Mode::Sleep));
    assert_eq!(rig.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]), None);
    rig.assert_answers(1);
    assert_eq!(rig.registers(second::BUS_MESSAGES, 9), Ok(vec![0; 9]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_is_off_in_recovery_mode_and_without_a_unit_address() {
    for dip in [255, 0, 248] {
        let mut rig = Rig::with(Config {
            dip,
            radio: Some(Parameters::FACTORY),
            ..config(Module::Di4, &[(LORA, 1)])
        });
        rig.board.run_for(SET_UP);
        assert_eq!(rig.module().mode(), Some(Mode::Sleep), "DIP switch {dip}");
    }
}
