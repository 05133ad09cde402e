//! The configuration as a master reads and writes it.

extern crate std;

mod fixed;
mod module;
mod origin;
mod ranges;
mod saves;

use std::vec::Vec;

use super::*;
use register_map::Module;
use register_map::board::{Modio02, Modio08};
use register_map::codes::{Format, Scale, Signal};
use register_map::configuration::*;
use register_map::points;

const ADDRESS: Result<Option<Command>, Exception> = Err(Exception::IllegalDataAddress);
const VALUE: Result<Option<Command>, Exception> = Err(Exception::IllegalDataValue);
const LOCKED: Result<Option<Command>, Exception> = Err(Exception::ServerDeviceBusy);
const DONE: Result<Option<Command>, Exception> = Ok(None);

/// The configuration on the board with one slot, port 5.
type Config = super::Config<Modio02>;

const SLOT: u16 = points::first(5);
const MODULE_SLOT: u16 = module_of(5);

/// Writes like the server: only when the check accepts the request.
fn write<B: Board>(
    config: &mut super::Config<B>,
    start: u16,
    values: &[u16],
) -> Result<Option<Command>, Exception> {
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_be_bytes())
        .collect();
    let span = Span::new(start, values.len() as u16).unwrap();
    config.check_write(span, Words::new(&bytes))?;
    let command = config.write(span, Words::new(&bytes));
    config.compare();
    Ok(command)
}

fn read<B: Board>(
    config: &super::Config<B>,
    start: u16,
    count: u16,
) -> Result<Vec<u16>, Exception> {
    let span = Span::new(start, count).unwrap();
    config.check_read(span)?;
    let mut bytes = std::vec![0xEE; usize::from(count) * 2];
    config.read(span, &mut WordsOut::new(&mut bytes));
    Ok(Words::new(&bytes).iter().collect())
}

fn all(config: &Config) -> Vec<u16> {
    let runs = [
        (0x101, 7),
        (0x109, 1),
        (0x110, 8),
        (0x120, 38),
        (0x160, 96),
        (0x1C0, 64),
    ];
    let read = |(start, count)| read(config, start, count).unwrap();
    runs.into_iter().flat_map(read).collect()
}

fn config(pairs: &[(u16, u16)]) -> Config {
    let (settings, rejected) = Settings::load(pairs.iter().copied());
    assert_eq!(rejected, 0);
    Config::new(settings, false)
}

fn unlocked(pairs: &[(u16, u16)]) -> Config {
    let mut config = config(pairs);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    config
}

fn status(config: &Config) -> u16 {
    config.status() & !status::UNLOCKED
}

fn save(config: &mut Config) {
    assert_eq!(write(config, COMMAND, &[1]), Ok(Some(Command::Save)));
    config.begin_save();
    let changed = config.to_save().needs_restart(&config.started());
    config.end_save(changed);
}

#[test]
fn every_setting_reads_its_default_and_key_and_command_read_0() {
    let config = config(&[]);
    let first = read(&config, KEY, 10).unwrap();
    assert_eq!(first, [0, 96, 0, 0, 0, 0, 0, 0, 0, 0]);
    let mut middle = std::vec![5; 32];
    middle.extend([0, 0, 23, 2, 0, 300]);
    assert_eq!(read(&config, FILTER, 38).unwrap(), middle);
    assert_eq!(read(&config, BETA, 32).unwrap(), [3950; 32]);
    assert_eq!(read(&config, RANGE, 125).unwrap(), [0; 125]);
}

#[test]
fn gaps_cannot_be_read_or_written() {
    let mut config = unlocked(&[]);
    for (start, count) in [
        (0x0109, 2),
        (0x010A, 1),
        (0x010F, 2),
        (0x0117, 2),
        (0x011F, 2),
        (0x0145, 2),
        (0x0146, 1),
        (0x015F, 1),
        (0x01FF, 2),
        (0x00FF, 2),
        (0x0110, 17),
    ] {
        assert_eq!(
            read(&config, start, count),
            Err(Exception::IllegalDataAddress)
        );
        let values = std::vec![0; usize::from(count)];
        assert_eq!(
            write(&mut config, start, &values),
            ADDRESS,
            "{start:#06x}+{count}"
        );
    }
}

#[test]
fn a_gap_is_reported_before_a_bad_value_and_that_before_the_lock() {
    let mut config = config(&[]);
    assert_eq!(write(&mut config, COMM_SOURCE, &[99, 99]), ADDRESS);
    assert_eq!(write(&mut config, BAUD, &[97]), VALUE);
    assert_eq!(write(&mut config, BAUD, &[96]), LOCKED);
    assert_eq!(write(&mut config, COMMAND, &[5]), LOCKED);
    assert_eq!(write(&mut config, COMMAND, &[6]), LOCKED);
    assert_eq!(write(&mut config, COMMAND, &[7]), VALUE);
    assert_eq!(write(&mut config, KEY, &[0]), VALUE);
    assert_eq!(read(&config, KEY, 1).unwrap(), [0]);
}

