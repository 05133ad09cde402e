//! Checks that docs/register-map.md matches the register map.

use std::{fs, path::Path};

#[test]
fn the_document_is_up_to_date() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/register-map.md");
    let written = fs::read_to_string(&path).unwrap_or_default();
    let mut current = String::new();
    register_map::docs::write_markdown(&mut current).unwrap();
    let stale = written
        .lines()
        .zip(current.lines())
        .find(|(written, current)| written != current);
    assert!(
        written == current,
        "docs/register-map.md is out of date or missing; write it with: cargo xtask docs\nfirst difference: {stale:#?}"
    );
}
