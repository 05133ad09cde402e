//! What the units of a line run before an update, and whether the file suits them.

use std::time::{Duration, Instant};

use modbus_line::adu;
use register_map::Board;
use register_map::state::{BUILD, PRODUCT, PRODUCT_CODE, UPDATE, build, update};
use register_map::update::{Reason, State, status};

use crate::device::Device;
use crate::failure::Failure;
use crate::update::file::{Version, key_of};
use crate::update::{File, Stage, Status, Unit, reason_text, state_text};
use crate::value::long;

/// A unit before the update.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its address.
    pub address: u8,
    /// Its board; `None` if it is newer than this program.
    pub board: Option<&'static Board>,
    /// File 2.
    pub status: Status,
    /// The running image is on trial.
    pub trial: bool,
    /// The loader accepts a development key.
    pub development: bool,
    /// Time of the longest answer.
    pub time: Duration,
}

/// Asks a unit.
pub async fn look(device: &mut Device, address: u8) -> Result<Found, Failure> {
    let usual = std::mem::replace(&mut device.unit, address);
    let found = ask(device).await;
    device.unit = usual;
    found
}

async fn ask(device: &mut Device) -> Result<Found, Failure> {
    let words = device.read_words(PRODUCT_CODE, 6).await;
    let words = words.or_else(|failure| match failure {
        Failure::Refused(_) => Ok(Vec::new()),
        failure => Err(failure),
    })?;
    let unit = device.unit;
    let wrong = |what: &str| Failure::Usage(format!("unit {unit} {what}"));
    let [high, low, _, _, _, board] = words[..] else {
        return Err(wrong("is not a modio"));
    };
    if long(&[high, low]) != PRODUCT {
        return Err(wrong("is not a modio"));
    }
    // Firmware without the register is older than the loader.
    let slots = match device.read_words(UPDATE, 1).await {
        Err(Failure::Refused(_)) => Vec::new(),
        slots => slots?,
    };
    let has = |words: &[u16], bits| words.iter().any(|word| word & bits != 0);
    if !has(&slots, update::SLOT) {
        return Err(wrong(
            "has no loader, so it cannot be updated over the line: use a probe once",
        ));
    }
    let asked = Instant::now();
    let mut file = device
        .read_records(status::FILE, 0, status::REVOKED + 1)
        .await;
    if matches!(file, Err(Failure::Refused(_))) {
        // Older firmware has neither the CRC-32s nor the keys.
        file = device
            .read_records(status::FILE, 0, status::OTHER.end)
            .await;
    }
    let file = file.map_err(|failure| match failure {
        Failure::Refused(text) => Failure::Refused(format!(
            "{text}; the unit has a loader, so a gateway probably does not pass function 14: an update needs functions 14 and 15"
        )),
        failure => failure,
    })?;
    let time = asked.elapsed();
    let status = Status::of(&adu::words(&file)).ok_or_else(|| {
        wrong("reports an update that this program does not understand: a newer modioctl may be needed")
    })?;
    let built = device.read_words(BUILD, 1).await?;
    Ok(Found {
        address: device.unit,
        board: Board::from_code(board),
        status,
        trial: has(&slots, update::TRIAL),
        development: has(&built, build::DEVELOPMENT_TRUSTED),
        time,
    })
}

