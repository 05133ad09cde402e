//! `modioctl update`.

mod drive;
mod found;
mod progress;
mod record;
mod report;

use std::collections::BTreeMap;
use std::time::Duration;

use register_map::update::{Reason, Slot};

use super::note::Note;
use super::watch::chosen;
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Observer};
use crate::cli::Update;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::update::{Campaign, Fault, File, Stage, Unit};
use drive::{Drive, Poll};
use found::{Found, look};
use progress::Progress;
use record::fault_record;
use report::{Transfer, report, show_file, show_units};

/// What is added to the time of the longest answer until a unit counts as silent for now.
const MARGIN: Duration = Duration::from_millis(100);

/// Shows what is in the file.
pub fn show(options: &Update, json: bool) -> Result<(), Failure> {
    let file = options.file.as_deref().map(File::read).transpose()?;
    file.map_or(Ok(()), |file| show_file(&file, json))
}

/// Updates units, or shows what they run.
pub async fn run(
    endpoint: Endpoint,
    observer: Option<Observer>,
    options: &Update,
    json: bool,
    note: &Note,
) -> Result<(), Failure> {
    let file = options.file.as_deref().map(File::read).transpose()?;
    let mut device = Device::open(endpoint, observer).await?;
    let only = [device.unit];
    let addresses = options.units.as_deref().unwrap_or(&only);
    let mut found = Vec::new();
    let mut failed = Vec::new();
    for address in addresses {
        match look(&mut device, *address).await {
            Ok(unit) => found.push(unit),
            Err(failure @ Failure::Port(_)) => return Err(failure),
            Err(failure) => failed.push(failure),
        }
    }
    if options.status {
        show_units(&found, json)?;
        warn_of_development(&found);
        say_of_ended_keys(&found);
        return report_all(failed);
    }
    let is_left_out =
        |found: &Found, unit: &Unit| !options.force && found.loses_settings(unit.stage);
    let mut units = Vec::new();
    let mut ended_keys = Vec::new();
    for unit in &found {
        let fits = match &file {
            Some(file) => unit.unit(file, options.force).and_then(|fits| {
                let is_needed = fits.stage != Stage::Done;
                if is_needed || options.end_first_key {
                    let ends = unit.ends_first_key(file, options.end_first_key)?;
                    let takes_part = is_needed && !is_left_out(unit, &fits);
                    ended_keys.extend((ends && takes_part).then_some(unit.address));
                }
                Ok(fits)
            }),
            None => unit.back(),
        };
        match fits {
            Ok(mut fits) => {
                if is_left_out(unit, &fits) {
                    fits.stage = Stage::Failed(Fault::Unsaved);
                }
                units.push(fits);
            }
            Err(what) => failed.push(Failure::Usage(format!("unit {} {what}", unit.address))),
        }
    }
    let names = named(&ended_keys);
    if !ended_keys.is_empty() && !options.end_first_key {
        failed.push(Failure::Usage(format!(
            "the file is signed with the second key of {names}, so it ends the first key there, for good: give --end-first-key if that is what you want"
        )));
    }
    refuse(&failed)?;
    warn_of_development(&found);
    if !ended_keys.is_empty() {
        eprintln!(
            "modioctl: this update ends the first key of {names}, for good: neither SW01 = 254 nor 0xB004 (`--back`) leads back to an image by the first key"
        );
    }
    let poll = poll(&mut device, &options.poll, json).await?;
    let endpoint = device.master.endpoint();
    let longest = found.iter().map(|unit| unit.time).max();
    let little = match endpoint.timeout_given {
        true => endpoint.timeout,
        false => endpoint.timeout.min(longest.unwrap_or_default() + MARGIN),
    };
    // The rate of the line behind a server of Modbus TCP is not known, so broadcasts could be too fast.
    let unicast = options.unicast || endpoint.framing == Framing::Mbap;
    note.set("the same command goes on where it stopped");
    let mut drive = Drive {
        device: &mut device,
        little,
        poll,
        progress: Progress::default(),
    };
    let mut transfers = Vec::new();
    let mut ended = Vec::new();
    let mut broken = None;
    for units in groups(file.as_ref(), units) {
        if broken.is_some() {
            ended.extend(units);
            continue;
        }
        let slot = units.first().map_or(Slot::A, |unit| unit.target);
        let blocks = file.as_ref().map(|file| file.image(slot).blocks.as_slice());
        let mut campaign = Campaign::new(blocks.unwrap_or_default(), units, unicast);
        let result = drive.run(&mut campaign).await;
        drive.progress.clear();
        match result {
            Ok(times) => transfers.push(Transfer {
                times,
                blocks: blocks.map_or(0, <[_]>::len),
                sent: campaign.blocks().0,
                unicast: campaign.is_unicast(),
            }),
            Err(failure) => broken = Some(failure),
        }
        ended.extend_from_slice(campaign.units());
    }
    let faults = faults(&mut device, &ended).await;
    report(
        &found,
        &ended,
        &faults,
        &transfers,
        device.master.endpoint(),
        json,
    )?;
    let failures = ended.iter().filter_map(|unit| failure(unit, &faults));
    let failures = failures.collect();
    if let Some(broken) = broken {
        show_all(failures);
        return Err(broken);
    }
    note.set("");
    report_all(failures)
}