#[test]
fn the_lock_stays_open_for_sixty_seconds_after_the_last_write() {
    let mut config = unlocked(&[]);
    assert_eq!(read(&config, KEY, 2).unwrap(), [1, 96]);
    assert_eq!(config.status(), status::UNLOCKED);
    config.tick(59_999);
    assert_eq!(write(&mut config, BAUD, &[192]), DONE);
    config.tick(59_999);
    assert_eq!(
        write(&mut config, BAUD, &[1]),
        VALUE,
        "a rejected write does not keep the lock open"
    );
    assert_eq!(read(&config, KEY, 1).unwrap(), [1]);
    config.tick(1);
    assert_eq!(read(&config, KEY, 1).unwrap(), [0]);
    assert_eq!(write(&mut config, BAUD, &[96]), LOCKED);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, BAUD, &[96]), DONE);
}

#[test]
fn key_does_not_unlock_settings_in_its_own_request() {
    let mut config = config(&[]);
    let values = [OPENING_KEY, 1152, 1];
    assert_eq!(write(&mut config, KEY, &values), LOCKED);
    assert_eq!(
        read(&config, KEY, 3).unwrap(),
        [0, 96, 0],
        "nothing was written"
    );
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, KEY, &values), DONE);
    assert_eq!(write(&mut config, KEY, &[0, 192, 1]), VALUE);
    assert_eq!(read(&config, KEY, 3).unwrap(), [1, 1152, 1]);
}

#[test]
fn one_bad_value_rejects_the_whole_write() {
    let mut config = unlocked(&[(MODULE_SLOT, 2)]);
    let before = all(&config);
    let good: Vec<u16> = [[2000; 32], [1; 32], [1; 32]].concat();
    for bad in 0..good.len() {
        let mut values = good.clone();
        values[bad] = 6000;
        assert_eq!(write(&mut config, BETA, &values), VALUE, "{bad}");
    }
    let mut bits = [1; 32];
    bits[17] = 2;
    assert_eq!(write(&mut config, SAFE, &bits), VALUE, "point 17 is a bit");
    assert_eq!(all(&config), before);
    assert_eq!(write(&mut config, BETA, &good), DONE);
    assert_eq!(read(&config, BETA, 96).unwrap(), good);
}

#[test]
fn format_with_seven_data_bits_is_refused_in_rtu_mode() {
    let mut config = unlocked(&[]);
    for format in 4..=6 {
        assert_eq!(write(&mut config, FORMAT, &[format]), VALUE);
        assert_eq!(write(&mut config, FORMAT, &[format, 0]), VALUE);
        assert_eq!(write(&mut config, FORMAT, &[format, 1]), DONE);
        assert_eq!(write(&mut config, MODE, &[0]), VALUE, "RTU with 7 bits");
        assert_eq!(write(&mut config, BAUD, &[96, format]), DONE);
        assert_eq!(read(&config, FORMAT, 2).unwrap(), [format, 1]);
        assert_eq!(write(&mut config, FORMAT, &[0, 0]), DONE);
    }
    assert_eq!(write(&mut config, MODE, &[1]), DONE);
    assert_eq!(write(&mut config, FORMAT, &[4]), DONE);
    assert_eq!(write(&mut config, FORMAT, &[7]), VALUE);
}

#[test]
fn settings_take_effect_immediately_or_after_the_restart() {
    let mut config = unlocked(&[(MODULE_SLOT, 6)]);
    assert_eq!(write(&mut config, BAUD, &[1152, 1, 0, 36_000, 7, 5]), DONE);
    assert_eq!(write(&mut config, RANGE + SLOT, &[1, 0, 1]), DONE);
    assert_eq!(write(&mut config, SCALE + SLOT + 1, &[1]), DONE);
    assert_eq!(write(&mut config, SAFE + SLOT + 2, &[HOLD, 7]), DONE);
    assert_eq!(write(&mut config, START + SLOT + 2, &[8]), DONE);
    assert_eq!(write(&mut config, LORA, &[1, 2, 3]), DONE);
    assert_eq!(
        (config.comm_timeout_ms(), config.response_delay_ms()),
        (Some(3_600_000), 7)
    );
    let points = [0, 1, 2, 3].map(|channel| config.point(0, channel).unwrap());
    let signals_and_scales = points
        .iter()
        .map(|point| (point.settings.signal, point.settings.scale));
    assert!(signals_and_scales.eq([
        (Signal::Current, Scale::Raw),
        (Signal::Voltage, Scale::Engineering),
        (Signal::Current, Scale::Raw),
        (Signal::Voltage, Scale::Raw),
    ]));
    assert_eq!(points[0].settings.filter, 4);
    assert_eq!((points[2].safe, points[3].safe), (None, Some(7)));

    save(&mut config);
    let restarted = Config::new(*config.to_save(), false);
    let line = LineConfig::of(&restarted.edited);
    assert_eq!(
        (line.baud, line.format, line.frame_gap),
        (115_200, Format::F8E1, Some(5))
    );
    let lora = [LORA, LORA_ADDRESS, LORA_CHANNEL].map(|address| restarted.to_save().get(address));
    assert_eq!(lora, [1, 2, 3]);
    let start = [0, 1, 2, 3].map(|channel| restarted.point(0, channel).unwrap().start);
    assert_eq!(start, [0, 0, 8, 0]);
    assert_eq!(all(&restarted), all(&config));
}

