//! Tests of what units run before an update.

use register_map::board::{MODIO_02, MODIO_08};
use register_map::update::Slot;

use super::*;
use crate::update::file::tests::{of_blocks, signed_of_blocks};

/// Numbers of the loader's keys.
const KEYS: [u32; 2] = [0x0101_FFFF, 0x0202_EEEE];

/// Returns a unit that runs another version from slot A.
fn found() -> Found {
    let mut words = vec![0; 24];
    (words[4], words[8]) = (1, 0x0002);
    Found {
        address: 7,
        board: Some(&MODIO_02),
        status: Status::of(&words).unwrap(),
        trial: false,
        unsaved: false,
        development: false,
        time: Duration::ZERO,
    }
}

#[test]
fn a_unit_begins_where_an_interrupted_update_has_stopped() {
    let file = of_blocks(20);
    let [a, b] = [Slot::A, Slot::B].map(|slot| file.image(slot).words);
    let at = |found: &Found, force| {
        let unit = found.unit(&file, force).unwrap();
        (unit.target, unit.stage)
    };
    let mut unit = found();
    assert_eq!(at(&unit, false), (Slot::B, Stage::Waiting));
    unit.status.state = Some(State::Receiving);
    unit.status.images[1] = b;
    unit.status.crcs[1] = file.image(Slot::B).crc;
    assert_eq!(at(&unit, false), (Slot::B, Stage::Receiving));
    unit.status.pages = 9;
    assert_eq!(at(&unit, false), (Slot::B, Stage::Waiting));
    unit.status.pages = 0;
    unit.status.images[1][1] += 1;
    assert_eq!(at(&unit, false), (Slot::B, Stage::Waiting), "another image");
    unit.status.state = Some(State::New);
    assert_eq!(at(&unit, false), (Slot::B, Stage::Restarting));
    (unit.status.images[0], unit.status.crcs[0]) = (a, file.image(Slot::A).crc);
    assert_eq!(at(&unit, false), (Slot::A, Stage::Done));
    unit.status.state = Some(State::Confirmed);
    assert_eq!(at(&unit, true), (Slot::B, Stage::Waiting));
    unit.trial = true;
    assert_eq!(at(&unit, true), (Slot::A, Stage::OnTrial));
}

#[test]
fn a_unit_that_would_refuse_the_file_is_refused_first() {
    let file = of_blocks(20);
    let refused = |found: &Found| found.unit(&file, false).unwrap_err();
    let mut unit = found();
    unit.board = Some(&MODIO_08);
    assert_eq!(
        refused(&unit),
        "is a modio-08, and the file is for the modio-02"
    );
    unit.board = None;
    assert!(refused(&unit).contains("a newer board"));
    unit = found();
    unit.status.floor = 1;
    assert!(refused(&unit).contains("security epoch 1 or higher, and the file has 0"));
    unit = found();
    unit.trial = true;
    assert!(refused(&unit).contains("runs 0.2.0 (00000000) on trial"));
}

/// Returns a unit with these keys in its loader, which may run the image of this file from slot A.
fn with_keys(running: Option<&File>) -> Found {
    let mut unit = found();
    unit.status.keys = KEYS;
    if let Some(file) = running {
        let image = file.image(Slot::A);
        (unit.status.images[0], unit.status.crcs[0]) = (image.words, image.crc);
    }
    unit
}

#[test]
fn two_images_are_the_same_by_epoch_and_crc_where_the_unit_reports_it() {
    let file = of_blocks(20);
    let stage = |unit: &Found| unit.unit(&file, false).unwrap().stage;
    let mut unit = with_keys(Some(&file));
    assert_eq!(stage(&unit), Stage::Done);
    // The same image of another commit.
    unit.status.images[0][3] += 1;
    assert_eq!(stage(&unit), Stage::Done);
    unit.status.images[0] = file.image(Slot::A).words;
    unit.status.crcs[0] = 0;
    assert_eq!(stage(&unit), Stage::Waiting, "the words, without a CRC-32");
    // Another image of the same commit.
    unit = with_keys(Some(&file));
    unit.status.crcs[0] ^= 1;
    assert_eq!(stage(&unit), Stage::Waiting);
    unit.trial = true;
    assert!(unit.unit(&file, false).unwrap_err().contains("on trial"));
    unit = with_keys(Some(&file));
    unit.status.images[0][2] += 1;
    assert_eq!(stage(&unit), Stage::Waiting, "another epoch");
    // Blocks of another image of the same commit.
    unit = found();
    unit.status.state = Some(State::Receiving);
    unit.status.images[1] = file.image(Slot::B).words;
    unit.status.crcs[1] = file.image(Slot::B).crc;
    assert_eq!(stage(&unit), Stage::Receiving);
    for crc in [0, file.image(Slot::B).crc ^ 1] {
        unit.status.crcs[1] = crc;
        assert_eq!(stage(&unit), Stage::Waiting);
    }
}

