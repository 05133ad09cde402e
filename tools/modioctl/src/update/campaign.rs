//! The plan of an update: what to send next, and what the answers mean.
//!
//! The units that take one image take part together. What is next follows from how far they are: a unit that has
//! restarted is prepared again and gets all blocks, while the others wait. Blocks are broadcast, then each unit is asked
//! what it is missing, and the union of that is broadcast again. So a round costs the blocks that are missing anywhere, and
//! one request for each unit.

mod answers;

use std::collections::VecDeque;
use std::time::Duration;

use register_map::codes::Command;
use register_map::update::BLOCK_BYTES;

use super::messages;
use super::{Stage, Unit};

/// Number of times that the first block is broadcast: without it a unit takes none of the others.
const FIRST_TIMES: usize = 3;
/// Time in which a unit programs a block. Two are staged, so blocks are sent no faster than this on average.
const PROGRAMMING: Duration = Duration::from_millis(5);
/// First pause between blocks, in addition to the silence between frames.
const PAUSE: Duration = Duration::from_micros(250);
/// What the pause grows by each time that a unit misses many blocks. Adapters, gateways and busy computers may join
/// blocks that follow each other closely.
const SLOWER: Duration = Duration::from_millis(1);
/// The longest pause.
const SLOWEST: Duration = Duration::from_millis(40);
/// Blocks after which a unit is asked how many have arrived, if it was missing most of them.
const FIRST_BLOCKS: usize = 32;
/// Time until both staged blocks are programmed, and a unit reports what it is missing.
const STAGED: Duration = Duration::from_millis(10);
/// Time in which a unit erases a page, once its watchdog allows it.
const ERASING: Duration = Duration::from_millis(130);
/// Time between two questions to units that restart or confirm.
const POLL: Duration = Duration::from_millis(500);
/// Number of missing blocks up to which a unit is first asked whether any is still missing.
const FEW: usize = 16;

/// How long to wait for an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Not longer than units usually need, and without a repetition: the plan goes on, and asks again later.
    Little,
    /// The time-out and the repetitions of the line.
    Usual,
}

/// What to do next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Send a request to a unit, and pass its answer to [`Campaign::take_answer`].
    Ask {
        /// Address of the unit.
        unit: u8,
        /// The request.
        pdu: Vec<u8>,
        /// How long to wait.
        patience: Patience,
    },
    /// Send a block to all units. It has no answer.
    Broadcast {
        /// The request.
        pdu: Vec<u8>,
        /// Least time from the beginning of one block to that of the next.
        apart: Duration,
        /// How long the line must be idle before it, in addition to the silence between frames.
        pause: Duration,
    },
    /// Send this to all units, and pass received bytes to [`Campaign::take_answer`]. Usually nothing answers.
    Probe(Vec<u8>),
    /// Leave the line idle for this time.
    Wait(Duration),
}

/// A step with its purpose. A unit is given by its index, a block by its number.
#[derive(Clone, Copy, Debug)]
enum Action {
    Wait(Duration),
    Probe,
    Broadcast(usize),
    /// Send a block to a unit.
    Block(usize, usize),
    /// Open the lock, then give the order.
    Unlock(usize, Command),
    Order(usize, Command),
    /// Read file 2 up to the descriptions of both images.
    Status(usize),
    /// Read how many blocks are missing, after this number of blocks that the unit was missing.
    Early(usize, usize),
    /// Read how many blocks are missing.
    Short(usize),
    /// Read which blocks are missing.
    Bits(usize),
    /// Read version and commit.
    Identity(usize),
    /// Read whether the image is confirmed.
    Confirmed(usize),
}

impl Action {
    /// Returns the index of the unit that is asked.
    const fn unit(self) -> Option<usize> {
        match self {
            Self::Wait(_) | Self::Probe | Self::Broadcast(_) => None,
            Self::Block(unit, _)
            | Self::Unlock(unit, _)
            | Self::Order(unit, _)
            | Self::Status(unit)
            | Self::Early(unit, _)
            | Self::Short(unit)
            | Self::Bits(unit)
            | Self::Identity(unit)
            | Self::Confirmed(unit) => Some(unit),
        }
    }

