//! Bars for the line and for each unit.

use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use crate::update::{Campaign, Stage, Unit};

/// The bars. Nothing is drawn when standard error is no terminal.
#[derive(Default)]
pub struct Progress {
    bars: MultiProgress,
    line: Option<ProgressBar>,
    units: Vec<ProgressBar>,
}

fn bar(template: &str) -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

impl Progress {
    /// Draws the bars of a plan.
    pub fn begin(&mut self, campaign: &Campaign) {
        let line = bar("line     {bar:30} {pos}/{len} blocks, {eta} left");
        let line = self.bars.add(line);
        line.enable_steady_tick(Duration::from_millis(200));
        self.line = Some(line);
        for unit in campaign.units() {
            let bar = self.bars.add(bar("unit {prefix:>3} {bar:30} {msg}"));
            bar.set_prefix(unit.address.to_string());
            self.units.push(bar);
        }
        self.show(campaign);
    }

    /// Shows how far the units are.
    pub fn show(&self, campaign: &Campaign) {
        let (sent, left) = campaign.blocks();
        if let Some(line) = &self.line {
            let image = campaign.units().iter().map(Unit::blocks).max();
            line.set_length((sent + left).max(image.unwrap_or_default()) as u64);
            line.set_position(sent as u64);
        }
        for (bar, unit) in self.units.iter().zip(campaign.units()) {
            // What was sent to it in this round has probably arrived.
            let missing = match left {
                0 => unit.lacks(),
                left => unit.lacks().min(left),
            };
            let all = unit.blocks();
            bar.set_length(all as u64);
            let position = match unit.stage {
                Stage::Waiting | Stage::Erasing => 0,
                _ => all - missing,
            };
            bar.set_position(position as u64);
            bar.set_message(match unit.stage {
                Stage::Waiting => "waits",
                Stage::Erasing => "erases",
                Stage::Receiving => "receives",
                Stage::Restarting => "checks the image and restarts",
                Stage::OnTrial => "runs it, on trial",
                Stage::Confirming => "confirms",
                Stage::Done => "done",
                Stage::Failed(_) => "failed",
            });
        }
    }

    /// Runs a function that prints, with the bars out of its way.
    pub fn pause<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bars.suspend(print)
    }

    /// Removes the bars.
    pub fn clear(&mut self) {
        if let Some(line) = self.line.take() {
            line.finish_and_clear();
        }
        self.units.drain(..).for_each(|bar| bar.finish_and_clear());
        // Without a terminal there is nothing to clear, and no failure.
        let _ = self.bars.clear();
    }
}
