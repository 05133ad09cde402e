//! `modioctl export`.

use crate::adapter::{is_numbered, is_socket, lasting_name};
use crate::bus::Place;
use crate::cli::Export;
use crate::device::{Device, fetch};
use crate::export::{Line, Source, text};
use crate::failure::Failure;
use crate::output;
use crate::warnings::of_export;

/// Writes a configuration of another system for the unit, or for several units of the line.
pub async fn run(device: &mut Device, options: &Export) -> Result<(), Failure> {
    let only = [device.unit];
    let addresses = options.units.as_deref().unwrap_or(&only);
    let mut units = Vec::new();
    for address in addresses {
        device.unit = *address;
        units.push(source(device).await.map_err(|failure| {
            if addresses.len() == 1 {
                return failure;
            }
            failure.while_doing(format!(
                "no export without unit {address}; connect it, or leave it out of --units"
            ))
        })?);
    }
    for source in &units {
        if let Some(warning) = of_export(&source.book, source.unit) {
            eprintln!("modioctl: warning: {warning}");
        }
    }
    let mut endpoint = device.master.endpoint().clone();
    if let Place::Serial(port) = &mut endpoint.place
        && let Some(lasting) = lasting_name(port)
    {
        *port = lasting;
    }
    let text = text(
        options.format,
        Line {
            name: options.name.as_deref(),
            endpoint: &endpoint,
            units: &units,
        },
    )?;
    if let Place::Serial(port) = &endpoint.place
        && text.contains(port)
    {
        if is_numbered(port) {
            eprintln!(
                "modioctl: warning: {port} can be another adapter after a restart of the computer: see `modioctl ports` for a name that stays"
            );
        } else if is_socket(port) {
            eprintln!(
                "modioctl: warning: {port} is a USB socket of this computer: another computer has other names, and the adapter must stay in this socket"
            );
        }
    }
    output::save(&text, options.output.as_deref(), options.force)
}

/// Learns the names of the unit.
async fn source(device: &mut Device) -> Result<Source, Failure> {
    let learned = fetch(device).await?;
    learned.book.of_modio()?;
    let held = device.held(&learned.book, learned.book.points()).await?;
    Ok(Source {
        unit: device.unit,
        held,
        book: learned.book,
        source: learned.source,
    })
}
