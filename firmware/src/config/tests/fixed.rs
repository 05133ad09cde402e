//! Boards whose inputs and outputs are fixed, without a switch and a radio.

use super::*;
use register_map::board::{ETH_IO5R, EthIo5r, Fx3u14, Fx3u24};
use register_map::points::Kind;

/// A configuration of a board with its lock open.
pub(super) fn on<B: Board>(stored: &[(u16, u16)]) -> super::super::Config<B> {
    let (settings, rejected) = Settings::load(stored.iter().copied());
    assert_eq!(rejected, 0);
    let mut config = super::super::Config::new(settings, false);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    config
}

#[test]
fn modules_are_those_of_the_board_and_cannot_be_written() {
    let mut config = on::<Fx3u14>(&[]);
    assert_eq!(read(&config, MODULE, 8).unwrap(), [1, 1, 2, 2, 4, 4, 5, 0]);
    for port in 1..=8 {
        let own = read(&config, module_of(port), 1).unwrap();
        assert_eq!(write(&mut config, module_of(port), &own), ADDRESS, "{port}");
    }
    assert_eq!(write(&mut config, SERIAL_LOW, &[7]), DONE);
    assert_eq!(
        config.modules(),
        &[1, 1, 2, 2, 4, 4, 5].map(|code| Module::from_code(code).unwrap())
    );
}

#[test]
fn last_port_of_the_fx3u_24_is_of_one_kind_or_the_other() {
    let mut config = on::<Fx3u24>(&[]);
    assert_eq!(read(&config, MODULE, 8).unwrap(), [1, 1, 1, 1, 2, 2, 2, 4]);
    for (code, result) in [(0, VALUE), (5, VALUE), (1, VALUE), (6, DONE)] {
        assert_eq!(write(&mut config, module_of(8), &[code]), result, "{code}");
    }
    assert_eq!(write(&mut config, module_of(7), &[2, 6]), ADDRESS);
    // The fourth analog input measures a current, the second analog output sets a voltage.
    assert_eq!(read(&config, RANGE + 28, 4).unwrap(), [0; 4]);
    assert_eq!(write(&mut config, module_of(8), &[4]), DONE);
    assert_eq!(read(&config, RANGE + 28, 4).unwrap(), [0, 0, 0, 1]);
    let stored = on::<Fx3u24>(&[(module_of(8), 6)]);
    assert_eq!(stored.modules()[7], Module::Ai2Ao2);
}

#[test]
fn ranges_of_analog_points_are_those_of_the_board() {
    let mut config = on::<Fx3u14>(&[]);
    let own = [0, 0, 0, 1, 1, 1, 0, 0, 0, 0];
    assert_eq!(read(&config, RANGE + 16, 10).unwrap(), own);
    assert_eq!(write(&mut config, RANGE + 16, &own), DONE);
    for (n, range) in own.iter().enumerate() {
        for other in (0..3).filter(|other| other != range) {
            assert_eq!(
                write(&mut config, RANGE + 16 + n as u16, &[other]),
                VALUE,
                "{n}"
            );
        }
    }
    config.load_defaults();
    assert_eq!(read(&config, RANGE + 16, 10).unwrap(), own);
    let pairs = [(RANGE + 19, 0), (module_of(5), 5)];
    let (settings, rejected) = Settings::<Fx3u14>::load(pairs.into_iter());
    assert_eq!((settings, rejected), (Settings::defaults(), 2));
}

#[test]
fn missing_channels_of_a_port_are_no_points() {
    let settings = Settings::<EthIo5r>::defaults();
    let kinds: Vec<_> = ETH_IO5R
        .points()
        .map(|point| settings.kind(point))
        .collect();
    let (input, output, none) = (Kind::BitInput, Kind::BitOutput, Kind::None);
    assert_eq!(
        kinds[4..],
        [
            input, input, none, none, output, output, output, output, output, none, none, none
        ]
    );
}

