//! A bus with several units: what each unit puts on it, for the other units and for the line that is the bus.
//!
//! Each board has its own end of the line, with its own driver and receiver; one more [`Line`] is the bus, with the
//! master and the record. [`Line::take_said`] says what a unit did to the bus, and what its transmitter will do to it
//! if nothing intervenes; [`Line::hear`] takes it up everywhere else. So both are as exact as a line with one unit, as
//! long as an end knows of an edge before its time passes the edge.
//!
//! [`crate::bus`] runs the boards in an order that ensures this, within half a bit. A late edge counts from its own
//! instant if nothing has happened on that end of the line since, and from the end's present otherwise.

use std::collections::VecDeque;

use super::{HISTORY, Line, Span, keep};
use crate::periph::usart::TxPin;
use crate::serial::{Settings, Wave};
use crate::time::Time;

/// What a line is on a bus with several units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Role {
    /// The whole line of a board that has it for itself.
    #[default]
    Alone,
    /// One unit's end of the line: its driver and receiver, without a record.
    End,
    /// The bus: the master and the record, without a unit.
    Bus,
}

/// A unit at another end of the line.
#[derive(Clone, Debug)]
struct Talker {
    unit: usize,
    /// What its driver puts on the bus, known beyond the present while it sends.
    wave: Wave,
    /// Whether its driver is on before the first of `switches`.
    on: bool,
    /// Each switching of its driver that the line has not come to.
    switches: VecDeque<(Time, bool)>,
}

/// What a line knows of the other units.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared {
    role: Role,
    /// The unit at this end has done something to the bus since [`Line::take_said`].
    pub(super) changed: bool,
    said_until: Time,
    switches: Vec<(Time, bool)>,
    others: Vec<Talker>,
    /// Nothing is queued before this instant: some unit has come that far.
    earliest: Time,
}

/// What a unit does to the bus.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    /// It takes the place of everything known of the unit from here on.
    from: Time,
    /// Level at `from`, and the edges after `from`.
    level: bool,
    edges: Vec<(Time, bool)>,
    /// The switchings of its driver since the last time.
    switches: Vec<(Time, bool)>,
}

impl Shared {
    pub(super) fn is_end(&self) -> bool {
        self.role == Role::End
    }

    pub(super) fn is_bus(&self) -> bool {
        self.role == Role::Bus
    }

    /// The driver of the unit at this end went on or off.
    pub(super) fn switched(&mut self, at: Time, on: bool) {
        if self.is_end() {
            self.changed = true;
            self.switches.push((at, on));
        }
    }

    /// What the other units put on the bus.
    pub(super) fn waves(&self) -> impl Iterator<Item = &Wave> {
        self.others.iter().map(|talker| &talker.wave)
    }

    /// The level that the other units leave at `at`.
    pub(super) fn level_at(&self, at: Time) -> bool {
        self.waves().all(|wave| wave.level_at(at))
    }

    /// How many other units pulled the bus low between two instants.
    pub(super) fn talkers(&self, from: Time, to: Time) -> usize {
        self.waves()
            .filter(|wave| wave.low_between(from, to))
            .count()
    }

    /// Forgets what happened before `oldest`, and the units that have said nothing since.
    pub(super) fn drop_before(&mut self, oldest: Time) {
        for talker in &mut self.others {
            talker.wave.drop_before(oldest);
        }
        self.others.retain(|talker| {
            let silent = talker.wave.is_empty() && talker.wave.last_level();
            !(silent && talker.switches.is_empty() && !talker.on)
        });
    }

