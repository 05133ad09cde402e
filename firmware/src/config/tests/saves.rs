//! The budget of saves.

use super::*;

/// Uses up the budget with saves that write something.
fn without_saves() -> Config {
    let mut config = unlocked(&[]);
    for n in 0..20 {
        assert_eq!(write(&mut config, BETA, &[2000 + n]), DONE);
        save(&mut config);
        assert!(config.take_save().is_some());
    }
    assert_eq!(config.saves_left(), 0);
    config
}

#[test]
fn a_save_without_budget_is_refused_unless_it_would_write_nothing() {
    let mut config = without_saves();
    save(&mut config);
    assert_eq!(write(&mut config, BETA, &[3000]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    assert_eq!(
        write(&mut config, COMMAND, &[2]),
        Ok(Some(Command::Restart))
    );
    assert_eq!(write(&mut config, BETA, &[2019]), DONE);
    save(&mut config);
    // Defaults are only saved by a save.
    assert_eq!(
        write(&mut config, COMMAND, &[3]),
        Ok(Some(Command::LoadDefaults))
    );
    config.load_defaults();
    config.compare();
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    config.tick(59_999);
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    config.tick(1);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), Ok(Some(Command::Save)));
}

#[test]
fn a_save_in_a_request_with_settings_counts_what_they_change() {
    let mut config = without_saves();
    // COMM_TIMEOUT to COMMAND.
    let unchanged = [0, 0, 0, 0, 1];
    let changed = [9, 0, 0, 0, 1];
    assert_eq!(write(&mut config, COMM_TIMEOUT, &changed), LOCKED);
    assert_eq!(read(&config, COMM_TIMEOUT, 1), Ok(std::vec![0]));
    let saved = Ok(Some(Command::Save));
    assert_eq!(write(&mut config, COMM_TIMEOUT, &unchanged), saved);
    config.begin_save();
    config.end_save(false);
    // The request takes an unsaved change back.
    assert_eq!(write(&mut config, COMM_TIMEOUT, &[9]), DONE);
    assert_eq!(write(&mut config, COMM_TIMEOUT, &unchanged), saved);
    config.begin_save();
    config.end_save(false);
    // KEY is not a setting.
    let all = [&[OPENING_KEY, 96, 0, 0][..], &unchanged].concat();
    assert_eq!(write(&mut config, KEY, &all), saved);
}

#[test]
fn a_save_after_an_invalid_store_needs_the_budget_until_it_is_complete() {
    let mut config = Config::new(Settings::defaults(), true);
    config.set_saves_left(0);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    config.set_saves_left(1);
    assert!(config.take_save().is_some());
    config.end_save(false);
    save(&mut config);
}

#[test]
fn after_a_save_that_failed_the_flash_decides_whether_a_save_needs_the_budget() {
    for (before, after) in [(false, true), (true, false)] {
        let mut config = Config::new(Settings::defaults(), before);
        assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
        assert_eq!(write(&mut config, COMMAND, &[1]), Ok(Some(Command::Save)));
        config.begin_save();
        config.set_saves_left(0);
        config.save_failed(Settings::defaults(), after);
        let wanted = if after {
            LOCKED
        } else {
            Ok(Some(Command::Save))
        };
        assert_eq!(write(&mut config, COMMAND, &[1]), wanted);
    }
}

#[test]
fn budget_begins_full_or_with_the_saves_that_were_kept() {
    let mut config = config(&[]);
    assert_eq!(config.saves_left(), 20);
    config.set_saves_left(3);
    assert_eq!(config.saves_left(), 3);
    let left = [(); 4].map(|()| config.take_save());
    assert_eq!(left, [Some(2), Some(1), Some(0), None]);
}
