//! The steps of `cargo xtask test` and `cargo xtask ci`: all of them run even when one fails, and a summary follows.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow, bail};
use register_map::Board;

use crate::error::{Missing, usage};
use crate::table;
use crate::workspace::Workspace;
use crate::{build, steps};

/// Outcome of a step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The step found no error.
    Passed,
    /// The step failed, with the reason.
    Failed(String),
    /// The step could not run on this machine, with the reason.
    Skipped(String),
}

impl Outcome {
    fn new(result: Result<()>, strict: bool) -> Self {
        match result {
            Ok(()) => Self::Passed,
            Err(error) if error.is::<Missing>() && !strict => Self::Skipped(format!("{error:#}")),
            Err(error) => Self::Failed(format!("{error:#}")),
        }
    }

    /// Returns the word for the outcome, and the reason.
    pub fn words(&self) -> (&'static str, &str) {
        match self {
            Self::Passed => ("passed", ""),
            Self::Failed(why) => ("FAILED", why),
            Self::Skipped(why) => ("skipped", why),
        }
    }
}

/// Data that the steps of a run share.
pub struct Bench<'a> {
    /// The project on this machine.
    pub workspace: &'a mut Workspace,
    /// Whether host tests leave out the simulator.
    pub host: bool,
    images: BTreeMap<&'static str, Result<PathBuf, String>>,
}

impl<'a> Bench<'a> {
    /// Returns a bench on which no image is built yet.
    pub fn new(workspace: &'a mut Workspace, host: bool) -> Self {
        Self {
            workspace,
            host,
            images: BTreeMap::new(),
        }
    }

    /// Returns the image of a board, which the first step that needs it builds.
    pub fn image(&mut self, board: &'static Board) -> Result<PathBuf> {
        let image = self.images.entry(board.name).or_insert_with(|| {
            let built = build::image(self.workspace, board);
            built
                .map(|image| image.elf)
                .map_err(|error| format!("{error:#}"))
        });
        let image = image.clone();
        image.map_err(|why| anyhow!("no image of the {board}: {why}"))
    }
}

type Run = Box<dyn Fn(&mut Bench) -> Result<()>>;

/// Which command runs a step when no step is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum In {
    /// `cargo xtask test --host`, `cargo xtask test` and `cargo xtask ci`.
    Host,
    /// `cargo xtask test` and `cargo xtask ci`.
    Test,
    /// `cargo xtask ci` only.
    Ci,
}

/// A step.
pub struct Step {
    /// The short name, which does not change.
    pub name: String,
    /// The command that runs the step.
    pub part_of: In,
    what: String,
    run: Run,
}

impl Step {
    /// Returns a step with its name, its description and its function.
    pub fn new(
        part_of: In,
        name: impl Into<String>,
        what: impl Into<String>,
        run: impl Fn(&mut Bench) -> Result<()> + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            part_of,
            what: what.into(),
            run: Box::new(run),
        }
    }
}

/// Returns the short name of a board in names of steps: `02` for modio-02.
pub fn short(board: &Board) -> &'static str {
    board.name.rsplit('-').next().unwrap_or(board.name)
}

/// Returns the steps of these names, in the order of `all`, or the steps of the command if there are no names.
pub fn chosen(all: Vec<Step>, names: &[String], command: In) -> Result<Vec<Step>> {
    if let Some(name) = names
        .iter()
        .find(|name| !all.iter().any(|step| step.name == **name))
    {
        return Err(usage(format!("no step {name:?}; --list shows the steps")));
    }
    let wanted = |step: &Step| match names {
        [] => step.part_of <= command,
        names => names.contains(&step.name),
    };
    Ok(all.into_iter().filter(wanted).collect())
}

/// Prints the names of the steps.
pub fn list(all: &[Step]) {
    let mut table = table::new(["step", "runs in", "what"]);
    for step in all {
        let part_of = match step.part_of {
            In::Host => "test --host, test, ci",
            In::Test => "test, ci",
            In::Ci => "ci",
        };
        table.add_row([&step.name, part_of, &step.what]);
    }
    say!("{}", table::text(&table));
}

