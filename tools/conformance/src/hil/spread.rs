//! The distribution of times: minimum, percentiles, maximum, and a histogram for people.

use std::fmt::Write as _;
use std::time::Duration;

/// Number of lines of a histogram, without the line for outliers.
const LINES: u128 = 20;

/// The longest bar, in characters.
const BAR: usize = 40;

/// Times in ascending order; at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spread {
    times: Vec<Duration>,
}

impl Spread {
    /// Sorts times; `None` when there are none.
    pub fn of(mut times: Vec<Duration>) -> Option<Self> {
        times.sort_unstable();
        (!times.is_empty()).then_some(Self { times })
    }

    /// Returns the time that `percent` of a hundred times do not exceed, by the nearest rank: 0 is the minimum, 50 the
    /// median, 100 the maximum. Each result is a time that was measured.
    pub fn percentile(&self, percent: u8) -> Duration {
        let count = self.times.len();
        let rank = (count * usize::from(percent.min(100))).div_ceil(100);
        self.times[rank.max(1) - 1]
    }

    /// Returns a line for each step from the minimum to the 99th percentile, and one line for longer times.
    pub fn histogram(&self) -> String {
        let [first, top] = [0, 99].map(|percent| self.percentile(percent).as_micros());
        let step = round_up((top - first) / LINES + 1);
        let begin = first / step * step;
        let end = top / step * step + step;
        let mut counts = vec![0_usize; ((end - begin) / step) as usize];
        let mut above = 0;
        for time in &self.times {
            let at = (time.as_micros() - begin) / step;
            match counts.get_mut(at as usize) {
                Some(count) => *count += 1,
                None => above += 1,
            }
        }
        let most = counts.iter().copied().max().unwrap_or(1).max(1);
        let mut text = String::new();
        for (count, low) in counts.iter().zip((begin..).step_by(step as usize)) {
            let bar = "#".repeat((count * BAR).div_ceil(most));
            // Writing to a String cannot fail.
            let line = format!("  {:>9} ms  {count:>6}  {bar}", ms(low));
            let _ = writeln!(text, "{}", line.trim_end());
        }
        if above > 0 {
            let _ = writeln!(text, "  above {:>3} ms  {above:>6}", ms(end));
        }
        text
    }
}

/// Returns the microseconds as milliseconds, for people.
fn ms(us: u128) -> String {
    format!("{}.{:03}", us / 1000, us % 1000)
}

/// Rounds up to 1, 2, 5, 10, 20, 50 and so on.
fn round_up(least: u128) -> u128 {
    let mut decade = 1;
    loop {
        for step in [1, 2, 5] {
            if step * decade >= least {
                return step * decade;
            }
        }
        decade *= 10;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(us: impl IntoIterator<Item = u64>) -> Spread {
        Spread::of(us.into_iter().map(Duration::from_micros).collect()).unwrap()
    }

    #[test]
    fn percentiles_are_those_of_the_nearest_rank() {
        let hundred = spread((1..=100).rev());
        for (percent, us) in [(0, 1), (1, 1), (50, 50), (95, 95), (99, 99), (100, 100)] {
            assert_eq!(hundred.percentile(percent).as_micros(), us, "{percent}");
        }
        // The worked example of the nearest-rank method: 15 20 35 40 50.
        let five = spread([35, 15, 50, 20, 40]);
        for (percent, us) in [(5, 15), (30, 20), (40, 20), (50, 35), (100, 50)] {
            assert_eq!(five.percentile(percent).as_micros(), us, "{percent}");
        }
        let one = spread([7]);
        assert_eq!(one.percentile(0), one.percentile(100));
        assert_eq!(Spread::of(Vec::new()), None);
    }

    #[test]
    fn histogram_counts_each_time_once_and_outliers_separately() {
        let mut times: Vec<u64> = (0..999).map(|n| 4000 + n % 100).collect();
        times.push(900_000);
        let text = spread(times).histogram();
        let count = |line: &str| -> Option<usize> {
            let mut words = line.split_whitespace().rev();
            words.find_map(|word| word.parse().ok())
        };
        let counts: Option<usize> = text.lines().map(count).sum();
        assert_eq!(counts, Some(1000), "{text}");
        assert!(text.lines().count() <= LINES as usize + 2, "{text}");
        let last = text.lines().last().unwrap();
        assert!(last.starts_with("  above"), "{text}");
    }

    #[test]
    fn equal_times_give_one_line() {
        let text = spread([5; 3]).histogram();
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(text.contains("0.005 ms") && text.contains(" 3 "), "{text}");
    }
}
