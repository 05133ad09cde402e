//! MODULE and the settings by point, which depend on the module.

use super::*;

#[test]
fn the_module_written_last_determines_the_allowed_values_of_its_points() {
    let mut config = unlocked(&[(MODULE_SLOT, 1)]);
    for (module, address, good, bad) in [
        (1, FILTER, 1000, 1001),
        (2, SAFE, HOLD, 2),
        (2, START, 1, 2),
        (3, SAFE + 2, 1, 4095),
        (4, FILTER, 8, 9),
        (4, RANGE, 2, 3),
        (5, RANGE, 1, 2),
        (5, SAFE, 4095, 4096),
        (5, START, 4095, HOLD),
        (6, FILTER, 8, 9),
        (6, FILTER + 2, 1000, 1001),
        (6, RANGE + 2, 1, 2),
        (0, SAFE, 4095, 4096),
    ] {
        assert_eq!(write(&mut config, MODULE_SLOT, &[module]), DONE);
        let address = address + SLOT;
        assert_eq!(
            write(&mut config, address, &[bad]),
            VALUE,
            "{module} {address:#06x}"
        );
        assert_eq!(
            write(&mut config, address, &[good]),
            DONE,
            "{module} {address:#06x}"
        );
        assert_eq!(read(&config, address, 1).unwrap(), [good]);
    }
    assert_eq!(config.modules()[0], Module::Di4, "until the restart");
}

#[test]
fn a_port_without_a_slot_has_no_module() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, MODULE, &[1]), VALUE);
    assert_eq!(write(&mut config, MODULE, &[0, 0, 0, 0, 1, 0, 0, 1]), VALUE);
    assert_eq!(write(&mut config, MODULE, &[0, 0, 0, 0, 6, 0, 0, 0]), DONE);
    assert_eq!(read(&config, MODULE, 8).unwrap(), [0, 0, 0, 0, 6, 0, 0, 0]);
}

#[test]
fn every_slot_of_a_board_has_its_own_module_and_settings() {
    let pairs = [
        (module_of(1), 1),
        (module_of(2), 4),
        (module_of(4), 2),
        (START + 12, 1),
    ];
    let (settings, rejected) = Settings::load(pairs.into_iter());
    assert_eq!(rejected, 0);
    let mut config = crate::config::Config::<Modio08>::new(settings, false);
    assert_eq!(
        *config.modules(),
        [Module::Di4, Module::Ai4, Module::None, Module::Do4]
    );
    assert_eq!(config.point(3, 0).unwrap().start, 1);

    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    // A write over the points of ports 1 to 4: each is checked against its own module.
    let mut values = [5; 16];
    assert_eq!(write(&mut config, FILTER, &values), DONE);
    values[3] = 1000;
    assert_eq!(write(&mut config, FILTER, &values), DONE, "a debounce");
    values[4] = 9;
    assert_eq!(write(&mut config, FILTER, &values), VALUE, "a low-pass");
    assert_eq!(write(&mut config, FILTER + 3, &[1000, 8]), DONE);
    assert_eq!(write(&mut config, FILTER + 3, &[1000, 9]), VALUE);
    assert_eq!(write(&mut config, SAFE + 12, &[2]), VALUE, "an output bit");

    assert_eq!(write(&mut config, module_of(5), &[1]), VALUE);
    assert_eq!(write(&mut config, MODULE, &[6, 5, 4, 3, 0, 0, 0, 0]), DONE);
    assert_eq!(write(&mut config, MODULE, &[6, 5, 4, 3, 0, 0, 0, 1]), VALUE);
    config.drop_changes();
    config.compare();
    assert_eq!(write(&mut config, module_of(2), &[5]), DONE);
    let left: Vec<_> = (0..4)
        .map(|index| config.point(index, 0).is_none())
        .collect();
    assert_eq!(
        left,
        [false, true, false, false],
        "only port 2 waits for the restart"
    );
}

fn filter(config: &Config) -> Option<u16> {
    config.point(0, 0).map(|point| point.settings.filter)
}

#[test]
fn settings_by_point_take_effect_together_with_their_module() {
    let mut config = unlocked(&[(MODULE_SLOT, 4), (FILTER + SLOT, 7)]);
    assert_eq!(filter(&config).unwrap(), 7);
    assert_eq!(write(&mut config, MODULE_SLOT, &[1]), DONE);
    assert_eq!(write(&mut config, FILTER + SLOT, &[1000]), DONE);
    assert_eq!(filter(&config), None);
    assert_eq!(write(&mut config, MODULE_SLOT, &[4]), DONE);
    assert_eq!(
        filter(&config),
        None,
        "edited settings are defaults now and not in force"
    );
    config.drop_changes();
    config.compare();
    assert_eq!(filter(&config).unwrap(), 7, "the saved value");
    for module in [1, 4] {
        assert_eq!(write(&mut config, MODULE_SLOT, &[module]), DONE);
    }
    save(&mut config);
    assert_eq!(filter(&config), None, "not before the restart");
    assert_eq!(status(&config), status::RESTART_NEEDED);
    assert_eq!(write(&mut config, MODULE_SLOT, &[1]), DONE);
    assert_eq!(write(&mut config, FILTER + SLOT, &[1000]), DONE);
    save(&mut config);
    assert_eq!(filter(&config), None);
    let restarted = Config::new(*config.to_save(), false);
    assert_eq!(filter(&restarted).unwrap(), 1000);
}