    const fn is_block(self) -> bool {
        matches!(self, Self::Broadcast(_) | Self::Block(..))
    }
}

/// The plan for the units that take one image.
#[derive(Clone, Debug)]
pub struct Campaign {
    blocks: Vec<[u8; BLOCK_BYTES]>,
    units: Vec<Unit>,
    queue: VecDeque<Action>,
    pending: Option<Action>,
    unicast: bool,
    /// Nothing has answered a broadcast.
    is_probed: bool,
    /// The header was sent, so what units report of their blocks is about this image.
    is_begun: bool,
    /// Pause between blocks.
    pause: Duration,
    sent: usize,
}

impl Campaign {
    /// Returns the plan to bring an image to these units, each alone with `unicast`. To start what the units have, there
    /// are no blocks.
    #[must_use]
    pub fn new(blocks: &[[u8; BLOCK_BYTES]], units: Vec<Unit>, unicast: bool) -> Self {
        Self {
            blocks: blocks.to_vec(),
            units,
            queue: VecDeque::new(),
            pending: None,
            unicast,
            is_probed: false,
            is_begun: blocks.is_empty(),
            pause: PAUSE,
            sent: 0,
        }
    }

    /// Returns the units.
    #[must_use]
    pub fn units(&self) -> &[Unit] {
        &self.units
    }

    /// Returns the number of blocks that were sent, and of those that are still to be sent in this round.
    #[must_use]
    pub fn blocks(&self) -> (usize, usize) {
        let planned = self.queue.iter().filter(|action| action.is_block());
        (self.sent, planned.count())
    }

    /// Returns whether each unit gets the blocks alone.
    #[must_use]
    pub const fn is_unicast(&self) -> bool {
        self.unicast
    }

    /// Returns what to do next, or `None` at the end. Call [`Self::take_answer`] after each step.
    pub fn next_step(&mut self) -> Option<Step> {
        while self.queue.is_empty() {
            self.plan()?;
        }
        let action = self.queue.pop_front()?;
        self.pending = Some(action);
        self.sent += usize::from(action.is_block());
        let block = |block: usize| {
            let bytes = self.blocks.get(block).unwrap_or(&[0xFF; BLOCK_BYTES]);
            let slot = self.units.first().map(|unit| unit.target);
            slot.map(|slot| messages::write_block(slot, block as u16, bytes))
        };
        let pdu = match action {
            Action::Wait(time) => return Some(Step::Wait(time)),
            Action::Probe => return Some(Step::Probe(messages::harmless())),
            Action::Broadcast(number) => {
                return Some(Step::Broadcast {
                    pdu: block(number)?,
                    apart: PROGRAMMING,
                    pause: self.pause,
                });
            }
            Action::Block(_, number) => block(number)?,
            Action::Unlock(..) => messages::unlock(),
            Action::Order(_, command) => messages::order(command.code()),
            Action::Status(_) => messages::read_status(),
            Action::Early(..) | Action::Short(_) => messages::read_short(),
            Action::Bits(_) => messages::read_bits(self.blocks.len()),
            Action::Identity(_) => messages::read_identity(),
            Action::Confirmed(_) => messages::read_register(),
        };
        let unit = self.units.get(action.unit()?)?;
        let patience = match (unit.stage, action) {
            // A gateway that has stored blocks delivers the question late.
            (_, Action::Early(..)) => Patience::Usual,
            (Stage::Receiving, _) if !self.unicast && !unit.is_silent() => Patience::Little,
            (Stage::Restarting, _) => Patience::Little,
            _ => Patience::Usual,
        };
        let unit = unit.address;
        Some(Step::Ask {
            unit,
            pdu,
            patience,
        })
    }

