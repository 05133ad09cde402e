//! How the points of the slots meet the stage of their outputs: orders of one instant, what links hold, and the scan.

use modio_drivers::{CHANNELS, ChannelStatus};
use register_map::board::Board;

use super::{IoPort, Points};
use crate::stage::{Held, Stage, Times};

impl<B: Board> Points<B> {
    /// Returns the digital channels of all ports before an instant that sets some of them, the first port's channel 1 in bit 0,
    /// for [`settle`](Self::settle). `None` while no output has a time.
    #[inline(always)]
    pub(super) fn coils_before(&self) -> Option<u32> {
        (B::ROW.stage && self.staged != 0).then(|| self.coils())
    }

    /// Returns the digital channels of all ports, the first port's channel 1 in bit 0.
    #[inline(never)]
    fn coils(&self) -> u32 {
        let ports = self.ports.iter().enumerate();
        ports.fold(0, |coils, (slot, port)| {
            coils | u32::from(port.channels.bits()) << Self::shift(slot)
        })
    }

    /// Returns the place of a slot's channel 1 in a mask of all channels.
    const fn shift(slot: usize) -> u32 {
        (slot * CHANNELS) as u32 & 31
    }

    /// Brings the outputs `named`, which one instant has just set, into line with the stage. `before`: the digital channels of
    /// all ports before that. `asked`: a master has asked for them. Masks have the first port's channel 1 in bit 0.
    #[inline(never)]
    pub(super) fn settle(&mut self, before: u32, named: u32, asked: bool) {
        let mut off = 0;
        for (slot, port) in self.ports.iter_mut().enumerate() {
            let of_port = |mask: u32| (mask >> Self::shift(slot)) as u8 & 0xF;
            let (before, named) = (of_port(before), of_port(named));
            if named != 0 && port.settle(before, named, asked) {
                off |= u32::from(before & !port.channels.bits() & !named) << Self::shift(slot);
            }
        }
        // Those that were not named are commanded to be off.
        for at_safe in self.at_safe.iter_mut() {
            *at_safe &= !off;
        }
    }

    /// Brings the outputs of a slot into line with the stage at a start. `held`: those that links held before it.
    pub(super) fn begin_stage(&mut self, slot: usize, held: u8) {
        if B::ROW.stage && self.staged >> (slot & 7) & 1 != 0 {
            self.act_staged(slot, |port| port.begin_stage(held));
        }
    }

    /// Takes what level links hold of a slot from now on.
    #[inline(always)]
    pub(super) fn take_held(&mut self, slot: usize, held: Held) {
        if B::ROW.stage
            && let Some(port) = self.ports.get_mut(slot)
        {
            port.take_held(held);
        }
    }

    /// Sets the times of an output, which begins anew if they change.
    pub(super) fn set_times(&mut self, slot: usize, channel: usize, times: Times) {
        let one = 1 << (slot & 7);
        self.staged &= !one;
        if self.act_staged(slot, |port| port.set_times(channel, times)) == Some(true) {
            self.staged |= one;
        }
    }

    /// Returns the digital channels of a slot for the scan to drive, as [`Device::drive`](super::Device::drive). `manual`: outputs
    /// that are switched by hand.
    #[inline(always)]
    pub(super) fn drive(&mut self, slot: usize, held: Held, manual: u8, ms: u32) -> u8 {
        if B::ROW.stage && self.staged >> (slot & 7) & 1 != 0 {
            return self.drive_staged(slot, manual, ms);
        }
        self.ports.get_mut(slot).map_or(0, |port| {
            port.channels.set_bits(held.outputs, held.on);
            port.channels.bits()
        })
    }

    #[inline(never)]
    fn drive_staged(&mut self, slot: usize, manual: u8, ms: u32) -> u8 {
        let (bits, is_idle) = self
            .act_staged(slot, |port| port.drive(manual, ms))
            .unwrap_or_default();
        if is_idle {
            self.staged &= !(1 << (slot & 7));
        }
        bits
    }

    /// Lets the stage of a port act. Outputs that it sets to 0 are commanded to be off, and are no longer at SAFE.
    #[inline(always)]
    fn act_staged<T>(&mut self, slot: usize, act: impl FnOnce(&mut IoPort<B>) -> T) -> Option<T> {
        let port = self.ports.get_mut(slot)?;
        let before = port.channels.bits();
        let done = act(port);
        let off = u32::from(before & !port.channels.bits());
        for at_safe in self.at_safe.iter_mut() {
            *at_safe &= !(off << Self::shift(slot));
        }
        Some(done)
    }

