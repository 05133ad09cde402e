//! A unit during an update.

use register_map::codes::Command;
use register_map::update::{Reason, Slot, State};

use super::{Fault, Status};

/// Number of requests in a row without an answer after which a unit is given up. Two of them are sent with little
/// patience, the others repeated as often as the line says.
const SILENCES: u8 = 4;
/// Number of polls while a unit erases, 500 ms and more apart: ten times as long as it needs, and more than twice as long
/// as a clone of the part.
const ERASE_POLLS: u8 = 150;
/// Number of polls after a restart, half a second and more apart, until the image must run.
const RESTART_POLLS: u8 = 60;
/// Number of such polls that show the state before an order, after which the order is given again: its answer may have
/// been that of a frame that was lost.
const UNCHANGED_POLLS: u8 = 8;
/// Number of polls until a unit that was given up because it was silent must answer: a restart with the check of an image
/// takes less.
const RETURN_POLLS: u8 = 12;
/// Number of times that an order is given to a unit.
const ORDERS: u8 = 4;
/// Number of times that a unit which is busy is sent a block.
const BUSY: u8 = 20;
/// Number of polls after the order to keep the image, after which the order is given again.
const CONFIRM_POLLS: u8 = 4;
/// Number of rounds in a row that bring a unit no block.
const ROUNDS: u8 = 10;

/// How far a unit is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// It needs the order to prepare.
    Waiting,
    /// It erases the slot that does not run.
    Erasing,
    /// It takes blocks.
    Receiving,
    /// It has the order to start the image, and restarts.
    Restarting,
    /// It runs the image, on trial.
    OnTrial,
    /// It has the order to keep the image.
    Confirming,
    /// It runs the image for good.
    Done,
    /// It takes no further part.
    Failed(Fault),
}

/// A unit during an update.
#[derive(Clone, Debug)]
pub struct Unit {
    /// Its address.
    pub address: u8,
    /// The slot for the image.
    pub target: Slot,
    /// How far it is.
    pub stage: Stage,
    /// The image that it is to run, as file 2 reports it.
    pub(super) image: [u16; 8],
    /// The CRC-32 of this image; 0 if it is not known.
    crc: u32,
    /// The order that starts the image: [`Command::Finish`] or [`Command::GoBack`].
    pub(super) starts: Command,
    /// For each block whether it is missing.
    pub(super) missing: Vec<bool>,
    /// Whether `missing` is what the unit has reported since the last block.
    pub(super) is_known: bool,
    /// The least number of missing blocks that it has reported since it was prepared.
    reported: usize,
    /// Whether it was prepared before this program started, perhaps over another line.
    was_prepared: bool,
    /// The order to start the image was given again after its check was interrupted.
    was_interrupted: bool,
    /// It was given up because it was silent, and was looked for once more.
    was_silent: bool,
    /// It has not answered since then.
    is_sought: bool,
    /// It has the order to start the image, so what its other slot holds is about this update.
    is_ordered: bool,
    silences: u8,
    orders: u8,
    confirms: u8,
    polls: u8,
    rounds: u8,
}

impl Unit {
    /// Returns a unit that is to take this image.
    #[must_use]
    pub fn new(address: u8, target: Slot, image: [u16; 8], stage: Stage) -> Self {
        Self {
            address,
            target,
            stage,
            image,
            crc: 0,
            starts: Command::Finish,
            missing: vec![true; image[5].into()],
            is_known: false,
            reported: image[5].into(),
            was_prepared: stage == Stage::Receiving,
            was_interrupted: false,
            was_silent: false,
            is_sought: false,
            is_ordered: matches!(stage, Stage::Restarting | Stage::OnTrial),
            silences: 0,
            orders: 0,
            confirms: 0,
            polls: 0,
            rounds: 0,
        }
    }

    /// Returns the unit with the CRC-32 of the image: two builds of the same commit differ in it.
    #[must_use]
    pub fn of_crc(self, crc: u32) -> Self {
        Self { crc, ..self }
    }

    /// Returns a unit that is to start the image in its other slot again.
    #[must_use]
    pub fn back(address: u8, target: Slot, image: [u16; 8]) -> Self {
        Self {
            starts: Command::GoBack,
            missing: Vec::new(),
            is_known: true,
            ..Self::new(address, target, image, Stage::Receiving)
        }
    }

