//! `docs/conformance.md` tells the truth: its table of cases and its errata are those of the suite.

use conformance::cases::all;
use conformance::report::table;
use conformance::vectors;

const DOCUMENT: &str = include_str!("../../../docs/conformance.md");

#[test]
fn the_table_of_cases_is_the_list() {
    let list = table::list(&all());
    assert!(
        DOCUMENT.contains(&list),
        "put the output of `modio-conformance --list` into docs/conformance.md:\n{list}"
    );
    let count = format!("{} cases", all().len());
    assert!(DOCUMENT.contains(&count), "the document says {count}");
}

#[test]
fn the_errata_are_those_of_the_worked_frames() {
    let errata = vectors::errata();
    assert!(
        DOCUMENT.contains(&errata),
        "put this into docs/conformance.md:\n{errata}"
    );
}