    /// Fills the queue. Units that run the image come first, because an image on trial must be confirmed in time.
    /// Returns `None` at the end.
    fn plan(&mut self) -> Option<()> {
        if !self.units.iter().any(Unit::is_active) {
            self.units.iter_mut().for_each(Unit::look_again);
        }
        let stages = self.units.iter().map(|unit| unit.stage);
        let is_at = |stage| stages.clone().any(|other| other == stage);
        if is_at(Stage::OnTrial) {
            self.each(Stage::OnTrial, Action::Identity);
        } else if is_at(Stage::Confirming) {
            self.queue.push_back(Action::Wait(POLL));
            self.each(Stage::Confirming, Action::Confirmed);
        } else if is_at(Stage::Restarting) {
            self.queue.push_back(Action::Wait(POLL));
            self.each(Stage::Restarting, Action::Status);
        } else if is_at(Stage::Waiting) {
            self.each(Stage::Waiting, |unit| {
                Action::Unlock(unit, Command::Prepare)
            });
        } else if is_at(Stage::Erasing) {
            if !self.unicast && !self.is_probed {
                self.probe();
            }
            self.queue.push_back(Action::Wait(4 * ERASING));
            self.each(Stage::Erasing, Action::Status);
        } else if is_at(Stage::Receiving) {
            self.transfer();
        } else {
            return None;
        }
        Some(())
    }

    /// Queues an action for each unit at a stage.
    fn each(&mut self, stage: Stage, action: impl Fn(usize) -> Action) {
        let units = self.units.iter().enumerate();
        let at = units.filter(|(_, unit)| unit.stage == stage);
        self.queue.extend(at.map(|(index, _)| action(index)));
    }

    fn probe(&mut self) {
        self.is_probed = true;
        self.queue.extend([Action::Probe; 2]);
    }

    /// Plans for units that take blocks: ask what they are missing, send that, and order them to start what is whole.
    fn transfer(&mut self) {
        let receiving = || {
            let units = self.units.iter().enumerate();
            units.filter(|(_, unit)| unit.stage == Stage::Receiving)
        };
        let unknown = receiving().filter(|(_, unit)| !unit.is_known);
        let ask = |(index, unit): (usize, &Unit)| match unit.lacks() {
            1..=FEW => Action::Short(index),
            _ => Action::Bits(index),
        };
        let unknown: Vec<_> = unknown.map(ask).collect();
        if !unknown.is_empty() {
            self.queue.push_back(Action::Wait(STAGED));
            self.queue.extend(unknown);
            return;
        }
        let is_missing =
            |block: &usize| receiving().any(|(_, unit)| unit.missing.get(*block) == Some(&true));
        let mut union: Vec<_> = (0..self.blocks.len()).filter(is_missing).collect();
        if !self.is_begun && union.first() != Some(&0) {
            union.insert(0, 0);
        }
        if union.is_empty() {
            let orders = receiving().map(|(index, unit)| Action::Unlock(index, unit.starts));
            let orders: Vec<_> = orders.collect();
            self.queue.extend(orders);
            return;
        }
        if self.unicast {
            let first = !self.is_begun;
            let needs = |unit: &Unit, block: usize| {
                (first && block == 0) || unit.missing.get(block) == Some(&true)
            };
            let blocks = receiving().flat_map(|(index, unit)| {
                let own = union.iter().filter(move |block| needs(unit, **block));
                own.map(move |block| Action::Block(index, *block))
            });
            let blocks: Vec<_> = blocks.collect();
            self.queue.extend(blocks);
        } else if self.is_probed {
            // How many of the first blocks one of the units is missing.
            let early = union.get(..FIRST_BLOCKS).unwrap_or_default();
            let counted = receiving().map(|(index, unit)| {
                let missing = early
                    .iter()
                    .filter(|block| unit.missing.get(**block) == Some(&true));
                (missing.count(), index)
            });
            let check = counted.max().filter(|(count, _)| 2 * count > FIRST_BLOCKS);
            if let [0, ..] = union[..] {
                self.queue.extend([Action::Broadcast(0); FIRST_TIMES - 1]);
            }
            for (n, block) in union.into_iter().enumerate() {
                if let Some((count, unit)) = check.filter(|_| n == FIRST_BLOCKS) {
                    let check = [Action::Wait(STAGED), Action::Early(unit, count)];
                    self.queue.extend(check);
                }
                self.queue.push_back(Action::Broadcast(block));
            }
        } else {
            return self.probe();
        }
        self.is_begun = true;
        // A unit that is missing none is not asked again. The CRC-32 of its image follows anyway.
        for unit in &mut self.units {
            unit.is_known &= unit.lacks() == 0;
        }
    }
}
