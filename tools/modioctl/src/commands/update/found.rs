//! What the units of a line run before an update, and whether the file suits them.

use std::time::{Duration, Instant};

use modbus_line::adu;
use register_map::Board;
use register_map::state::{PRODUCT, PRODUCT_CODE, UPDATE, update};
use register_map::update::{Reason, Slot, State, status};

use crate::device::Device;
use crate::failure::Failure;
use crate::update::file::Version;
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
    let asked = Instant::now();
    let file = match device
        .read_records(status::FILE, 0, status::OTHER.end)
        .await
    {
        Ok(file) => file,
        Err(Failure::Refused(_)) => {
            return Err(wrong(
                "has no loader, so it cannot be updated over the line: use a probe once",
            ));
        }
        Err(failure) => return Err(failure),
    };
    let time = asked.elapsed();
    let status = Status::of(&adu::words(&file)).ok_or_else(|| {
        wrong("reports an update that this program does not understand: a newer modioctl may be needed")
    })?;
    let register = device.read_words(UPDATE, 1).await?;
    Ok(Found {
        address: device.unit,
        board: Board::from_code(board),
        status,
        trial: register.iter().any(|word| word & update::TRIAL != 0),
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
            images: [runs, other],
            ..
        } = &self.status;
        if self.board != Some(file.board) {
            return Err(format!(
                "is a {}, and the file is for the {}",
                self.board_name(),
                file.board
            ));
        }
        let running = file.image(*slot).words;
        let unit = |slot: Slot, stage| Unit::new(self.address, slot, file.image(slot).words, stage);
        if *runs == running && self.trial {
            // An update was interrupted after the restart.
            return Ok(unit(*slot, Stage::OnTrial));
        }
        if *runs == running && !force {
            return Ok(unit(*slot, Stage::Done));
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
            Some(State::Receiving) if self.status.pages == 0 && *other == image.words => {
                Stage::Receiving
            }
            _ => Stage::Waiting,
        };
        Ok(unit(target, stage))
    }

    /// Returns the unit for the way back, or why there is none.
    pub fn back(&self) -> Result<Unit, String> {
        let Status {
            slot,
            state,
            images: [_, other],
            floor,
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

    use super::*;
    use crate::update::file::tests::of_blocks;

    /// Returns a unit that runs another version from slot A.
    fn found() -> Found {
        let mut words = vec![0; 24];
        (words[4], words[8]) = (1, 0x0002);
        Found {
            address: 7,
            board: Some(&MODIO_02),
            status: Status::of(&words).unwrap(),
            trial: false,
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