    /// Returns what file 2 reports of the image that it is to run.
    #[must_use]
    pub const fn image(&self) -> &[u16; 8] {
        &self.image
    }

    /// Returns the number of blocks.
    #[must_use]
    pub const fn blocks(&self) -> usize {
        self.missing.len()
    }

    /// Returns the number of missing blocks.
    #[must_use]
    pub fn lacks(&self) -> usize {
        self.missing.iter().filter(|missing| **missing).count()
    }

    /// Returns whether the unit takes further part.
    pub(super) const fn is_active(&self) -> bool {
        !matches!(self.stage, Stage::Done | Stage::Failed(_))
    }

    /// Returns whether the last two requests had no answer.
    pub(super) const fn is_silent(&self) -> bool {
        self.silences > 1
    }

    pub(super) const fn fail(&mut self, fault: Fault) {
        self.stage = Stage::Failed(fault);
    }

    /// Notes that an order may have been carried out.
    pub(super) const fn ordered(&mut self, stage: Stage) {
        self.stage = stage;
        self.polls = 0;
        self.is_ordered |= matches!(stage, Stage::Restarting);
    }

    /// Counts an order; fails when there were too many.
    pub(super) const fn count_order(&mut self, fault: Fault) {
        self.orders += 1;
        if self.orders > ORDERS {
            self.fail(fault);
        }
    }

    /// Notes an answer.
    pub(super) const fn answered(&mut self) {
        self.silences = 0;
        self.is_sought = false;
    }

    /// Notes that a request had no answer.
    pub(super) const fn silent(&mut self) {
        self.silences = self.silences.saturating_add(1);
        if matches!(self.stage, Stage::Restarting) {
            let most = if self.is_sought {
                RETURN_POLLS
            } else {
                RESTART_POLLS
            };
            self.poll(most, Fault::Silent);
        } else if self.silences >= SILENCES {
            self.fail(Fault::Silent);
        }
    }

    /// Looks once more for a unit that was given up because it was silent. Another program may have updated it, and it was
    /// silent while it restarted.
    pub(super) fn look_again(&mut self) {
        if self.stage == Stage::Failed(Fault::Silent) && !self.was_silent {
            (self.was_silent, self.is_sought) = (true, true);
            (self.stage, self.polls) = (Stage::Restarting, 0);
        }
    }

    /// Notes that version and commit are not those of the image. File 2 shows why.
    pub(super) const fn is_another(&mut self) {
        self.count_order(Fault::OtherImage);
        if self.is_active() {
            self.ordered(Stage::Restarting);
        }
    }

    /// Counts a poll; fails when there were too many.
    pub(super) const fn poll(&mut self, most: u8, fault: Fault) {
        self.polls += 1;
        if self.polls >= most {
            self.fail(fault);
        }
    }

    /// Counts a request that the unit cannot take at this time. Returns whether to send it again.
    pub(super) const fn is_busy(&mut self) -> bool {
        self.polls += 1;
        self.polls %= BUSY;
        self.polls > 0
    }

    /// Notes that the unit has not confirmed the image yet.
    pub(super) const fn unconfirmed(&mut self) {
        self.polls += 1;
        if self.polls >= CONFIRM_POLLS {
            self.confirms += 1;
            if self.confirms < ORDERS {
                self.stage = Stage::OnTrial;
            } else {
                self.fail(Fault::NotConfirmed);
            }
        }
    }

    /// Takes the state while the unit erases.
    pub(super) fn erases(&mut self, status: &Status) {
        if status.slot == self.target {
            self.ordered(Stage::Restarting);
        } else if status.pages > 0 {
            self.poll(ERASE_POLLS, Fault::NoProgress);
        } else if status.state == Some(State::Receiving) {
            self.stage = Stage::Receiving;
            self.all_missing();
            self.is_known = true;
            self.was_prepared = false;
        } else {
            self.stage = Stage::Waiting;
        }
    }

    /// Takes the state after a round of blocks. Returns whether the bits are needed.
    pub(super) fn reports(&mut self, status: &Status) -> bool {
        let all = usize::from(status.blocks) == self.missing.len();
        if status.slot == self.target {
            // Another program has updated it. The order to prepare would erase its way back.
            self.ordered(Stage::Restarting);
        } else if status.state != Some(State::Receiving) {
            // It has restarted, and begins again.
            self.stage = Stage::Waiting;
        } else if all && status.missing > 0 {
            return true;
        } else if let (false, Some(reason)) = (all, refused(status.reason)) {
            self.reject(reason);
        } else {
            self.is_missing(|_| !all);
        }
        false
    }

