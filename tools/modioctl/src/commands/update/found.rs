//! What the units of a line run before an update, and whether the file suits them.

use std::time::{Duration, Instant};

use modbus_line::adu;
use register_map::Row;
use register_map::state::{self, BUILD, PRODUCT, PRODUCT_CODE, STATUS, UPDATE, build, update};
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
    pub board: Option<&'static Row>,
    /// File 2.
    pub status: Status,
    /// The running image is on trial.
    pub trial: bool,
    /// Settings are in force and not saved, so that a restart loses them.
    pub unsaved: bool,
    /// Register BUILD.
    pub build: u16,
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
    let file = device
        .read_records(status::FILE, 0, status::REVOKED + 1)
        .await;
    let file = file.map_err(|failure| match failure {
        Failure::Refused(text) => Failure::Refused(format!(
            "{text}; the unit has a loader, so a gateway in front of it does not pass function 14: an update needs functions 14 and 15"
        )),
        failure => failure,
    })?;
    let time = asked.elapsed();
    let status = Status::of(&adu::words(&file)).ok_or_else(|| {
        wrong("reports an update that this program does not understand: a newer modioctl may be needed")
    })?;
    let words = device.read_words(STATUS, BUILD - STATUS + 1).await?;
    let [condition, .., build] = words[..] else {
        return Err(wrong("does not report its state"));
    };
    Ok(Found {
        address: device.unit,
        board: Row::from_code(board),
        status,
        trial: has(&slots, update::TRIAL),
        unsaved: has(&[condition], state::status::UNSAVED),
        build,
        time,
    })
}

impl Found {
    /// Returns whether the loader accepts a development key.
    pub const fn development(&self) -> bool {
        self.build & build::DEVELOPMENT_TRUSTED != 0
    }

    /// Returns the name of the board.
    pub fn board_name(&self) -> &'static str {
        self.board.map_or("a newer board", |board| board.name)
    }

    /// Returns the words of the running image.
    pub const fn runs(&self) -> &[u16; 8] {
        &self.status.images[0]
    }

    /// Returns the version of the running image.
    pub const fn running(&self) -> Version<'_> {
        Version::of_running(self.runs(), self.build)
    }

    /// Describes the slot that does not run.
    pub fn other(&self) -> String {
        let Status { images, .. } = &self.status;
        let [_, other] = images;
        let version = Version::of(other);
        let Some(state) = self.status.state else {
            return "unknown state".to_owned();
        };
        let text = state_text(state);
        match state {
            State::Empty => text.to_owned(),
            State::Receiving if self.status.pages > 0 => {
                format!("{text}, {} pages still to erase", self.status.pages)
            }
            State::Receiving if self.status.blocks == 0 => {
                format!("{text}, no block has arrived yet")
            }
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
        let own = file.image(*slot);
        let unit = |stage| Ok(Unit::new(self.address, *slot, *runs, stage).of_crc(own.crc));
        // An image on trial that reports no CRC-32 can only be confirmed, so its words are enough.
        let has_no_crc = self.status.crcs == [0; 2];
        let is_running = self.status.runs(own) || (self.trial && has_no_crc && *runs == own.words);
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
                Version::of(runs)
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
        Ok(Unit::new(self.address, target, image.words, stage).of_crc(image.crc))
    }

    /// Returns whether the update of this unit restarts it while settings are in force that are not saved.
    pub const fn loses_settings(&self, stage: Stage) -> bool {
        self.unsaved && !matches!(stage, Stage::OnTrial | Stage::Done)
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
            let by = match key {
                0 => "not signed".to_owned(),
                key => format!("signed with {key:08x}"),
            };
            Err(format!(
                "takes only files by the keys {first:08x} and {second:08x}, and the file is {by}"
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
                Version::of(other)
            )),
            Some(State::Confirmed) if *revoked && key_of(other) == *first => Err(format!(
                "cannot go back: {} is signed with the first key of the unit, which is revoked",
                Version::of(other)
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
#[path = "found_tests.rs"]
mod tests;
