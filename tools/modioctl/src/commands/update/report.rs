//! What `modioctl update` prints on standard output.

use std::collections::BTreeMap;

use register_map::state;
use register_map::update::BLOCK_BYTES;
use serde_json::{Value as Json, json};

use super::drive::Times;
use super::found::Found;
use crate::bus::Endpoint;
use crate::failure::Failure;
use crate::output;
use crate::update::file::Version;
use crate::update::{File, Image, Stage, Unit, key_name};

/// The transfer of an image to the units with one slot.
pub struct Transfer {
    /// Times of its parts.
    pub times: Times,
    /// Number of blocks of the image.
    pub blocks: usize,
    /// Number of blocks that were sent.
    pub sent: usize,
    /// Whether each unit got them alone.
    pub unicast: bool,
}

impl Transfer {
    /// Describes the transfer on this line.
    fn words(&self, line: &Endpoint) -> String {
        let Times {
            prepare,
            blocks,
            restart,
        } = self.times;
        let [prepare, blocks, restart] = [prepare, blocks, restart].map(|time| time.as_secs_f64());
        let image = line.time_of(self.blocks * BLOCK_BYTES).as_secs_f64();
        let ratio = match image {
            0.0 => String::new(),
            image => format!(
                ", {:.2} times what the image takes on the line",
                blocks / image
            ),
        };
        let alone = match self.unicast {
            true => ", to each unit alone",
            false => "",
        };
        format!(
            "{} blocks sent for {} of the image{alone}: {blocks:.1} s{ratio}; {prepare:.1} s to prepare, {restart:.1} s to check and restart",
            self.sent, self.blocks
        )
    }
}

/// Prints what is in a file.
pub fn show_file(file: &File, json: bool) -> Result<(), Failure> {
    let [image, _] = &file.images;
    let [version, patch, epoch, high, low, ..] = image.words;
    let version = state::version([version, patch], 0).to_string();
    let board = file.board.name;
    let commit = format!("{high:04x}{low:04x}");
    let (key, name) = (image.key(), key_name(image.key()));
    if json {
        let images = file.images.iter().map(|image| {
            let Image {
                slot, bytes, crc, ..
            } = image;
            json!({"slot": format!("{slot:?}"), "bytes": bytes, "crc32": format!("{crc:08x}")})
        });
        return output::json(&json!({
            "board": board,
            "version": version,
            "commit": commit,
            "epoch": epoch,
            "key": format!("{key:08x}"),
            "key_name": name,
            "images": images.collect::<Json>(),
        }));
    }
    let key = match (key, name) {
        (0, _) => "none: it is not signed".to_owned(),
        (key, Some("development")) => format!("{key:08x}, a development key, which everybody has"),
        (key, Some(name)) => format!("{key:08x}, the {name} key of releases"),
        (key, None) => format!("{key:08x}, which this program does not know"),
    };
    let rows = [
        ("board", board.to_owned()),
        ("version", version),
        ("commit", commit),
        ("epoch", epoch.to_string()),
        ("key", key),
    ];
    let rows = rows.map(|(name, text)| [name.to_owned(), text]);
    let images = file.images.iter().map(|image| {
        let Image {
            slot, bytes, crc, ..
        } = image;
        [
            format!("slot {slot:?}"),
            format!("{bytes} bytes, CRC-32 {crc:08x}"),
        ]
    });
    output::table(&rows.into_iter().chain(images).collect::<Vec<_>>())
}

/// Prints what the units run, and what their other slots hold.
pub fn show_units(found: &[Found], json: bool) -> Result<(), Failure> {
    let trial = |unit: &Found| if unit.trial { "on trial" } else { "confirmed" };
    if json {
        let units = found.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "board": unit.board_name(),
                "slot": format!("{:?}", unit.status.slot),
                "runs": unit.running().to_string(),
                "state": trial(unit),
                "other": unit.other(),
                "floor": unit.status.floor,
                "development": unit.development(),
                "first_key_ended": unit.status.revoked,
            })
        });
        return output::json(&units.collect::<Json>());
    }
    let head = ["unit", "board", "slot", "runs", "", "other slot"].map(str::to_owned);
    let rows = found.iter().map(|unit| {
        [
            unit.address.to_string(),
            unit.board_name().to_owned(),
            format!("{:?}", unit.status.slot),
            unit.running().to_string(),
            trial(unit).to_owned(),
            unit.other(),
        ]
    });
    output::table(&std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

/// Prints versions before and after, and the times.
pub fn report(
    found: &[Found],
    ended: &[Unit],
    faults: &BTreeMap<u8, String>,
    transfers: &[Transfer],
    line: &Endpoint,
    json: bool,
) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for found in found {
        let Some(unit) = ended.iter().find(|unit| unit.address == found.address) else {
            continue;
        };
        let result = match unit.stage {
            Stage::Failed(_) => "failed",
            stage if stage != Stage::Done => "not finished",
            _ if unit.target == found.status.slot && !found.trial => "runs it already",
            _ => "confirmed",
        };
        // Files do not say whether they are a release, so neither does this.
        let [before, after] =
            [found.runs(), unit.image()].map(|words| Version::of(words).to_string());
        rows.push((unit.address, before, after, unit.target, result));
    }
    let mut all = Times::default();
    for Transfer { times, .. } in transfers {
        all.prepare += times.prepare;
        all.blocks += times.blocks;
        all.restart += times.restart;
    }
    let [prepare, blocks, restart] =
        [all.prepare, all.blocks, all.restart].map(|time| time.as_secs_f64());
    if json {
        let units = rows.iter().map(|(unit, before, after, slot, result)| {
            let (slot, result) = (format!("{slot:?}"), *result);
            let failure = faults.get(unit);
            json!({
                "unit": unit, "before": before, "after": after, "slot": slot, "result": result, "failure": failure,
            })
        });
        let seconds = json!({"prepare": prepare, "blocks": blocks, "restart": restart});
        return output::json(&json!({"units": units.collect::<Json>(), "seconds": seconds}));
    }
    for (unit, before, after, slot, result) in rows {
        let change = match result {
            "failed" => format!("{before}, not updated to {after}"),
            "not finished" => format!("{before}, the update to {after} is not finished"),
            "runs it already" => format!("{after} in slot {slot:?}, it runs that already"),
            _ => format!("{before} -> {after} in slot {slot:?}, confirmed"),
        };
        output::line(format_args!("unit {unit}: {change}"))?;
    }
    for transfer in transfers.iter().filter(|transfer| transfer.sent > 0) {
        output::line(transfer.words(line))?;
    }
    Ok(())
}
