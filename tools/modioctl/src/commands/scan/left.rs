//! What a scan has not done yet.

use std::collections::VecDeque;

use indicatif::ProgressBar;

use crate::failure::Failure;

/// What the scan has not done yet.
#[derive(Default)]
pub struct Left {
    /// Addresses at the present line.
    units: VecDeque<u8>,
    /// Whether they have been asked once.
    again: bool,
    /// Number of rates and formats after the present ones.
    pub lines: usize,
}

impl Left {
    /// Begins a pass over these addresses. Returns the function that takes each address when it is asked.
    pub fn begin<'a>(
        &'a mut self,
        units: &[u8],
        again: bool,
        bar: &'a ProgressBar,
    ) -> impl FnMut(u8) + use<'a> {
        self.units = units.iter().copied().collect();
        self.again = again;
        |_| {
            bar.inc(1);
            self.units.pop_front();
        }
    }

    /// Adds to a failure what the scan has not done.
    pub fn add_to(&self, failure: Failure) -> Failure {
        let mut not_done = Vec::new();
        if !self.units.is_empty() {
            let units = list(self.units.iter().copied());
            let again = if self.again { " a second time" } else { "" };
            not_done.push(format!("addresses {units} were not asked{again}"));
        }
        if self.lines > 0 {
            not_done.push(format!("{} rates and formats were not tried", self.lines));
        }
        match failure {
            Failure::Port(text) if !not_done.is_empty() => {
                Failure::Port(format!("{text}: {}", not_done.join(", and ")))
            }
            failure => failure,
        }
    }
}

/// Returns addresses in the form of `--units`.
pub fn list(units: impl IntoIterator<Item = u8>) -> String {
    let mut spans: Vec<(u8, u8)> = Vec::new();
    for unit in units {
        match spans.last_mut() {
            Some((_, last)) if unit.checked_sub(1) == Some(*last) => *last = unit,
            _ => spans.push((unit, unit)),
        }
    }
    let shown = |(first, last): &(u8, u8)| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    };
    spans.iter().map(shown).collect::<Vec<_>>().join(",")
}
