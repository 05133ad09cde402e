//! Tables for a terminal.

use comfy_table::{CellAlignment, Table, presets::NOTHING};

/// Returns an empty table with these headings.
pub fn new<'a>(headings: impl IntoIterator<Item = &'a str>) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING).set_header(headings);
    table
}

/// Aligns the figures to the right: every column except the first.
pub fn figures(table: &mut Table) {
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// Returns the text, without spaces at the ends of lines.
pub fn text(table: &Table) -> String {
    let lines: Vec<String> = table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect();
    lines.join("\n")
}
