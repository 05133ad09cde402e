//! `modioctl watch`.

use chrono::{DateTime, Local, SecondsFormat};
use serde_json::{Map, Value as Json, json};
use tokio::time::{MissedTickBehavior, interval};

use crate::cli::Watch;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Book, Item};
use crate::output::{self, csv_field};
use crate::value::show;

/// Prints values until it is stopped. Waits for a unit that is lost.
pub async fn run(mut device: Device, options: &Watch) -> Result<(), Failure> {
    let items = chosen(&fetch(&mut device).await?.book, &options.names)?;
    if options.csv {
        let names: Vec<_> = items.iter().map(|item| csv_field(&item.name)).collect();
        output::line(format_args!("time,{}", names.join(",")))?;
    }
    let mut ticks = interval(options.every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut lost = false;
    let mut printed = 0;
    while options.count.is_none_or(|count| printed < count) {
        ticks.tick().await;
        match device.read_items(&items).await {
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
                if matches!(failure, Failure::Port(_)) {
                    let endpoint = device.master.endpoint().clone();
                    device = reconnect(device, endpoint).await;
                }
            }
            Err(failure) => return Err(failure),
        }
    }
    Ok(())
}

/// Opens the port or connection again, as often as needed.
async fn reconnect(device: Device, endpoint: crate::bus::Endpoint) -> Device {
    drop(device);
    loop {
        tokio::time::sleep(std::time::Duration::from_secs(1)).await;
        if let Ok(device) = Device::open(endpoint.clone(), None).await {
            return device;
        }
    }
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
    let time = now.to_rfc3339_opts(SecondsFormat::Millis, false);
    if options.csv {
        let values: Vec<_> = shown.iter().map(|shown| csv_field(&shown.text)).collect();
        return output::line(format_args!("{time},{}", values.join(",")));
    }
    let both = items.iter().zip(&shown);
    if options.json_lines {
        let mut object: Map<String, Json> = both
            .map(|(item, shown)| (item.name.clone(), shown.json.clone()))
            .collect();
        object.insert("time".to_owned(), json!(time));
        return output::line(Json::from(object));
    }
    let values = both.map(|(item, shown)| format!("{} {shown}", item.name));
    let values: Vec<_> = values.collect();
    output::line(format_args!(
        "{}  {}",
        now.format("%H:%M:%S%.3f"),
        values.join("   ")
    ))
}
