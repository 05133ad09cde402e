//! Checks that the table of cases and the errata in `docs/conformance.md` are those of the suite.

use conformance::cases::all;
use conformance::report::table;
use conformance::vectors;

const DOCUMENT: &str = include_str!("../../../docs/conformance.md");

#[test]
fn table_of_cases_is_the_list() {
    let list = table::list(&all());
    assert!(
        DOCUMENT.contains(&list),
        "put the output of `modio-conformance --list` into docs/conformance.md:\n{list}"
    );
    let count = format!("{} cases", all().len());
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
