//! What the answers of units mean for the plan.

use register_map::codes::Command;
use register_map::update::State;

use super::{Action, Campaign, POLL, PROGRAMMING, SLOWER, SLOWEST};
use crate::update::messages;
use crate::update::{Fault, Stage, Status};

impl Campaign {
    /// Takes what followed a step: the answer of a unit, or whatever was received after a probe.
    pub fn take_answer(&mut self, answer: Option<&[u8]>) {
        let Some(action) = self.pending.take() else {
            return;
        };
        let Some(index) = action.unit() else {
            if matches!(action, Action::Probe) && answer.is_some() {
                self.send_to_each();
            }
            return;
        };
        let Some(answer) = answer else {
            return self.silent(index, action);
        };
        let Some(unit) = self.units.get_mut(index) else {
            return;
        };
        unit.answered();
        match *answer {
            [function, code] if function & 0x80 != 0 => self.refused(index, action, code),
            _ => self.answered(index, action, answer),
        }
    }

    /// Sends blocks to each unit alone from now on: something answers broadcasts, or they do not arrive.
    fn send_to_each(&mut self) {
        self.unicast = true;
        self.queue.clear();
    }

    /// Drops what is queued for a unit. What it is missing is asked for again.
    fn drop_queued(&mut self, index: usize) {
        self.queue.retain(|action| action.unit() != Some(index));
    }

    fn silent(&mut self, index: usize, action: Action) {
        let Some(unit) = self.units.get_mut(index) else {
            return;
        };
        match action {
            // The answer may be lost, and not the order. What the unit reports next shows it.
            Action::Order(_, command) => unit.ordered(after(command)),
            _ => unit.silent(),
        }
        if !unit.is_active() {
            self.drop_queued(index);
        } else if matches!(action, Action::Bits(_) | Action::Short(_)) && !unit.is_silent() {
            // Once more in this round. Otherwise its blocks cost a round of their own.
            self.queue.push_back(action);
        }
    }

    fn refused(&mut self, index: usize, action: Action, code: u8) {
        let Some(unit) = self.units.get_mut(index) else {
            return;
        };
        match (action, code) {
            // Two blocks are staged.
            (Action::Block(..), 6) if unit.is_busy() => {
                self.queue.push_front(action);
                self.queue.push_front(Action::Wait(PROGRAMMING));
                self.sent -= 1;
            }
            // A gateway that has other clients. The order to keep the image can be given twice.
            (
                Action::Unlock(..)
                | Action::Order(_, Command::Confirm)
                | Action::Status(_)
                | Action::Early(..)
                | Action::Short(_)
                | Action::Bits(_)
                | Action::Identity(_)
                | Action::Confirmed(_),
                5 | 6,
            ) if unit.is_busy() => {
                self.queue.push_front(action);
                self.queue.push_front(Action::Wait(POLL));
            }
            // What the unit reports shows why.
            (Action::Block(..), _) => self.drop_queued(index),
            // It has been carried out, or must be given again.
            (Action::Order(_, Command::Finish), 6) => {
                unit.count_order(Fault::Refused("the order to start the image", code));
                unit.is_known = false;
            }
            // It has been carried out, and this answers a repeated request; or what the unit reports shows why not.
            (Action::Order(_, Command::GoBack), 6) => {
                unit.ordered(Stage::Restarting);
                unit.count_order(Fault::Refused("the order to start the image", code));
            }
            (Action::Order(_, command), _) => {
                let what = match command {
                    Command::Prepare => "the order to prepare",
                    Command::Confirm => "the order to keep the image",
                    _ => "the order to start the image",
                };
                unit.fail(Fault::Refused(what, code));
            }
            (Action::Unlock(..), _) => unit.fail(Fault::Refused("to open the lock", code)),
            _ => unit.fail(Fault::Refused("to report the state of the update", code)),
        }
    }

    fn answered(&mut self, index: usize, action: Action, answer: &[u8]) {
        let Some(unit) = self.units.get_mut(index) else {
            return;
        };
        let words = messages::records(answer);
        match (action, Status::of(&words)) {
            (Action::Unlock(_, command), _) => {
                if command == Command::Prepare {
                    unit.count_order(Fault::Restarts);
                }
                if unit.is_active() {
                    self.queue.push_front(Action::Order(index, command));
                }
            }
            (Action::Order(_, command), _) => unit.ordered(after(command)),
            (Action::Block(_, block), _) => {
                unit.ordered(Stage::Receiving);
                if let Some(missing) = unit.missing.get_mut(block) {
                    *missing = false;
                }
            }
            (Action::Status(_), Some(status)) => match unit.stage {
                Stage::Erasing => unit.erases(&status),
                _ => unit.restarts(&status),
            },
            (Action::Early(_, sent), Some(status)) => {
                let before = unit.lacks();
                if status.state != Some(State::Receiving) {
                    unit.reports(&status);
                } else if status.blocks == 0 && status.reason == 0 {
                    self.send_to_each();
                } else if usize::from(status.missing) + sent > before + sent / 4
                    && self.pause < SLOWEST
                {
                    self.pause = (2 * self.pause + SLOWER).min(SLOWEST);
                    self.queue.clear();
                }
            }
            (Action::Short(_), Some(status)) => {
                if unit.reports(&status) {
                    self.queue.push_front(Action::Bits(index));
                }
            }
            (Action::Bits(_), _) => {
                if !unit.lists(&words) {
                    unit.poll(u8::MAX, Fault::Strange);
                    self.queue.push_front(Action::Short(index));
                }
            }
            (Action::Identity(_), _) => {
                if messages::is_identity(answer, &unit.image) {
                    self.queue
                        .push_front(Action::Unlock(index, Command::Confirm));
                } else {
                    unit.is_another();
                }
            }
            (Action::Confirmed(_), _) => {
                if messages::is_confirmed(answer, unit.target) {
                    unit.stage = Stage::Done;
                } else {
                    unit.unconfirmed();
                }
            }
            _ => unit.fail(Fault::Strange),
        }
    }
}

/// Returns how far a unit is after an order.
const fn after(command: Command) -> Stage {
    match command {
        Command::Prepare => Stage::Erasing,
        Command::Confirm => Stage::Confirming,
        _ => Stage::Restarting,
    }
}