/// Returns why units were not updated, by address.
async fn faults(device: &mut Device, units: &[Unit]) -> BTreeMap<u8, String> {
    let mut faults = BTreeMap::new();
    for unit in units {
        let Stage::Failed(fault) = unit.stage else {
            continue;
        };
        let mut text = fault.to_string();
        if fault == Fault::Rejected(Reason::NotConfirmed)
            && let Ok(record) = fault_record(device, unit.address).await
        {
            text = format!("{text}; {record}");
        }
        faults.insert(unit.address, text);
    }
    faults
}

/// Returns the failure of a unit that was not updated.
fn failure(unit: &Unit, faults: &BTreeMap<u8, String>) -> Option<Failure> {
    let text = faults.get(&unit.address)?;
    let text = format!("unit {} {text}", unit.address);
    Some(match unit.stage {
        Stage::Failed(Fault::Silent) => Failure::NoAnswer(text),
        _ => Failure::Refused(text),
    })
}

/// Returns the units that are updated together: those that take the image for the same slot. The way back has no image.
fn groups(file: Option<&File>, units: Vec<Unit>) -> Vec<Vec<Unit>> {
    let (a, b): (Vec<_>, Vec<_>) = units
        .into_iter()
        .partition(|unit| file.is_none() || unit.target == Slot::A);
    let groups = [a, b].into_iter();
    groups.filter(|units| !units.is_empty()).collect()
}

/// Fails with all units that cannot be updated, in one line.
fn refuse(failed: &[Failure]) -> Result<(), Failure> {
    let Some(first) = failed.first() else {
        return Ok(());
    };
    let text: Vec<_> = failed.iter().map(Failure::to_string).collect();
    let text = format!("nothing was sent: {}", text.join("; "));
    Err(match first {
        Failure::NoAnswer(_) => Failure::NoAnswer(text),
        Failure::Garbled(_) => Failure::Garbled(text),
        Failure::Busy(_) => Failure::Busy(text),
        _ => Failure::Usage(text),
    })
}

/// Reports each failure on a separate line. Fails with the last one.
fn report_all(mut failed: Vec<Failure>) -> Result<(), Failure> {
    // The exit status is 1 if any unit refuses.
    failed.sort_by_key(|failure| std::cmp::Reverse(failure.status()));
    let last = failed.pop();
    show_all(failed);
    last.map_or(Ok(()), Err)
}

fn show_all(failed: Vec<Failure>) {
    for failure in failed {
        eprintln!("modioctl: {failure}");
    }
}

/// Reports in one line which units accept a development key.
fn warn_of_development(found: &[Found]) {
    if let Some(units) = those(found, Found::development) {
        eprintln!(
            "modioctl: a development key, which everybody has, is accepted by {units}: anybody on the line can install any firmware there (docs/update.md, Keys)"
        );
    }
}

/// Reports in one line which units have ended their first key.
fn say_of_ended_keys(found: &[Found]) {
    if let Some(units) = those(found, |unit| unit.status.revoked) {
        eprintln!(
            "modioctl: the first key is ended in {units}: only the second signs updates there"
        );
    }
}

/// Names the units for which this holds, if there are any.
fn those(found: &[Found], holds: impl Fn(&Found) -> bool) -> Option<String> {
    let units = found.iter().filter(|unit| holds(unit));
    let units: Vec<_> = units.map(|unit| unit.address).collect();
    (!units.is_empty()).then(|| named(&units))
}

/// Names units for people: unit 4; units 1-3, 7.
fn named(addresses: &[u8]) -> String {
    let follow = |one: &u8, next: &u8| one + 1 == *next;
    let ranges = addresses.chunk_by(follow).map(|range| match range {
        [first, .., last] => format!("{first}-{last}"),
        range => range.iter().map(u8::to_string).collect(),
    });
    let ranges: Vec<_> = ranges.collect();
    let units = if addresses.len() == 1 {
        "unit"
    } else {
        "units"
    };
    format!("{units} {}", ranges.join(", "))
}

/// Returns the poll of the points with these names.
async fn poll(device: &mut Device, names: &[String], json: bool) -> Result<Option<Poll>, Failure> {
    if names.is_empty() {
        return Ok(None);
    }
    let items = chosen(&fetch(device).await?.book, names)?;
    Ok(Some(Poll::new(items, json)))
}
