//! The table of servers, and its place in the document.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{Failure, Result};

/// What stands before and after the table in the document.
const BEGIN: &str = "<!-- `cargo xtask peers` writes from here -->\n";
const END: &str = "<!-- to here -->\n";

/// What came of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    name: String,
    version: String,
    /// Number of cases that passed.
    pub passed: usize,
    failed: usize,
    skipped: usize,
    /// Groups of cases with the number of those that failed, in the order of the suite.
    groups: Vec<(String, usize)>,
}

impl Row {
    /// Counts the cases of the suite's report.
    ///
    /// # Errors
    ///
    /// When the report has no cases.
    pub fn new(name: &str, version: &str, report: &Value) -> Result<Self> {
        let cases = report["cases"].as_array();
        let cases = cases.ok_or_else(|| Failure::new("modio-conformance reports no cases"))?;
        let mut row = Self {
            name: name.to_owned(),
            version: version.to_owned(),
            passed: 0,
            failed: 0,
            skipped: 0,
            groups: Vec::new(),
        };
        for case in cases {
            match case["result"].as_str() {
                Some("passed") => row.passed += 1,
                Some("skipped") => row.skipped += 1,
                _ => row.count_failure(case["name"].as_str().unwrap_or_default()),
            }
        }
        Ok(row)
    }

    fn count_failure(&mut self, case: &str) {
        self.failed += 1;
        let group = case.split('/').next().unwrap_or(case);
        match self.groups.iter_mut().find(|(name, _)| name == group) {
            Some((_, count)) => *count += 1,
            None => self.groups.push((group.to_owned(), 1)),
        }
    }
}

/// The table in Markdown, and below it what is missing.
pub(super) fn text(rows: &[Row], missing: &[String]) -> String {
    let mut text =
        "| server | version | passed | failed | could not be asked | failed cases by group |\n\
                    |---|---|---|---|---|---|\n"
            .to_owned();
    for row in rows {
        let groups: Vec<String> = row
            .groups
            .iter()
            .map(|(name, count)| format!("`{name}` {count}"))
            .collect();
        // A String takes everything.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            row.name,
            row.version,
            row.passed,
            row.failed,
            row.skipped,
            groups.join(", ")
        );
    }
    for line in missing {
        let _ = write!(text, "\nLeft out: {line}.\n");
    }
    text
}

/// The document with another table.
pub(super) fn replaced(document: &str, table: &str) -> Option<String> {
    let (before, rest) = document.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}{table}{END}{after}"))
}

/// Writes the table into the document.
///
/// # Errors
///
/// When the document cannot be read or written, or has no place for the table.
pub(super) fn replace_in(path: &Path, table: &str) -> Result<()> {
    let told = |why: String| Failure::new(format!("{}: {why}", path.display()));
    let document = fs::read_to_string(path).map_err(|error| told(error.to_string()))?;
    let document = replaced(&document, table)
        .ok_or_else(|| told(format!("no line {:?}, or none {:?} after it", BEGIN, END)))?;
    fs::write(path, document).map_err(|error| told(error.to_string()))
}
