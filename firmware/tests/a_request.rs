//! Checks that the files and functions of `docs/a-request.md` exist.

use std::fs;
use std::path::Path;

/// Returns the parts of a cell that are code.
fn code(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

#[test]
fn every_step_of_a_request_names_files_and_functions_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let page = fs::read_to_string(root.join("docs/a-request.md")).expect("the page");
    let mut steps = 0;
    for row in page
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains(".rs`"))
    {
        let [.., files, functions, _] = row.split('|').collect::<Vec<_>>()[..] else {
            panic!("no row of a step: {row}");
        };
        let read =
            |file| fs::read_to_string(root.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
        let sources: Vec<String> = code(files).map(read).collect();
        let has = |source: &String, name| {
            [format!("fn {name}("), format!("fn {name}<")]
                .iter()
                .any(|text| source.contains(text))
        };
        for name in code(functions) {
            assert!(
                sources.iter().any(|source| has(source, name)),
                "no function {name}: {row}"
            );
        }
        for (file, source) in code(files).zip(&sources) {
            assert!(
                code(functions).any(|name| has(source, name)),
                "nothing of {file}: {row}"
            );
        }
        steps += 1;
    }
    assert!(steps > 20, "{steps} steps");
}