/// Runs steps and prints a summary. When `strict`, a step whose tool is missing fails; otherwise it is skipped.
pub fn run(all: &[Step], bench: &mut Bench, strict: bool) -> Result<()> {
    let mut done = Vec::new();
    for step in all {
        done.push(timed(&step.name, &step.what, strict, || (step.run)(bench)));
    }
    steps::finish(&done)
}

/// A step that has been run: name, outcome, and duration.
pub type Done = (String, Outcome, Duration);

/// Runs one step and prints its outcome.
pub fn timed(name: &str, what: &str, strict: bool, run: impl FnOnce() -> Result<()>) -> Done {
    eprintln!("==> {name}: {what}");
    let begin = Instant::now();
    let outcome = Outcome::new(run(), strict);
    let took = begin.elapsed();
    match outcome.words() {
        ("passed", _) => {}
        (word, why) => eprintln!("==> {name} {word}: {why}"),
    }
    (name.to_owned(), outcome, took)
}

/// Prints the table of steps, and the line `N passed, N failed, N skipped` after it.
pub fn finish(done: &[Done]) -> Result<()> {
    say!("\n{}", summary(done));
    let failed = |done: &&Done| matches!(done.1, Outcome::Failed(_));
    let failed: Vec<_> = done
        .iter()
        .filter(failed)
        .map(|done| done.0.as_str())
        .collect();
    if !failed.is_empty() {
        bail!("failed: {}", failed.join(", "));
    }
    Ok(())
}

fn summary(done: &[Done]) -> String {
    let mut table = table::new(["step", "outcome", "time", "why"]);
    for (name, outcome, took) in done {
        let (word, why) = outcome.words();
        table.add_row([name, word, &format!("{} s", took.as_secs()), why]);
    }
    let count = |word| done.iter().filter(|done| done.1.words().0 == word).count();
    let [passed, failed, skipped] = ["passed", "FAILED", "skipped"].map(count);
    let table = table::text(&table);
    format!("{table}\n{passed} passed, {failed} failed, {skipped} skipped")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn done(name: &str, result: Result<()>) -> Done {
        (
            name.to_owned(),
            Outcome::new(result, false),
            Duration::from_secs(2),
        )
    }

    #[test]
    fn summary_counts_and_failed_steps_are_an_error() {
        let skipped = done("two", Err(Missing("no Python".to_owned()).into()));
        finish(&[done("one", Ok(())), skipped.clone()]).unwrap();
        let all = [
            done("one", Ok(())),
            skipped,
            done("three", Err(anyhow!("broken"))),
        ];
        let text = summary(&all);
        assert!(text.ends_with("\n1 passed, 1 failed, 1 skipped"), "{text}");
        assert!(text.contains("FAILED") && text.contains("broken"), "{text}");
        let error = finish(&all).unwrap_err().to_string();
        assert_eq!(error, "failed: three");
    }

    #[test]
    fn missing_tool_fails_when_strict() {
        let missing = || Err(Missing("no Python".to_owned()).into());
        assert!(matches!(Outcome::new(missing(), true), Outcome::Failed(_)));
        assert!(matches!(
            Outcome::new(missing(), false),
            Outcome::Skipped(_)
        ));
    }

    #[test]
    fn steps_are_chosen_by_command_or_name() {
        let all = || {
            let step = |part_of, name: &str| Step::new(part_of, name, "", |_| Ok(()));
            vec![step(In::Ci, "a"), step(In::Host, "b"), step(In::Test, "c")]
        };
        let names = |names: &[&str], command| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            let chosen = chosen(all(), &names, command);
            chosen.map(|steps| steps.into_iter().map(|step| step.name).collect::<String>())
        };
        assert_eq!(names(&[], In::Host).unwrap(), "b");
        assert_eq!(names(&[], In::Test).unwrap(), "bc");
        assert_eq!(names(&[], In::Ci).unwrap(), "abc");
        assert_eq!(names(&["c", "a"], In::Test).unwrap(), "ac");
        let error = names(&["d"], In::Test).unwrap_err();
        assert!(error.is::<crate::error::Usage>(), "{error}");
    }
}
