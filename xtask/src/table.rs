//! Tables for a terminal.

use comfy_table::{CellAlignment, Row, Table, presets::NOTHING};

/// Returns a table with these headings, without spaces at the ends of lines.
pub fn text<R: Into<Row>>(headings: &[&str], rows: impl IntoIterator<Item = R>) -> String {
    trimmed(&table(headings, rows))
}

/// Returns a table of figures, which are aligned to the right: every column except the first.
pub fn figures<R: Into<Row>>(headings: &[&str], rows: impl IntoIterator<Item = R>) -> String {
    let mut table = table(headings, rows);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    trimmed(&table)
}

fn table<R: Into<Row>>(headings: &[&str], rows: impl IntoIterator<Item = R>) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING).set_header(headings);
    table.add_rows(rows);
    table
}

fn trimmed(table: &Table) -> String {
    let lines = table.lines().map(|line| line.trim_end().to_owned());
    lines.collect::<Vec<_>>().join("\n")
}