#[test]
fn unsaved_is_reported_while_settings_differ_from_the_saved_ones() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, BETA, &[2000, 3950, 2000]), DONE);
    assert_eq!(status(&config), status::UNSAVED);
    assert_eq!(write(&mut config, BETA, &[3950, 3950]), DONE);
    assert_eq!(status(&config), status::UNSAVED);
    assert_eq!(write(&mut config, BETA + 2, &[3950]), DONE);
    assert_eq!(status(&config), 0, "back to the saved value");
    assert_eq!(write(&mut config, MODULE_SLOT, &[4]), DONE);
    assert_eq!(status(&config), status::UNSAVED);
    assert_eq!(write(&mut config, MODULE_SLOT, &[0]), DONE);
    assert_eq!(status(&config), 0);
}

#[test]
fn a_saved_change_waits_for_the_restart_if_it_needs_one() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, COMM_TIMEOUT, &[5]), DONE);
    save(&mut config);
    assert_eq!(status(&config), 0, "in force immediately");
    assert_eq!(write(&mut config, START, &[5]), DONE);
    assert_eq!(status(&config), status::UNSAVED);
    save(&mut config);
    assert_eq!(status(&config), status::RESTART_NEEDED);
    assert_eq!(write(&mut config, START, &[0]), DONE);
    assert_eq!(status(&config), status::RESTART_NEEDED | status::UNSAVED);
    save(&mut config);
    assert_eq!(status(&config), 0, "as it was at the start");
}

#[test]
fn a_save_stores_the_settings_at_the_time_of_the_command() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, BETA, &[2000]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), Ok(Some(Command::Save)));
    assert_eq!(
        write(&mut config, COMMAND, &[1]),
        LOCKED,
        "one save at a time"
    );
    config.begin_save();
    assert_eq!(write(&mut config, BETA, &[3000]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    assert_eq!(
        write(&mut config, COMMAND, &[2]),
        Ok(Some(Command::Restart))
    );
    assert_eq!(config.to_save().get(BETA), 2000);
    assert!(config.is_saving());
    let changed = config.to_save().needs_restart(&config.started());
    config.end_save(changed);
    assert_eq!(status(&config), status::UNSAVED, "the later change");
    config.drop_changes();
    config.compare();
    assert_eq!((config.edited.get(BETA), status(&config)), (2000, 0));
}

#[test]
fn unsaved_is_reported_until_the_save_is_complete_and_after_a_failure() {
    let mut config = unlocked(&[]);
    assert_eq!(write(&mut config, BETA, &[2000]), DONE);
    assert_eq!(write(&mut config, COMMAND, &[1]), Ok(Some(Command::Save)));
    config.begin_save();
    assert_eq!(status(&config), status::UNSAVED);
    config.save_failed(Settings::defaults(), false);
    assert_eq!(status(&config), status::UNSAVED);
    assert_eq!(read(&config, BETA, 1).unwrap(), [2000]);
    save(&mut config);
    assert_eq!(status(&config), 0);
}

#[test]
fn loading_defaults_and_dropping_changes_act_like_writes() {
    let mut config = unlocked(&[(BAUD, 1152), (BETA, 2000)]);
    assert_eq!(
        write(&mut config, COMMAND, &[3]),
        Ok(Some(Command::LoadDefaults))
    );
    assert_eq!(
        read(&config, BAUD, 1).unwrap(),
        [1152],
        "not before the response has been sent"
    );
    let revision = config.revision();
    config.load_defaults();
    config.compare();
    assert_ne!(config.revision(), revision);
    assert_eq!(all(&config), all(&Config::new(Settings::defaults(), false)));
    assert_eq!(status(&config), status::UNSAVED);
    config.drop_changes();
    config.compare();
    assert_eq!(
        (config.edited.get(BAUD), config.edited.get(BETA)),
        (1152, 2000)
    );
    assert_eq!(status(&config), 0);
}

#[test]
fn every_command_is_returned_and_writing_it_changes_nothing() {
    let mut config = unlocked(&[(BAUD, 1152)]);
    let before = all(&config);
    for command in Command::ALL {
        assert_eq!(
            write(&mut config, COMMAND, &[command.code()]),
            Ok(Some(*command))
        );
    }
    assert_eq!(all(&config), before);
    assert_eq!(read(&config, COMMAND, 1).unwrap(), [0]);
}

#[test]
fn an_invalid_store_is_reported() {
    assert_eq!(
        Config::new(Settings::defaults(), true).status(),
        status::STORED_INVALID
    );
    assert_eq!(Config::new(Settings::defaults(), false).status(), 0);
}
