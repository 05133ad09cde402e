//! `modioctl watch`.

use chrono::{DateTime, Local, SecondsFormat};
use serde_json::{Map, Value as Json, json};
use tokio::time::{MissedTickBehavior, interval};

use crate::bus::Endpoint;
use crate::cli::Watch;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Book, Item};
use crate::output::{self, csv_field};
use crate::trace;
use crate::value::show;

/// Prints values until it is stopped. Waits for a unit that is lost: for a program that reads the output there are rows
/// without values then.
pub async fn run(mut device: Device, options: &Watch, traced: bool) -> Result<(), Failure> {
    let items = chosen(&fetch(&mut device).await?.book, &options.names)?;
    if options.csv {
        let names: Vec<_> = items.iter().map(|item| csv_field(&item.name)).collect();
        output::line(format_args!("time,{}", names.join(",")))?;
    }
    let endpoint = device.master.endpoint().clone();
    let mut device = Some(device);
    let mut ticks = interval(options.every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut lost = false;
    let mut printed = 0;
    while options.count.is_none_or(|count| printed < count) {
        ticks.tick().await;
        match read(&mut device, &endpoint, traced, &items).await {
            Ok(values) => {
                if lost {
                    eprintln!("modioctl: the unit is back");
                    lost = false;
                }
                print(Local::now(), &items, &values, options)?;
                printed += 1;
            }
            Err(failure) if failure.may_pass() => {
                if !lost {
                    eprintln!("modioctl: {failure}; waiting for it");
                    lost = true;
                }
                print_none(Local::now(), &items, options)?;
            }
            Err(failure) => return Err(failure),
        }
    }
    Ok(())
}

/// Reads these items. Opens the port or connection first if it was lost.
async fn read(
    device: &mut Option<Device>,
    endpoint: &Endpoint,
    traced: bool,
    items: &[Item],
) -> Result<Vec<Vec<u16>>, Failure> {
    let mut open = match device.take() {
        Some(open) => open,
        None => Device::open(endpoint.clone(), traced.then(trace::to_stderr)).await?,
    };
    let values = open.read_items(items).await;
    if !matches!(values, Err(Failure::Port(_))) {
        *device = Some(open);
    }
    values
}

/// Returns the items with these names, or all points without names.
pub fn chosen(book: &Book, names: &[String]) -> Result<Vec<Item>, Failure> {
    if !names.is_empty() {
        return book.find_all(names);
    }
    let points: Vec<_> = book.points().cloned().collect();
    if points.is_empty() {
        return Err(Failure::usage(
            "the unit has no points: set a module with `modioctl module set PORT MODULE`, or give the names of registers",
        ));
    }
    Ok(points)
}

/// Prints values that were read at this time, in the form of the options.
pub fn print(
    now: DateTime<Local>,
    items: &[Item],
    values: &[Vec<u16>],
    options: &Watch,
) -> Result<(), Failure> {
    let shown = items.iter().zip(values);
    let shown: Vec<_> = shown
        .map(|(item, words)| show(item, words, options.raw))
        .collect();
    if options.csv {
        let values: Vec<_> = shown.iter().map(|shown| csv_field(&shown.text)).collect();
        return row(now, &values);
    }
    let both = items.iter().zip(&shown);
    if options.json_lines {
        return object(now, both.map(|(item, shown)| (item, shown.json.clone())));
    }
    let values = both.map(|(item, shown)| format!("{} {shown}", item.name));
    let values: Vec<_> = values.collect();
    output::line(format_args!(
        "{}  {}",
        now.format("%H:%M:%S%.3f"),
        values.join("   ")
    ))
}

/// Prints that there were no values at this time, for a program that reads the output.
fn print_none(now: DateTime<Local>, items: &[Item], options: &Watch) -> Result<(), Failure> {
    if options.csv {
        return row(now, &vec![String::new(); items.len()]);
    }
    if options.json_lines {
        return object(now, items.iter().map(|item| (item, Json::Null)));
    }
    Ok(())
}

/// Prints fields as a row of CSV.
fn row(now: DateTime<Local>, fields: &[String]) -> Result<(), Failure> {
    output::line(format_args!("{},{}", time(now), fields.join(",")))
}

/// Prints values as an object of JSON.
fn object<'a>(
    now: DateTime<Local>,
    values: impl Iterator<Item = (&'a Item, Json)>,
) -> Result<(), Failure> {
    let values = values.map(|(item, value)| (item.name.clone(), value));
    let mut object: Map<String, Json> = values.collect();
    object.insert("time".to_owned(), json!(time(now)));
    output::line(Json::from(object))
}

fn time(now: DateTime<Local>) -> String {
    now.to_rfc3339_opts(SecondsFormat::Millis, false)
}