    fn talker(&mut self, unit: usize) -> &mut Talker {
        let known = self.others.iter().position(|talker| talker.unit == unit);
        let n = known.unwrap_or_else(|| {
            self.others.push(Talker {
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
    /// The line of a bus with several units, from `now` on.
    pub(crate) fn of_bus(now: Time) -> Self {
        let mut line = Self {
            now,
            ..Self::default()
        };
        line.shared.role = Role::Bus;
        line
    }

    /// From now on this is one unit's end of a bus.
    pub(crate) fn become_end(&mut self) {
        self.shared.role = Role::End;
        self.shared.changed = true;
        self.shared.said_until = self.now;
        if self.driver {
            self.shared.switches.push((self.now, true));
        }
    }

    /// Whether the unit at this end has done something to the bus since [`Line::take_said`].
    pub(crate) fn has_changed(&self) -> bool {
        self.shared.changed
    }

    /// Takes what the unit at this end does to the bus; `None` when that is as it said last.
    pub(crate) fn take_said(&mut self) -> Option<Said> {
        let from = core::mem::replace(&mut self.shared.said_until, self.now);
        let from = from.max(self.now.saturating_sub(HISTORY));
        if !core::mem::take(&mut self.shared.changed) {
            return None;
        }
        self.settle(self.now);
        let mut edges: Vec<_> = self.unit.edges(from, self.now).collect();
        if self.driver && self.tx_pin == TxPin::Usart {
            edges.extend(self.usart.edges(self.now, Time::MAX));
        }
        Some(Said {
            from,
            level: self.unit.level_at(from),
            edges,
            switches: core::mem::take(&mut self.shared.switches),
        })
    }

    /// Unit `unit`, at another end, says this.
    pub(crate) fn hear(&mut self, unit: usize, said: &Said) {
        let records = self.shared.is_bus();
        let talker = self.shared.talker(unit);
        talker.wave.truncate(said.from);
        talker.wave.push(said.from, said.level);
        for &(at, level) in &said.edges {
            talker.wave.push(at, level);
        }
        if records {
            talker.switches.extend(&said.switches);
        }
        // Edges in the past of this end, which arrive late.
        let edges = said.edges.iter().map(|&(at, _)| at);
        for at in core::iter::once(said.from).chain(edges) {
            if at >= self.now {
                break;
            }
            if self.unchanged_since(at) {
                self.settle(at);
            }
        }
    }

    /// Whether nothing has happened at this end from `at` on.
    fn unchanged_since(&self, at: Time) -> bool {
        let edges = [&self.bus, &self.unit].map(|wave| wave.previous_edge(Time::MAX));
        let switch = self.driver_edges.back().map(|&(at, _)| at);
        let last = edges.into_iter().chain([switch]).flatten().max();
        let forgotten = self.now.saturating_sub(HISTORY);
        at > forgotten && last.is_none_or(|last| last < at)
    }

    /// Takes over what the master and the noise of `bus` do from `from` on.
    pub(crate) fn mirror(&mut self, bus: &Self, from: Time) {
        let waves = [
            (&mut self.master.wave, &bus.master.wave),
            (&mut self.noise, &bus.noise),
        ];
        for (mine, theirs) in waves {
            mine.truncate(from);
            mine.push(from, theirs.level_at(from));
            for (at, level) in theirs.edges(from, Time::MAX) {
                mine.push(at, level);
            }
        }
    }

    /// Grows with everything that the master or noise has queued.
    pub(crate) fn version(&self) -> u64 {
        self.master.version
    }

    /// Nothing is queued before `earliest` any more.
    pub(crate) fn set_earliest(&mut self, earliest: Time) {
        self.shared.earliest = earliest;
    }

    /// The earliest instant at which something may be queued.
    pub(super) fn earliest(&self) -> Time {
        self.shared.earliest.max(self.now)
    }

    /// Everything on the bus up to `to` happens; all units have come that far. `settings` are those of a unit, for a
    /// master that follows it.
    pub(crate) fn pass(&mut self, to: Time, settings: Option<Settings>) {
        self.extend(to);
        self.listen();
        if self.follow && self.master.queued_until <= self.now {
            self.settings = settings.unwrap_or(self.settings);
        }
    }

    /// Notes where the drivers of two units are on, or of one while the master is sending, from where the line is up
    /// to `to`.
    pub(super) fn collide_units(&mut self, to: Time) {
        let shared = &mut self.shared;
        let quiet = |talker: &Talker| !talker.on && talker.switches.is_empty();
        if shared.others.iter().all(quiet) {
            return;
        }
        let drivers = |others: &[Talker]| others.iter().filter(|talker| talker.on).count();
        let mut at = self.now;
        loop {
            let before = drivers(&shared.others);
            for talker in &mut shared.others {
                while let Some(&(_, on)) = talker.switches.front().filter(|&&(t, _)| t <= at) {
                    talker.on = on;
                    talker.switches.pop_front();
                }
            }
            let on = drivers(&shared.others);
            if (before > 0) != (on > 0) {
                keep(&mut self.driver_edges, (at, on > 0), self.keep_all);
            }
            if at >= to {
                break;
            }
            let switches = shared
                .others
                .iter()
                .flat_map(|talker| talker.switches.front());
            let talking = &self.master.talking;
            let bounds = talking.iter().flat_map(|span| [span.start, span.end]);
            let changes = switches.map(|&(t, _)| t).chain(bounds);
            let end = changes.filter(|&t| t > at).fold(to, Time::min);
            let talks = talking.iter().any(|span| span.start <= at && at < span.end);
            if on + usize::from(talks) > 1 {
                match self.collisions.back_mut() {
                    Some(last) if last.end == at => last.end = end,
                    _ => keep(&mut self.collisions, Span { start: at, end }, self.keep_all),
                }
            }
            at = end;
        }
    }
}