    /// Sets the outputs of a slot to what links hold.
    pub(super) fn hold(&mut self, slot: usize, held: Held) {
        self.act_staged(slot, |port| port.hold(held));
        for at_safe in self.at_safe.iter_mut() {
            *at_safe &= !(u32::from(held.outputs) << Self::shift(slot));
        }
    }

    /// Settles what the edge links of one scan have done to the outputs of a slot.
    pub(super) fn settle_slot(&mut self, slot: usize, before: u8, named: u8) {
        if !B::ROW.stage || self.staged >> (slot & 7) & 1 == 0 {
            return;
        }
        let shift = Self::shift(slot);
        self.settle(u32::from(before) << shift, u32::from(named) << shift, false);
    }
}

impl<B: Board> IoPort<B> {
    /// Sets the times of a digital output. If they change, it begins anew. Returns whether an output of the port has a time.
    pub(super) fn set_times(&mut self, channel: usize, times: Times) -> bool {
        let [stage] = &mut self.stage[..] else {
            return false;
        };
        let coils = stage.set(self.channels.bits(), channel, times);
        let is_staged = !stage.is_idle();
        self.set_coils(coils);
        is_staged
    }

    /// Sets the digital outputs to the coils of the stage.
    #[inline(always)]
    fn set_coils(&mut self, coils: u8) {
        let digital = self.stage.first().map_or(0, Stage::digital);
        self.channels.set_bits(digital, coils);
        self.pulsing &= coils;
    }

    /// Brings the digital outputs `named`, which one instant has just set, into line with the stage. `before` has the coils
    /// before that instant. `asked`: a master has asked for them. Returns false when there is nothing to do, because no output
    /// has a time.
    pub(super) fn settle(&mut self, before: u8, named: u8, asked: bool) -> bool {
        let stage = self.stage.first_mut().filter(|stage| !stage.is_idle());
        let Some(stage) = stage else {
            return false;
        };
        let (named, on) = (named & stage.digital(), self.channels.bits());
        let coils = if asked {
            stage.request(before, named, on)
        } else {
            stage.order(before, named, on)
        };
        self.set_coils(coils);
        true
    }

    /// Brings the digital outputs into line with the stage at a start. `held`: those that links held before it.
    pub(super) fn begin_stage(&mut self, held: u8) {
        let on = self.channels.bits();
        if let Some(stage) = self.stage.first_mut() {
            let outputs = stage.digital() & held;
            let held = Held {
                outputs,
                on: outputs & on,
            };
            stage.take_held(held);
            let coils = stage.order(held.on, stage.digital(), on);
            let coils = stage.hold(coils);
            self.set_coils(coils);
        }
    }

    /// Takes what level links hold from now on.
    pub(super) fn take_held(&mut self, held: Held) {
        if let Some(stage) = self.stage.first_mut() {
            stage.take_held(held);
        }
    }

    /// Runs the stage behind the links, `ms` milliseconds after the last scan, and returns the digital channels to drive, and
    /// whether the stage has nothing to do from now on. `manual`: outputs that are switched by hand.
    pub(super) fn drive(&mut self, manual: u8, ms: u32) -> (u8, bool) {
        let bits = self.channels.bits();
        let [stage] = &mut self.stage[..] else {
            return (bits, true);
        };
        let (digital, is_idle) = (stage.digital(), stage.is_idle());
        let coils = stage.scan(bits, manual, ms);
        let driven = bits & !digital | stage.terminals() & digital;
        self.set_coils(coils);
        (driven, is_idle)
    }

    /// Returns the status of a channel.
    pub(super) fn status(&self, channel: usize) -> ChannelStatus {
        let (waiting, ended) = self
            .stage
            .first()
            .map_or((0, 0), |stage| (stage.waiting(), stage.ended()));
        match 1 << channel {
            bit if ended & bit != 0 => ChannelStatus::Ended,
            bit if waiting & bit != 0 => ChannelStatus::Waits,
            _ => self.channels.status(channel),
        }
    }

    /// Sets the digital outputs to what links hold, which the stage has taken.
    pub(super) fn hold(&mut self, held: Held) {
        if let Some(stage) = self.stage.first() {
            let coils = stage.hold(self.channels.bits());
            self.set_coils(coils);
        } else {
            self.channels.set_bits(held.outputs, held.on);
        }
        self.pulsing &= !held.outputs;
    }
}
