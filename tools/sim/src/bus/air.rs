//! The air of a bus: passes the packets of the boards' modules and of the gateway on to each other.

use super::Bus;
use super::plan::Plan;
use crate::board::Board;
use crate::radio::{Air, Mode, News, tell, timing};
use f103::time::Time;

impl Air {
    /// Returns the air of these boards, from `now` on; `None` if no board has a module. The modules of the boards leave
    /// the air that they had while they were alone.
    pub(super) fn of_boards(boards: &mut [Board], now: Time) -> Option<Self> {
        let mut air: Option<Self> = None;
        for (n, board) in (0..).zip(boards) {
            let Some(radio) = &mut board.circuit_mut().radio else {
                continue;
            };
            let corner = radio.module.corner;
            radio.join(n);
            let air = air.get_or_insert_with(|| Self::new(n, now, corner));
            if radio.module.mode() == Some(Mode::Normal) {
                air.take_of_board(n, &News::Tuned(now, radio.module.parameters()));
            }
        }
        air
    }

    /// Returns the next actions of the gateway, as those of a board.
    pub(super) fn plan(&self) -> Plan {
        let awake = self.next_event().unwrap_or(Time::MAX);
        Plan {
            awake,
            start: Time::MAX,
            bound: awake + timing::LOOK_AHEAD,
        }
    }
}

impl Bus {
    /// Returns the air with the gateway radio; `None` if no board has a LoRa module.
    pub fn air(&mut self) -> Option<&mut Air> {
        let now = self.now();
        match &mut *self.boards {
            [board] => board.air(),
            _ => {
                let air = self.air.as_mut()?;
                air.set_earliest(now);
                Some(air)
            }
        }
    }

    /// Passes the news of the module of board `n` on to the gateway and to the modules of the other boards.
    pub(super) fn pass_on_news(&mut self, n: usize) {
        let (Some(air), Some(radio)) = (&mut self.air, &mut self.boards[n].circuit_mut().radio)
        else {
            return;
        };
        if !radio.module.has_news() {
            return;
        }
        for news in radio.module.take_news() {
            let loss = air.take_of_board(n as u16, &news);
            for (other, board) in self.boards.iter_mut().enumerate() {
                if other != n && board.tell(&news, loss) {
                    self.plans[other] = board.plan();
                }
            }
        }
    }

    /// Computes the gateway up to `to`, and passes its news on to the boards.
    pub(super) fn run_air(&mut self, to: Time) {
        if let Some(air) = &mut self.air {
            air.advance(to);
        }
        self.pass_on_air();
    }

    /// Passes the news of the gateway and of other transmitters on to the boards.
    pub(super) fn pass_on_air(&mut self) {
        let Some(air) = self.air.as_mut().filter(|air| air.has_news()) else {
            return;
        };
        for (news, loss) in air.take_news() {
            for (board, plan) in self.boards.iter_mut().zip(&mut self.plans) {
                if board.tell(&news, loss) {
                    *plan = board.plan();
                }
            }
        }
    }
}

impl Board {
    /// Passes news on to the board's module. Returns whether it has one.
    fn tell(&mut self, news: &News, loss: f64) -> bool {
        let Some(radio) = &mut self.circuit_mut().radio else {
            return false;
        };
        tell(&mut radio.module, news, loss);
        self.wires_changed();
        true
    }
}
