//! Which writes each line may make.

use super::*;
use register_map::board::Fx3u24;

const OVER_THE_AIR: Origin = Origin {
    line: LineName::Second,
    broadcast: false,
    by_serial: false,
};
const OVER_THE_CABLE: Origin = Origin {
    line: LineName::Rs485,
    broadcast: false,
    by_serial: false,
};

fn broadcast(line: LineName) -> Origin {
    Origin {
        line,
        broadcast: true,
        by_serial: false,
    }
}

/// Returns whether KEY and the status report an open lock; both must agree.
fn is_open(config: &mut Config, origin: Origin) -> bool {
    config.set_origin(origin);
    let key = read(config, KEY, 1).unwrap() == [1];
    assert_eq!(config.status() & status::UNLOCKED != 0, key);
    key
}

#[test]
fn the_lock_belongs_to_the_line_that_wrote_key_last() {
    let mut config = unlocked(&[]);
    assert!(is_open(&mut config, OVER_THE_CABLE) && !is_open(&mut config, OVER_THE_AIR));
    assert_eq!(write(&mut config, BETA, &[2000]), LOCKED, "over the air");
    assert_eq!(write(&mut config, COMMAND, &[1]), LOCKED);
    // The other line takes the lock.
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert!(is_open(&mut config, OVER_THE_AIR) && !is_open(&mut config, OVER_THE_CABLE));
    assert_eq!(write(&mut config, BETA, &[2000]), LOCKED, "over the cable");
    config.set_origin(OVER_THE_AIR);
    assert_eq!(write(&mut config, BETA, &[2000]), DONE);
    config.tick(60_000);
    assert!(!is_open(&mut config, OVER_THE_AIR));
}

#[test]
fn a_broadcast_over_the_air_writes_nothing_and_one_over_the_cable_does() {
    for (line, expected) in [(LineName::Rs485, DONE), (LineName::Second, LOCKED)] {
        let mut config = config(&[(LORA, 1)]);
        config.set_origin(broadcast(line));
        assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), expected);
        config.set_origin(Origin {
            line,
            broadcast: false,
            by_serial: false,
        });
        assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
        config.set_origin(broadcast(line));
        assert_eq!(write(&mut config, BETA, &[2000]), expected);
        assert_eq!(write(&mut config, LORA, &[0]), expected);
        assert_eq!(write(&mut config, COMMAND, &[5]).is_ok(), expected == DONE);
        assert_eq!(
            write(&mut config, BETA, &[1]),
            VALUE,
            "the value comes first"
        );
    }
}

#[test]
fn a_broadcast_over_rs232_writes_as_one_over_the_cable_does() {
    let (settings, _) = Settings::load([].into_iter());
    let mut config = super::super::Config::<Fx3u24>::new(settings, false);
    config.set_origin(broadcast(LineName::Second));
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, BETA, &[2000]), DONE);
    config.set_origin(OVER_THE_CABLE);
    assert_eq!(write(&mut config, BETA, &[2000]), LOCKED);
}

#[test]
fn heartbeat_is_a_write_without_effect_over_every_line_and_with_any_lock() {
    for lora in [0, 1, 2] {
        let mut config = config(&[(LORA, lora)]);
        for (opened, origin) in [LineName::Rs485, LineName::Second]
            .into_iter()
            .flat_map(|line| [false, true].map(|opened| (opened, line)))
        {
            config.set_origin(OVER_THE_CABLE);
            if opened {
                assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
            }
            config.tick(30_000);
            let (before, revision) = (all(&config), config.revision());
            for broadcast in [false, true] {
                config.set_origin(Origin {
                    line: origin,
                    broadcast,
                    by_serial: false,
                });
                for value in [0, 1, 0xFFFF] {
                    assert_eq!(write(&mut config, HEARTBEAT, &[value]), DONE);
                }
                assert_eq!(read(&config, HEARTBEAT, 1), Ok(std::vec![0]));
            }
            assert_eq!((all(&config), config.revision()), (before, revision));
            assert_eq!(status(&config), 0, "there is nothing to save");
            assert_eq!(is_open(&mut config, OVER_THE_CABLE), opened);
            config.tick(30_000);
            assert!(!is_open(&mut config, OVER_THE_CABLE), "not kept open");
        }
    }
}

#[test]
fn heartbeat_with_another_register_needs_the_lock_and_is_not_saved() {
    let mut config = config(&[]);
    assert_eq!(write(&mut config, SERIAL_LOW, &[7, 1]), LOCKED);
    assert_eq!(write(&mut config, SERIAL_LOW, &[7, 1, 1]), ADDRESS);
    assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
    assert_eq!(write(&mut config, SERIAL_LOW, &[7, 1]), DONE);
    assert_eq!(read(&config, SERIAL_LOW, 2), Ok(std::vec![7, 0]));
    assert!(config.to_save().changed_from(KEY).next().is_none());
    save(&mut config);
    let saved: Vec<_> = config.to_save().changed_from(KEY).collect();
    assert_eq!(saved, [(SERIAL_LOW, 7)]);
}

#[test]
fn air_for_points_and_reads_only_opens_no_lock_and_takes_no_command() {
    let mut config = config(&[(LORA, 2)]);
    assert!(config.air_serves_points_only());
    for _ in 0..2 {
        config.set_origin(OVER_THE_AIR);
        assert_eq!(config.check_line(), Err(Exception::ServerDeviceBusy));
        assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), LOCKED);
        assert_eq!(write(&mut config, COMMAND, &[6]), LOCKED);
        assert_eq!(write(&mut config, BETA, &[2000]), LOCKED);
        assert_eq!(read(&config, KEY, 2), Ok(std::vec![0, 96]));
        config.set_origin(OVER_THE_CABLE);
        assert_eq!(config.check_line(), Ok(()));
        assert_eq!(write(&mut config, KEY, &[OPENING_KEY]), DONE);
        // A new value of LORA takes effect after the next start only.
        assert_eq!(write(&mut config, LORA, &[1]), DONE);
    }
    assert_eq!(write(&mut config, LORA, &[3]), VALUE);
}
