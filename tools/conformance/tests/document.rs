//! Checks that `docs/conformance-cases.md`, and the errata in `docs/conformance.md`, are those of the suite.

use conformance::cases::{all, of_bench};
use conformance::report::table;
use conformance::vectors;

const CASES: &str = include_str!("../../../docs/conformance-cases.md");
const DOCUMENT: &str = include_str!("../../../docs/conformance.md");

#[test]
fn page_of_cases_is_the_list() {
    let cases = [all(), of_bench()].concat();
    assert!(
        CASES == table::list(&cases),
        "renew it: cargo run -p conformance -- --list > docs/conformance-cases.md"
    );
    let count = format!("{} cases", cases.len());
    assert!(DOCUMENT.contains(&count), "the document says {count}");
}

#[test]
fn errata_are_those_of_the_worked_frames() {
    let errata = vectors::errata();
    assert!(
        DOCUMENT.contains(&errata),
        "put this into docs/conformance.md:\n{errata}"
    );
}