impl Found {
    /// Returns the name of the board.
    pub fn board_name(&self) -> &'static str {
        self.board.map_or("a newer board", |board| board.name)
    }

    /// Returns the words of the running image.
    pub const fn runs(&self) -> &[u16; 8] {
        &self.status.images[0]
    }

    /// Describes the slot that does not run.
    pub fn other(&self) -> String {
        let Status { images, .. } = &self.status;
        let [_, other] = images;
        let version = Version(other);
        let Some(state) = self.status.state else {
            return "unknown state".to_owned();
        };
        let text = state_text(state);
        match state {
            State::Empty => text.to_owned(),
            State::Receiving => format!(
                "{text}, {} of {} blocks missing",
                self.status.missing, self.status.blocks
            ),
            State::Rejected(reason) => format!("{version}, {text}: {}", reason_text(reason)),
            _ => format!("{version}, {text}"),
        }
    }

    /// Returns the unit for an update with a file, or why the file does not suit it.
    pub fn unit(&self, file: &File, force: bool) -> Result<Unit, String> {
        let Status {
            slot,
            state,
            images: [runs, _],
            ..
        } = &self.status;
        if self.board != Some(file.board) {
            return Err(format!(
                "is a {}, and the file is for the {}",
                self.board_name(),
                file.board
            ));
        }
        // The words of the unit, because the commit of the same image may be another one.
        let unit = |stage| Ok(Unit::new(self.address, *slot, *runs, stage));
        let is_running = self.status.runs(file.image(*slot));
        let is_by_its_key = file.key() == key_of(runs);
        if is_running && is_by_its_key && self.trial {
            // An update was interrupted after the restart.
            return unit(Stage::OnTrial);
        }
        let is_needed = force || (self.is_by_second_key(file) && !is_by_its_key);
        if is_running && !self.trial && !is_needed {
            return unit(Stage::Done);
        }
        if self.trial {
            return Err(format!(
                "runs {} on trial: finish that update with its file, or wait half an hour until the unit has gone back",
                Version(runs)
            ));
        }
        let target = slot.other();
        let image = file.image(target);
        if image.epoch() < self.status.floor {
            return Err(format!(
                "takes only firmware with security epoch {} or higher, and the file has {}",
                self.status.floor,
                image.epoch()
            ));
        }
        let stage = match state {
            Some(State::New | State::Checking) => Stage::Restarting,
            Some(State::Receiving) if self.status.pages == 0 && self.status.has(image) => {
                Stage::Receiving
            }
            _ => Stage::Waiting,
        };
        Ok(Unit::new(self.address, target, image.words, stage))
    }

    /// Returns whether a file is signed with the second key of the unit, whose first key is not revoked yet.
    fn is_by_second_key(&self, file: &File) -> bool {
        let Status { keys, revoked, .. } = self.status;
        let [first, second] = keys;
        file.key() == second && second != first && !revoked
    }

    /// Returns whether the update with a file ends the first key of the unit, or why its loader would reject the file, or
    /// why the file does not end that key as `wanted`.
    pub fn ends_first_key(&self, file: &File, wanted: bool) -> Result<bool, String> {
        let Status { keys, revoked, .. } = self.status;
        let [first, second] = keys;
        let key = file.key();
        if keys == [0; 2] && wanted {
            Err("does not report the keys of its loader: update it with a file by its first key, then repeat this".to_owned())
        } else if keys == [0; 2] {
            Ok(false)
        } else if key == first && revoked {
            Err(format!(
                "takes no file by its first key, which is revoked: one that is signed with its second key, {second:08x}, is needed"
            ))
        } else if key == first && wanted {
            Err(format!(
                "keeps its first key, {first:08x}: the file is signed with that key, and only one by the second key, {second:08x}, ends it"
            ))
        } else if key == first || key == second {
            Ok(self.is_by_second_key(file))
        } else {
            Err(format!(
                "takes only files by the keys {first:08x} and {second:08x}, and the file is signed with {key:08x}"
            ))
        }
    }

    /// Returns the unit for the way back, or why there is none.
    pub fn back(&self) -> Result<Unit, String> {
        let Status {
            slot,
            state,
            images: [_, other],
            floor,
            keys: [first, _],
            revoked,
            ..
        } = &self.status;
        if self.trial {
            return Err(
                "runs an image on trial: unless the image is confirmed, the unit goes back automatically, after half an hour at most"
                    .to_owned(),
            );
        }
        match state {
            Some(State::Confirmed) if other[2] < *floor => Err(format!(
                "cannot go back: {} is below security epoch {floor}",
                Version(other)
            )),
            Some(State::Confirmed) if *revoked && key_of(other) == *first => Err(format!(
                "cannot go back: {} is signed with the first key of the unit, which is revoked",
                Version(other)
            )),
            Some(State::Confirmed) => Ok(Unit::back(self.address, slot.other(), *other)),
            Some(State::Rejected(Reason::NotConfirmed)) => Err(
                "has nothing to go back to: the image in the other slot was never confirmed"
                    .to_owned(),
            ),
            _ => Err(format!(
                "has nothing to go back to: its other slot is {}",
                self.other()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
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
        assert_eq!(at(&unit, false), (Slot::B, Stage::Receiving));
        unit.status.pages = 9;
        assert_eq!(at(&unit, false), (Slot::B, Stage::Waiting));
        unit.status.pages = 0;
        unit.status.images[1][1] += 1;
        assert_eq!(at(&unit, false), (Slot::B, Stage::Waiting), "another image");
        unit.status.state = Some(State::New);
        assert_eq!(at(&unit, false), (Slot::B, Stage::Restarting));
        unit.status.images[0] = a;
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
        unit.status.crcs[1] ^= 1;
        assert_eq!(stage(&unit), Stage::Waiting);
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
}
