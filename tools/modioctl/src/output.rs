//! Standard output. When the reader closes it, as `head` does, the program ends without an error message.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write, stdout};

use crate::failure::Failure;

/// Prints a line.
///
/// # Errors
///
/// When the line cannot be written, for example to a full disk.
pub fn line(text: Arguments<'_>) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => Err(Failure::usage(format!("cannot write the output: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// Prints a value as JSON.
///
/// # Errors
///
/// When the output cannot be written.
pub fn json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(Failure::usage)?;
    line(format_args!("{text}"))
}

/// Prints rows in columns.
///
/// # Errors
///
/// When the output cannot be written.
pub fn table<const COLUMNS: usize>(rows: &[[String; COLUMNS]]) -> Result<(), Failure> {
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::NOTHING);
    for row in rows {
        table.add_row(row);
    }
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    line(format_args!("{}", table.trim_fmt()))
}
