//! The level of a wire over time, as a list of edges.

use std::collections::VecDeque;

use super::Character;
use crate::time::Time;

/// The level of a wire over time.
#[derive(Clone, Debug)]
pub struct Wave {
    /// Level before the first edge that is kept.
    before: bool,
    /// Time of each edge and the level after it, in time order. The levels alternate.
    edges: VecDeque<(Time, bool)>,
}

impl Default for Wave {
    /// Returns a wire that has always been high.
    fn default() -> Self {
        Self::new(true)
    }
}

impl Wave {
    /// Returns a wire that has always been at `level`.
    #[must_use]
    pub const fn new(level: bool) -> Self {
        Self {
            before: level,
            edges: VecDeque::new(),
        }
    }

    /// Sets the levels of the bits of a character, which must not begin before the last edge.
    pub fn push_character(&mut self, character: &Character) {
        for bit in 0..character.bits {
            let at = character.start + character.bit * u64::from(bit);
            self.push(at, character.level(bit));
        }
    }

    /// Sets the level from `at` on. `at` must not be before the last edge. If the last edge is at the same instant and
    /// `level` is the level before it, that edge is removed.
    pub fn push(&mut self, at: Time, level: bool) {
        if self.last_level() == level {
            return;
        }
        match self.edges.back() {
            Some(&(last, _)) if last >= at => {
                debug_assert_eq!(last, at, "edges must be in time order");
                self.edges.pop_back();
            }
            _ => self.edges.push_back((at, level)),
        }
    }

    /// Removes the edges at and after `at`: the wire keeps the level that it had just before `at`.
    pub fn truncate(&mut self, at: Time) {
        while self.edges.back().is_some_and(|&(t, _)| t >= at) {
            self.edges.pop_back();
        }
    }

    /// Drops the edges before `at`. The level at `at` and later stays the same.
    pub fn drop_before(&mut self, at: Time) {
        while let Some(&(t, level)) = self.edges.front() {
            if t >= at {
                break;
            }
            self.before = level;
            self.edges.pop_front();
        }
    }

    /// Returns the level at `at`. At the instant of an edge this is the level after the edge.
    #[must_use]
    pub fn level_at(&self, at: Time) -> bool {
        match self.index_after(at) {
            0 => self.before,
            n => self.edges[n - 1].1,
        }
    }

    /// Returns the level after the last edge.
    #[must_use]
    pub fn last_level(&self) -> bool {
        self.edges.back().map_or(self.before, |&(_, level)| level)
    }

    /// Returns the edges after `from`, up to and including `to`.
    pub fn edges(&self, from: Time, to: Time) -> impl Iterator<Item = (Time, bool)> + '_ {
        self.edges
            .range(self.index_after(from)..)
            .copied()
            .take_while(move |&(t, _)| t <= to)
    }

    /// Returns the first edge after `from`.
    #[must_use]
    pub fn next_edge(&self, from: Time) -> Option<(Time, bool)> {
        self.edges.get(self.index_after(from)).copied()
    }

    /// Returns the first falling edge after `from`.
    #[must_use]
    pub fn next_fall(&self, from: Time) -> Option<Time> {
        self.edges(from, Time::MAX)
            .find(|&(_, level)| !level)
            .map(|(t, _)| t)
    }

    /// Returns the time of the last edge before `edge`; `None` if no such edge is kept.
    #[must_use]
    pub fn previous_edge(&self, edge: Time) -> Option<Time> {
        if let last @ Some(at) = self.last_edge()
            && at < edge
        {
            return last;
        }
        let n = self.edges.partition_point(|&(t, _)| t < edge);
        n.checked_sub(1).map(|n| self.edges[n].0)
    }

    /// Returns whether the wire was low at any instant from `from` up to `to`.
    #[must_use]
    pub fn low_between(&self, from: Time, to: Time) -> bool {
        !self.level_at(from) || self.edges(from, to).any(|(_, level)| !level)
    }

    /// Returns the number of edges that are kept.
    #[must_use]
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Returns whether no edges are kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// Returns the time of the last edge.
    fn last_edge(&self) -> Option<Time> {
        self.edges.back().map(|&(at, _)| at)
    }

    /// Returns the number of edges up to and including `at`.
    fn index_after(&self, at: Time) -> usize {
        // The usual case: `at` is the present, and the wire has no edges in the future.
        if self.last_edge().is_none_or(|last| last <= at) {
            return self.edges.len();
        }
        self.edges.partition_point(|&(t, _)| t <= at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(n: u64) -> Time {
        Time::from_us(n)
    }

    fn pulse() -> Wave {
        let mut wave = Wave::default();
        wave.push(us(10), false);
        wave.push(us(20), true);
        wave.push(us(30), false);
        wave.push(us(40), true);
        wave
    }

    #[test]
    fn levels_and_edges_are_found_by_time() {
        let wave = pulse();
        assert!(wave.level_at(us(9)));
        assert!(!wave.level_at(us(10)));
        assert!(wave.level_at(us(20)));
        assert_eq!(wave.next_fall(us(10)), Some(us(30)));
        assert_eq!(wave.next_edge(us(10)), Some((us(20), true)));
        assert_eq!(wave.edges(us(10), us(30)).count(), 2);
        assert_eq!(wave.previous_edge(us(30)), Some(us(20)));
        assert_eq!(wave.previous_edge(us(10)), None);
        assert!(wave.low_between(us(5), us(10)));
        assert!(!wave.low_between(us(21), us(29)));
    }

    #[test]
    fn edge_that_is_reversed_at_the_same_instant_is_removed() {
        let mut wave = pulse();
        wave.push(us(50), false);
        wave.push(us(50), true);
        assert_eq!(wave.len(), 4);
        wave.push(us(50), true);
        assert_eq!(wave.len(), 4);
    }

    #[test]
    fn dropping_edges_keeps_the_level_after_them() {
        let mut wave = pulse();
        wave.drop_before(us(15));
        assert_eq!(wave.len(), 3);
        assert!(!wave.level_at(us(15)));
        wave.truncate(us(30));
        assert!(wave.level_at(us(100)));
        assert_eq!(wave.len(), 1);
    }
}
