//! MODULE and the settings by point, which are made for one module.

use super::*;

#[test]
fn the_module_as_written_last_says_what_its_points_take() {
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
    assert_eq!(config.slot().module, Module::Di4, "until the restart");
}

#[test]
fn a_port_without_a_slot_has_no_module() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, MODULE, &[1]), VALUE);
    assert_eq!(write(&mut config, MODULE, &[0, 0, 0, 0, 1, 0, 0, 1]), VALUE);
    assert_eq!(write(&mut config, MODULE, &[0, 0, 0, 0, 6, 0, 0, 0]), DONE);
    assert_eq!(read(&config, MODULE, 8).unwrap(), [0, 0, 0, 0, 6, 0, 0, 0]);
}

fn filter(config: &Config) -> Option<u16> {
    let mut points = config.points()?;
    points.next().map(|point| point.filter)
}

#[test]
fn settings_by_point_wait_with_the_module_they_are_made_for() {
    let mut config = unlocked(&[(MODULE_SLOT, 4), (FILTER + SLOT, 7)]);
    assert_eq!(filter(&config).unwrap(), 7);
    assert_eq!(write(&mut config, MODULE_SLOT, &[1]), DONE);
    assert_eq!(write(&mut config, FILTER + SLOT, &[1000]), DONE);
    assert_eq!(filter(&config), None);
    assert_eq!(write(&mut config, MODULE_SLOT, &[4]), DONE);
    assert_eq!(filter(&config), None, "defaults by now, which do not run");
    config.drop_changes();
    assert_eq!(filter(&config).unwrap(), 7, "as saved");
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
    let restarted = Config::new(config.to_save().clone(), false);
    assert_eq!(filter(&restarted).unwrap(), 1000);
}
