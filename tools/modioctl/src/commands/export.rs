//! `modioctl export`.

use std::path::Path;

use crate::cli::Export;
use crate::device::{Device, fetch};
use crate::export::{Source, text};
use crate::failure::Failure;
use crate::output;

/// Writes a configuration of another system for the unit.
///
/// # Errors
///
/// When the unit does not answer, when the system cannot use the endpoint, or when the file cannot be written.
pub async fn run(device: &mut Device, options: &Export) -> Result<(), Failure> {
    let learned = fetch(device).await?;
    let text = text(
        options.format,
        Source {
            book: &learned.book,
            endpoint: device.master.endpoint(),
            source: &learned.source,
        },
    )?;
    match options.output.as_deref() {
        None => output::line(format_args!("{}", text.trim_end())),
        Some(path) => write(path, &text),
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text)
        .map_err(|error| Failure::usage(format!("cannot write {}: {error}", path.display())))
}
