//! A bus with several units: passes the level of each unit to the other units and to the bus.
//!
//! Each board has its own end of the line, with its own driver and receiver. One more [`Line`] is the bus, with the
//! master and the record. [`Line::take_output`] returns the levels that a unit has put on the bus, and those that its
//! transmitter will put on the bus if nothing intervenes. [`Line::add_output`] adds them at every other end and on the
//! bus. The ends are as exact as a line with one unit, as long as each end gets an edge before its time passes the
//! edge.
//!
//! [`crate::bus`] runs the boards in an order that ensures this, within half a bit. An edge that an
//! end receives late takes effect at its true instant, if nothing has happened at this end since that instant. Otherwise
//! the edge takes effect at the present time of the end.

use std::collections::VecDeque;

use super::{HISTORY, Line, Span, keep};
use f103::periph::usart::TxPin;
use f103::serial::{Settings, Wave};
use f103::time::Time;

/// Role of a [`Line`] on a bus with several units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Role {
    /// The whole line of a single board.
    #[default]
    Alone,
    /// One unit's end of the line: its driver and receiver, without a record.
    End,
    /// The bus: the master and the record, without a unit.
    Bus,
}

/// A unit at another end of the line.
#[derive(Clone, Debug)]
struct Sender {
    unit: usize,
    /// Level that the unit's driver puts on the bus. While the unit sends, the wave reaches into the future.
    wave: Wave,
    /// Whether the driver is on before the first entry of `switches`.
    on: bool,
    /// Switchings of the driver that the line has not reached yet.
    switches: VecDeque<(Time, bool)>,
}

/// The other units, as a line knows them.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared {
    role: Role,
    /// Whether the unit at this end has changed its output since [`Line::take_output`].
    pub(super) changed: bool,
    /// Time of the last [`Line::take_output`].
    output_until: Time,
    /// Switchings of the driver at this end since the last [`Line::take_output`].
    switches: Vec<(Time, bool)>,
    others: Vec<Sender>,
    /// Nothing can be queued before this instant, because a unit has already reached it.
    earliest: Time,
}

/// The levels that a unit puts on the bus.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// Start. This output replaces everything that is known of the unit from here on.
    from: Time,
    /// Level at `from`, and the edges after `from`.
    level: bool,
    edges: Vec<(Time, bool)>,
    /// Switchings of the unit's driver since its last output.
    switches: Vec<(Time, bool)>,
}

impl Shared {
    pub(super) fn is_end(&self) -> bool {
        self.role == Role::End
    }

    pub(super) fn is_bus(&self) -> bool {
        self.role == Role::Bus
    }

    /// Notes that the driver of the unit at this end was switched.
    pub(super) fn switched(&mut self, at: Time, on: bool) {
        if self.is_end() {
            self.changed = true;
            self.switches.push((at, on));
        }
    }

    /// Returns the levels that the other units put on the bus.
    pub(super) fn waves(&self) -> impl Iterator<Item = &Wave> {
        self.others.iter().map(|sender| &sender.wave)
    }

    /// Returns the level of all other units together at `at`: low if one of them pulls the bus low.
    pub(super) fn level_at(&self, at: Time) -> bool {
        self.waves().all(|wave| wave.level_at(at))
    }

    /// Returns the number of other units that pulled the bus low between two instants.
    pub(super) fn senders(&self, from: Time, to: Time) -> usize {
        self.waves()
            .filter(|wave| wave.low_between(from, to))
            .count()
    }

    /// Drops everything before `oldest`, and the units that have not driven the bus since then.
    pub(super) fn drop_before(&mut self, oldest: Time) {
        for sender in &mut self.others {
            sender.wave.drop_before(oldest);
        }
        self.others.retain(|sender| {
            let silent = sender.wave.is_empty() && sender.wave.last_level();
            !(silent && sender.switches.is_empty() && !sender.on)
        });
    }

    fn sender(&mut self, unit: usize) -> &mut Sender {
        let known = self.others.iter().position(|sender| sender.unit == unit);
        let n = known.unwrap_or_else(|| {
            self.others.push(Sender {
                unit,
                wave: Wave::default(),
                on: false,
                switches: VecDeque::new(),
            });
            self.others.len() - 1
        });
        &mut self.others[n]
    }
}

impl Line {
    /// Returns the line that is the bus of several units, from `now` on.
    pub(crate) fn of_bus(now: Time) -> Self {
        let mut line = Self {
            now,
            ..Self::default()
        };
        line.shared.role = Role::Bus;
        line
    }

    /// Makes this line one unit's end of a bus, from now on.
    pub(crate) fn become_end(&mut self) {
        self.shared.role = Role::End;
        self.shared.changed = true;
        self.shared.output_until = self.now;
        if self.driver {
            self.shared.switches.push((self.now, true));
        }
    }

    /// Returns whether the unit at this end has changed its output since [`Line::take_output`].
    pub(crate) fn has_changed(&self) -> bool {
        self.shared.changed
    }