#[test]
fn unit_exists_without_a_switch_and_lora_with_a_radio() {
    let mut config = on::<EthIo5r>(&[]);
    assert_eq!(read(&config, UNIT, 2).unwrap(), [1, 0]);
    assert_eq!(write(&mut config, UNIT, &[0]), VALUE);
    assert_eq!(write(&mut config, UNIT, &[248]), VALUE);
    assert_eq!(write(&mut config, UNIT, &[247]), DONE);
    assert_eq!(read(&config, COMM_SOURCE, 3).unwrap(), [0, 247, 0]);
    for address in LORA..=LORA_FRAME_GAP {
        assert_eq!(write(&mut config, address, &[1]), ADDRESS);
    }
    assert_eq!(
        read(&config, FILTER + 30, 3),
        Err(Exception::IllegalDataAddress)
    );
    let mut slots = on::<Modio02>(&[]);
    assert_eq!(write(&mut slots, UNIT, &[5]), ADDRESS);
    assert_eq!(
        read(&slots, COMM_SOURCE, 3),
        Err(Exception::IllegalDataAddress)
    );
}

#[test]
fn heartbeat_in_a_request_with_a_save_is_no_change_that_costs_one() {
    let mut config = on::<EthIo5r>(&[]);
    config.set_saves_left(0);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    // COMMAND to HEARTBEAT.
    let saved = write(&mut config, COMMAND, &[1, 0, 1, 0, 9]);
    assert_eq!(saved, Ok(Some(Command::Save)));
}

#[test]
fn address_is_written_by_serial_number_and_stored_alone() {
    let mut config = on::<EthIo5r>(&[]);
    assert_eq!(
        config.check_unit(Some(5)),
        Err(Exception::IllegalDataAddress),
        "to the unit address"
    );
    config.set_origin(Origin {
        by_serial: true,
        ..Origin::default()
    });
    for wrong in [0, 248, 0x0101] {
        assert_eq!(
            config.check_unit(Some(wrong)),
            Err(Exception::IllegalDataValue)
        );
    }
    assert_eq!(write(&mut config, FILTER, &[9]), DONE);
    assert_eq!(config.check_unit(Some(5)), Ok(()));
    config.set_unit(5);
    config.compare();
    assert!(config.is_saving() && config.check_unit(Some(6)) == Err(Exception::ServerDeviceBusy));
    let stored: Vec<_> = config.to_save().changed_from(UNIT).take(1).collect();
    assert_eq!(stored, [(UNIT, 5)]);
    assert_eq!(
        config.to_save().get(FILTER),
        5,
        "another setting is not stored with it"
    );
    assert_eq!(config.take_save(), Some(SAVES - 1));
    let changed = config.to_save().needs_restart(&config.started());
    config.end_save(changed);
    assert_eq!(read(&config, UNIT, 1).unwrap(), [5]);
    assert_eq!(
        config.status() & (status::RESTART_NEEDED | status::UNSAVED),
        status::UNSAVED
    );

    config.set_saves_left(0);
    assert_eq!(config.check_unit(Some(6)), Err(Exception::ServerDeviceBusy));
    assert_eq!(config.check_unit(Some(5)), Ok(()), "nothing to store");
}

#[test]
fn address_in_force_by_serial_number_needs_no_restart_although_it_was_saved_before() {
    let mut config = on::<EthIo5r>(&[]);
    assert_eq!(write(&mut config, UNIT, &[5]), DONE);
    config.compare();
    config.begin_save();
    let changed = config.to_save().needs_restart(&config.started());
    config.end_save(changed);
    assert_ne!(config.status() & status::RESTART_NEEDED, 0);
    config.set_origin(Origin {
        by_serial: true,
        ..Origin::default()
    });
    assert_eq!(config.check_unit(Some(5)), Ok(()));
    config.set_unit(5);
    config.compare();
    assert!(!config.is_saving());
    assert_eq!(config.status() & status::RESTART_NEEDED, 0);
}
