//! What `modioctl update` prints on standard output.

use register_map::update::BLOCK_BYTES;
use serde_json::{Value as Json, json};

use super::drive::Times;
use super::found::Found;
use crate::bus::Endpoint;
use crate::failure::Failure;
use crate::output;
use crate::update::file::Version;
use crate::update::{Stage, Unit};

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

/// Prints what the units run, and what their other slots hold.
pub fn show(found: &[Found], json: bool) -> Result<(), Failure> {
    let trial = |unit: &Found| if unit.trial { "on trial" } else { "confirmed" };
    if json {
        let units = found.iter().map(|unit| {
            json!({
                "unit": unit.address,
                "board": unit.board_name(),
                "slot": format!("{:?}", unit.status.slot),
                "runs": Version(unit.runs()).to_string(),
                "state": trial(unit),
                "other": unit.other(),
                "floor": unit.status.floor,
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
            Version(unit.runs()).to_string(),
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
            _ if unit.target == found.status.slot && !found.trial => "runs it already",
            _ => "confirmed",
        };
        let [before, after] = [found.runs(), unit.image()].map(|words| Version(words).to_string());
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
            let failure = ended.iter().find_map(|ended| match ended.stage {
                Stage::Failed(fault) if ended.address == *unit => Some(fault.to_string()),
                _ => None,
            });
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