#[test]
fn a_slot_without_a_block_is_not_reported_as_complete() {
    let mut unit = found();
    unit.status.state = Some(State::Receiving);
    assert_eq!(unit.other(), "receiving, no block has arrived yet");
    unit.status.pages = 9;
    assert_eq!(unit.other(), "receiving, 9 pages still to erase");
    (unit.status.pages, unit.status.blocks) = (0, 419);
    assert_eq!(unit.other(), "receiving, 0 of 419 blocks missing");
}

#[test]
fn only_a_unit_that_will_restart_loses_settings_that_are_not_saved() {
    let mut unit = found();
    assert!(!unit.loses_settings(Stage::Waiting));
    unit.unsaved = true;
    let stages = [
        Stage::Waiting,
        Stage::Receiving,
        Stage::OnTrial,
        Stage::Done,
    ];
    let loses = stages.map(|stage| unit.loses_settings(stage));
    assert_eq!(loses, [true, true, false, false]);
}

#[test]
fn the_image_that_a_unit_runs_is_sent_again_by_the_second_key_to_end_the_first() {
    let [first, second] = KEYS.map(|key| signed_of_blocks(20, key));
    let mut unit = with_keys(Some(&first));
    let stage = |unit: &Found, file| unit.unit(file, false).unwrap().stage;
    assert_eq!(stage(&unit, &first), Stage::Done);
    assert_eq!(stage(&unit, &second), Stage::Waiting);
    unit.trial = true;
    assert_eq!(stage(&unit, &first), Stage::OnTrial);
    assert!(unit.unit(&second, false).unwrap_err().contains("on trial"));
    unit = with_keys(Some(&second));
    unit.status.revoked = true;
    assert_eq!(
        [&first, &second].map(|file| stage(&unit, file)),
        [Stage::Done; 2]
    );
}

#[test]
fn the_first_key_is_ended_by_a_file_of_the_second_alone() {
    let [first, second, third] = [KEYS[0], KEYS[1], 3].map(|key| signed_of_blocks(20, key));
    let mut unit = with_keys(None);
    assert_eq!(unit.ends_first_key(&first, false), Ok(false));
    assert_eq!(unit.ends_first_key(&second, false), Ok(true));
    assert_eq!(unit.ends_first_key(&second, true), Ok(true));
    let refused = |unit: &Found, file, wanted| unit.ends_first_key(file, wanted).unwrap_err();
    assert!(refused(&unit, &first, true).starts_with("keeps its first key, 0101ffff: "));
    for wanted in [false, true] {
        let text = refused(&unit, &third, wanted);
        assert_eq!(
            text,
            "takes only files by the keys 0101ffff and 0202eeee, and the file is signed with 00000003"
        );
    }
    let unsigned = of_blocks(20);
    let text = refused(&unit, &unsigned, false);
    assert!(text.ends_with(", and the file is not signed"), "{text}");
    unit.status.revoked = true;
    assert_eq!(
        unit.ends_first_key(&second, true),
        Ok(false),
        "it has ended"
    );
    for wanted in [false, true] {
        let text = refused(&unit, &first, wanted);
        assert!(text.starts_with("takes no file by its first key, which is revoked: "));
    }
    // A unit that does not report its keys.
    unit = found();
    assert_eq!(unit.ends_first_key(&second, false), Ok(false));
    assert!(refused(&unit, &second, true).starts_with("does not report the keys"));
}

#[test]
fn no_way_leads_back_to_an_image_by_a_revoked_key() {
    let mut unit = with_keys(None);
    unit.status.state = Some(State::Confirmed);
    unit.status.images[1][6..].copy_from_slice(&[0x0101, 0xFFFF]);
    assert_eq!(unit.back().unwrap().target, Slot::B);
    unit.status.revoked = true;
    assert_eq!(
        unit.back().unwrap_err(),
        "cannot go back: 0.0.0 (00000000) is signed with the first key of the unit, which is revoked"
    );
    unit.status.images[1][6..].copy_from_slice(&[0x0202, 0xEEEE]);
    assert_eq!(unit.back().unwrap().target, Slot::B);
}

#[test]
fn the_way_back_needs_a_confirmed_image_that_is_not_below_the_floor() {
    let mut unit = found();
    assert!(
        unit.back()
            .unwrap_err()
            .ends_with("its other slot is empty")
    );
    unit.status.state = Some(State::Rejected(Reason::NotConfirmed));
    assert!(unit.back().unwrap_err().contains("never confirmed"));
    unit.status.state = Some(State::Confirmed);
    assert_eq!(unit.back().unwrap().target, Slot::B);
    unit.status.floor = 1;
    assert!(unit.back().unwrap_err().contains("below security epoch 1"));
    unit.trial = true;
    assert!(unit.back().unwrap_err().contains("on trial"));
}
