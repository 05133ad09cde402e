//! Values of an analog point over the last minutes.

use std::collections::VecDeque;
use std::time::Duration;

use tokio::time::Instant;

/// Time span of the chart.
pub const SPAN: Duration = Duration::from_secs(300);
/// Largest number of stored values, more than a chart has columns.
const MOST: usize = 8192;

/// Values of an analog point.
#[derive(Clone, Debug, Default)]
pub struct History {
    values: VecDeque<(Instant, f64)>,
}

impl History {
    /// Adds a value, and removes those that are older than [`SPAN`].
    pub fn add(&mut self, at: Instant, value: f64) {
        self.values.push_back((at, value));
        let old = |(then, _): &(Instant, f64)| at.saturating_duration_since(*then) > SPAN;
        while self.values.len() > MOST || self.values.front().is_some_and(old) {
            self.values.pop_front();
        }
    }

    /// Returns lines of the chart: seconds before `now`, as negative numbers, with the values. A pause longer than
    /// `gap` ends a line, so that the chart shows a gap.
    pub fn lines(&self, now: Instant, gap: Duration) -> Vec<Vec<(f64, f64)>> {
        let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut before: Option<Instant> = None;
        for (at, value) in &self.values {
            let age = now.saturating_duration_since(*at);
            if age > SPAN {
                continue;
            }
            let joins = before.is_some_and(|before| at.saturating_duration_since(before) <= gap);
            before = Some(*at);
            let point = (-age.as_secs_f64(), *value);
            match lines.last_mut().filter(|_| joins) {
                Some(line) => line.push(point),
                None => lines.push(vec![point]),
            }
        }
        lines
    }
}

/// Returns the lowest and the highest value of lines.
pub fn extent(lines: &[Vec<(f64, f64)>]) -> Option<(f64, f64)> {
    let mut values = lines.iter().flatten().map(|(_, value)| *value);
    let first = values.next()?;
    Some(values.fold((first, first), |(low, high), value| {
        (low.min(value), high.max(value))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_values_are_removed_and_a_pause_splits_the_line() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut history = History::default();
        for (seconds, value) in [(0, 1.0), (100, 2.0), (101, 3.0), (103, 4.0), (320, 5.0)] {
            history.add(at(seconds), value);
        }
        let lines = history.lines(at(320), Duration::from_secs(2));
        assert_eq!(
            lines,
            [
                vec![(-220.0, 2.0), (-219.0, 3.0), (-217.0, 4.0)],
                vec![(0.0, 5.0)]
            ]
        );
        assert_eq!(extent(&lines), Some((2.0, 5.0)));
        assert_eq!(extent(&[]), None);
        let later = history.lines(at(500), Duration::from_secs(2));
        assert_eq!(later, [vec![(-180.0, 5.0)]]);
    }
}
