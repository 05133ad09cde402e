//! Standard output and files. When the reader closes it, as `head` does, the program ends without an error message.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, ErrorKind, Write, stdout};
use std::path::Path;

use crate::failure::Failure;

/// Prints a line.
pub fn line(text: impl Display) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => Err(Failure::usage(format!("cannot write the output: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// Prints a value as JSON.
pub fn json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value).map_err(Failure::usage)?;
    line(text)
}

/// Prints rows in columns.
pub fn table<const COLUMNS: usize>(rows: &[[String; COLUMNS]]) -> Result<(), Failure> {
    let mut table = comfy_table::Table::new();
    table.load_preset(comfy_table::presets::NOTHING);
    for row in rows {
        table.add_row(row);
    }
    for column in table.column_iter_mut() {
        column.set_padding((0, 2));
    }
    line(table.trim_fmt())
}

/// Creates a file. Overwrites an existing one only with `force`. A device or a pipe is no existing file.
pub fn create(path: &Path, force: bool) -> Result<File, Failure> {
    if path.is_file() && !force {
        return Err(Failure::usage(format!(
            "{} exists: choose another name, or overwrite it with --force",
            path.display()
        )));
    }
    File::create(path).map_err(|error| not_written(path, &error))
}

/// Writes a text to a file, and reports that on standard error; or prints the text if no file is given.
pub fn save(text: &str, path: Option<&Path>, force: bool) -> Result<(), Failure> {
    let Some(path) = path else {
        return line(text.trim_end());
    };
    let written = create(path, force)?.write_all(text.as_bytes());
    written.map_err(|error| not_written(path, &error))?;
    eprintln!("modioctl: wrote {}", path.display());
    Ok(())
}

/// Returns the failure for a file that cannot be written.
pub fn not_written(path: &Path, error: &io::Error) -> Failure {
    Failure::usage(format!("cannot write {}: {error}", path.display()))
}

/// Returns a text as a field of a CSV file (RFC 4180). A text that a spreadsheet would calculate gets `'` in front; a
/// number stays a number.
pub fn csv_field(text: &str) -> String {
    let is_number = text.parse().is_ok_and(f64::is_finite);
    let is_formula = text.len() > 1 && text.starts_with(['=', '+', '-', '@']) && !is_number;
    let field = if is_formula {
        format!("'{text}")
    } else {
        text.to_owned()
    };
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_field_quotes_formulas_and_leaves_numbers() {
        for (text, field) in [
            ("-12.5", "-12.5"),
            ("-", "-"),
            ("plain", "plain"),
            ("=1+1", "'=1+1"),
            ("+1-1", "'+1-1"),
            ("-inf", "'-inf"),
            ("@SUM(A1,A2)", "\"'@SUM(A1,A2)\""),
            ("a \"b\"", "\"a \"\"b\"\"\""),
            ("-12,5", "\"'-12,5\""),
        ] {
            assert_eq!(csv_field(text), field);
        }
    }

    #[test]
    fn existing_file_is_overwritten_only_with_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("unit.toml");
        save("1\n", Some(&path), false).unwrap();
        let error = save("2\n", Some(&path), false).unwrap_err();
        assert_eq!(error.status(), 2);
        assert!(error.to_string().contains("--force"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "1\n");
        save("2\n", Some(&path), true).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "2\n");
        assert!(create(folder.path(), true).is_err(), "a folder");
    }
}