    /// Takes the bits after a round of blocks. Returns false if none is set: the unit has all blocks, or no header.
    pub(super) fn lists(&mut self, bits: &[u16]) -> bool {
        let is_set = |n: usize| {
            bits.get(n / 16)
                .is_some_and(|word| word >> (n % 16) & 1 == 1)
        };
        let any = (0..self.missing.len()).any(is_set);
        if any {
            self.is_missing(is_set);
        }
        any
    }

    fn all_missing(&mut self) {
        self.missing.fill(true);
        self.reported = self.missing.len();
    }

    /// Notes the missing blocks, and whether there are fewer than in any report before.
    fn is_missing(&mut self, block: impl Fn(usize) -> bool) {
        let blocks = self.missing.iter_mut().enumerate();
        blocks.for_each(|(n, missing)| *missing = block(n));
        self.is_known = true;
        let lacks = self.lacks();
        if lacks < self.reported {
            self.reported = lacks;
            self.rounds = 0;
        } else if std::mem::take(&mut self.was_prepared) {
            // Perhaps for another line, whose blocks alone it takes.
            self.stage = Stage::Waiting;
        } else {
            self.rounds += 1;
            if self.rounds >= ROUNDS {
                self.fail(Fault::NoProgress);
            }
        }
    }

    fn reject(&mut self, reason: Reason) {
        let has_aged = self.starts == Command::GoBack && reason == Reason::Crc;
        self.fail(match has_aged {
            true => Fault::Aged,
            false => Fault::Rejected(reason),
        });
    }

    /// Takes the state after the order to start the image.
    pub(super) fn restarts(&mut self, status: &Status) {
        let ([runs, _], [crc, _]) = (&status.images, status.crcs);
        if status.slot == self.target {
            let is_another_build = ![self.crc, crc].contains(&0) && self.crc != crc;
            if *runs == self.image && !is_another_build {
                self.ordered(Stage::OnTrial);
            } else {
                self.fail(Fault::OtherImage);
            }
            return;
        }
        if !self.is_ordered {
            // It was away while it took blocks. What its other slot holds may be from before.
            self.ordered(Stage::Receiving);
            self.is_known = false;
            return;
        }
        self.poll(RESTART_POLLS, Fault::NotStarted);
        let goes_back = self.starts == Command::GoBack;
        if let (Some(State::Confirmed), Some(reason)) = (status.state, refused(status.reason)) {
            // The unit took the order to go back, and refused the image then.
            return self.reject(reason);
        }
        match status.state {
            // The order is being carried out.
            Some(State::New | State::Checking | State::Trial(_)) => {}
            Some(State::Rejected(Reason::Interrupted)) if !goes_back && !self.was_interrupted => {
                self.was_interrupted = true;
                self.again(Fault::NotStarted);
            }
            Some(State::Rejected(reason)) => self.reject(reason),
            // The CRC-32 is wrong, and all blocks count as missing.
            Some(State::Receiving) if status.missing > 0 => {
                self.again(Fault::Rejected(Reason::Crc));
                self.all_missing();
                self.is_known = false;
            }
            // It has restarted without the order, which lost what it had received.
            Some(State::Empty) if !goes_back => {
                self.again(Fault::Restarts);
                if self.is_active() {
                    self.stage = Stage::Waiting;
                }
            }
            Some(State::Receiving | State::Confirmed) if self.polls >= UNCHANGED_POLLS => {
                self.again(Fault::NotStarted);
            }
            Some(State::Receiving | State::Confirmed) => {}
            Some(State::Empty) => self.fail(Fault::NotStarted),
            None => self.fail(Fault::Strange),
        }
    }

    /// Gives the order to start the image once more.
    const fn again(&mut self, fault: Fault) {
        self.count_order(fault);
        if self.is_active() {
            self.stage = Stage::Receiving;
        }
    }
}

/// Returns why a unit has refused an image; `None` if it has not.
fn refused(reason: u16) -> Option<Reason> {
    match State::from_code(6, u8::try_from(reason).ok()?)? {
        State::Rejected(reason) => Some(reason),
        _ => None,
    }
}