    /// Returns the output of the unit at this end; `None` if it is as in the last call.
    pub(crate) fn take_output(&mut self) -> Option<Output> {
        let from = core::mem::replace(&mut self.shared.output_until, self.now);
        let from = from.max(self.now.saturating_sub(HISTORY));
        if !core::mem::take(&mut self.shared.changed) {
            return None;
        }
        self.settle(self.now);
        let mut edges: Vec<_> = self.unit.edges(from, self.now).collect();
        if self.driver && self.tx_pin == TxPin::Usart {
            edges.extend(self.usart.edges(self.now, Time::MAX));
        }
        Some(Output {
            from,
            level: self.unit.level_at(from),
            edges,
            switches: core::mem::take(&mut self.shared.switches),
        })
    }

    /// Adds the output of unit `unit`, which is at another end. It takes `delay` from there to here.
    pub(crate) fn add_output(&mut self, unit: usize, output: &Output, delay: Time) {
        let records = self.shared.is_bus();
        let sender = self.shared.sender(unit);
        let from = output.from + delay;
        let edges = || output.edges.iter().map(|&(at, level)| (at + delay, level));
        sender.wave.truncate(from);
        sender.wave.push(from, output.level);
        for (at, level) in edges() {
            sender.wave.push(at, level);
        }
        if records {
            let switches = output.switches.iter();
            sender
                .switches
                .extend(switches.map(|&(at, on)| (at + delay, on)));
        }
        // Late edges, which are in the past of this end.
        for at in core::iter::once(from).chain(edges().map(|(at, _)| at)) {
            if at >= self.now {
                break;
            }
            if self.unchanged_since(at) {
                self.settle(at);
            }
        }
    }

    /// Returns whether nothing has happened at this end from `at` on.
    fn unchanged_since(&self, at: Time) -> bool {
        let edges = [&self.bus, &self.unit].map(|wave| wave.previous_edge(Time::MAX));
        let switch = self.driver_edges.back().map(|&(at, _)| at);
        let last = edges.into_iter().chain([switch]).flatten().max();
        let forgotten = self.now.saturating_sub(HISTORY);
        at > forgotten && last.is_none_or(|last| last < at)
    }

    /// Takes over the levels of the master and the noise of `bus`, from `from` on. They take `delay` to this end.
    pub(crate) fn mirror(&mut self, bus: &Self, from: Time, delay: Time) {
        let waves = [
            (&mut self.master.wave, &bus.master.wave),
            (&mut self.noise, &bus.noise),
        ];
        for (mine, theirs) in waves {
            mine.truncate(from + delay);
            mine.push(from + delay, theirs.level_at(from));
            for (at, level) in theirs.edges(from, Time::MAX) {
                mine.push(at + delay, level);
            }
        }
    }

    /// Increases with every character and every noise pulse that is queued.
    pub(crate) fn version(&self) -> u64 {
        self.master.version
    }

    /// Sets the instant before which nothing can be queued.
    pub(crate) fn set_earliest(&mut self, earliest: Time) {
        self.shared.earliest = earliest;
    }

    /// Returns the earliest instant at which something can be queued.
    pub(super) fn earliest(&self) -> Time {
        self.shared.earliest.max(self.now)
    }

    /// Computes the bus up to `to`. All units have reached this instant. `settings` are those of a unit, for a master
    /// that follows it.
    pub(crate) fn pass(&mut self, to: Time, settings: Option<Settings>) {
        self.extend(to);
        self.listen();
        if self.follow && self.master.queued_until <= self.now {
            self.settings = settings.unwrap_or(self.settings);
        }
    }

    /// Records collisions from now to `to`: the drivers of two units are on, or the driver of one unit while the master
    /// sends.
    pub(super) fn collide_units(&mut self, to: Time) {
        let shared = &mut self.shared;
        let quiet = |sender: &Sender| !sender.on && sender.switches.is_empty();
        if shared.others.iter().all(quiet) {
            return;
        }
        let drivers = |others: &[Sender]| others.iter().filter(|sender| sender.on).count();
        let mut at = self.now;
        loop {
            let before = drivers(&shared.others);
            for sender in &mut shared.others {
                while let Some(&(_, on)) = sender.switches.front().filter(|&&(t, _)| t <= at) {
                    sender.on = on;
                    sender.switches.pop_front();
                }
            }
            let on = drivers(&shared.others);
            if (before > 0) != (on > 0) {
                keep(&mut self.driver_edges, (at, on > 0));
            }
            if at >= to {
                break;
            }
            let switches = shared
                .others
                .iter()
                .flat_map(|sender| sender.switches.front());
            let sending = &self.master.sending;
            let bounds = sending.iter().flat_map(|span| [span.start, span.end]);
            let changes = switches.map(|&(t, _)| t).chain(bounds);
            let end = changes.filter(|&t| t > at).fold(to, Time::min);
            let sends = sending.iter().any(|span| span.start <= at && at < span.end);
            if on + usize::from(sends) > 1 {
                match self.collisions.back_mut() {
                    Some(last) if last.end == at => last.end = end,
                    _ => keep(&mut self.collisions, Span { start: at, end }),
                }
            }
            at = end;
        }
    }
}
