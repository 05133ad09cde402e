//! Runs steps of a command: all of them even when one fails, and a summary follows.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use crate::error::Missing;
use crate::table;

/// A step that has been run.
#[derive(Clone, Debug)]
pub struct Done {
    pub name: String,
    /// `passed`, `FAILED` or `skipped`.
    pub outcome: &'static str,
    /// The reason of a failure, or why the step could not run on this machine.
    pub why: String,
    pub took: Duration,
}

/// Runs one step and prints its outcome. When `strict`, a step whose tool is missing fails; otherwise it is skipped.
pub fn timed(name: &str, what: &str, strict: bool, run: impl FnOnce() -> Result<()>) -> Done {
    eprintln!("==> {name}: {what}");
    let begin = Instant::now();
    let (outcome, why) = match run() {
        Ok(()) => ("passed", String::new()),
        Err(error) if error.is::<Missing>() && !strict => ("skipped", format!("{error:#}")),
        Err(error) => ("FAILED", format!("{error:#}")),
    };
    if outcome != "passed" {
        eprintln!("==> {name} {outcome}: {why}");
    }
    Done {
        name: name.to_owned(),
        outcome,
        why,
        took: begin.elapsed(),
    }
}

/// Prints the table of steps, and the line `N passed, N failed, N skipped` after it.
pub fn finish(done: &[Done]) -> Result<()> {
    say!("\n{}", summary(done));
    let failed = done.iter().filter(|done| done.outcome == "FAILED");
    let failed: Vec<_> = failed.map(|done| done.name.as_str()).collect();
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    Ok(())
}

fn summary(done: &[Done]) -> String {
    let rows = done.iter().map(|done| {
        let took = format!("{} s", done.took.as_secs());
        [&done.name, done.outcome, &took, &done.why].map(str::to_owned)
    });
    let table = table::text(&["step", "outcome", "time", "why"], rows);
    let count = |outcome| done.iter().filter(|done| done.outcome == outcome).count();
    let [passed, failed, skipped] = ["passed", "FAILED", "skipped"].map(count);
    format!("{table}\n{passed} passed, {failed} failed, {skipped} skipped")
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;

    use super::*;
    use crate::error::missing;

    #[test]
    fn missing_tool_skips_a_step_unless_strict_and_failed_steps_are_an_error() {
        let skipped = |strict| timed("two", "", strict, || Err(missing("no Python")));
        let mut all = vec![timed("one", "", false, || Ok(())), skipped(false)];
        finish(&all).unwrap();
        all.push(timed("three", "", false, || Err(anyhow!("broken"))));
        let text = summary(&all);
        assert!(text.ends_with("\n1 passed, 1 failed, 1 skipped"), "{text}");
        assert!(text.contains("FAILED") && text.contains("broken"), "{text}");
        assert_eq!(finish(&all).unwrap_err().to_string(), "failed: three");
        assert!(finish(&[skipped(true)]).is_err());
    }
}
