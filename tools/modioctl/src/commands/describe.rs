//! `modioctl describe`.

use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::listing::{as_json, values};
use crate::output;
use crate::value::table_name;

/// Lists the unit's points and registers.
pub async fn run(device: &mut Device, json: bool) -> Result<(), Failure> {
    let learned = fetch(device).await?;
    let about = learned.book.of_modio()?;
    let items = learned.book.items();
    if json {
        return output::json(&as_json(&learned.book, &learned.source)?);
    }
    output::line(format_args!(
        "{} ({}), firmware {}, register map {}; from {}",
        about.board, about.model, about.firmware, about.map_version, learned.source
    ))?;
    let rows: Vec<_> = items
        .iter()
        .map(|item| {
            let access = match (item.writable, item.restart) {
                (false, _) => "read",
                (true, false) => "write",
                (true, true) => "write, restart",
            };
            [
                format!("{:#06X}", item.address),
                item.name.clone(),
                table_name(item.table).to_owned(),
                access.to_owned(),
                item.about.clone(),
                values(item).trim_start_matches("it takes ").to_owned(),
            ]
        })
        .collect();
    output::table(&rows)
}
