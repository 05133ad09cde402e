//! `modioctl info`.

use serde_json::{Map, Value as Json, json};

use crate::bus::decode;
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::output;
use crate::value::show;

/// Names of the first objects of the device identification (V1.1b3, 6.21).
const OBJECTS: [&str; 7] = [
    "vendor",
    "product code",
    "revision",
    "address on the web",
    "product",
    "model",
    "application",
];

/// Shows identity, state and counters of the unit.
///
/// # Errors
///
/// When the unit does not answer or refuses.
pub async fn run(device: &mut Device, json: bool) -> Result<(), Failure> {
    let mut identity = identity(device).await?;
    let book = fetch(device).await?.book;
    if book.description().is_some() {
        // The objects that the standard does not define are also registers.
        identity.retain(|(name, text)| OBJECTS.contains(&name.as_str()) && !text.is_empty());
    }
    let told = |item: &Item| identity.iter().any(|(name, _)| *name == item.name);
    let state = book
        .items()
        .iter()
        .filter(|item| is_state(item) && !told(item));
    let state: Vec<Item> = state.cloned().collect();
    let values = device.read_items(&state).await?;
    if json {
        let mut out: Map<String, Json> = identity
            .into_iter()
            .map(|(name, text)| (name, json!(text)))
            .collect();
        for (item, words) in state.iter().zip(&values) {
            out.insert(item.name.clone(), show(item, words, false).json);
        }
        return output::json(&out);
    }
    let mut rows: Vec<[String; 2]> = identity
        .into_iter()
        .map(|(name, text)| [name, text])
        .collect();
    rows.extend(
        state
            .iter()
            .zip(&values)
            .map(|(item, words)| [item.name.clone(), show(item, words, false).to_string()]),
    );
    output::table(&rows)
}

/// Returns whether an item is state of the unit: a read-only register, or the module of a slot.
fn is_state(item: &Item) -> bool {
    !item.writable && matches!(item.meaning, Meaning::Value(_))
}

/// Returns the objects of the device identification, or none for a unit without it.
///
/// # Errors
///
/// When the unit does not answer.
pub async fn identity(device: &mut Device) -> Result<Vec<(String, String)>, Failure> {
    let mut found = Vec::new();
    let mut object = 0;
    // Extended stream from an object on. A unit with few objects needs only one answer.
    for _ in 0..16 {
        let answer = device
            .ask(
                &[0x2B, 0x0E, 0x03, object],
                "reading the device identification",
            )
            .await;
        let answer = match answer {
            Err(Failure::Refused(_)) => break,
            other => other?,
        };
        for (id, text) in decode::objects(&answer).unwrap_or_default() {
            let name = OBJECTS.get(usize::from(id));
            let name = name.map_or_else(|| format!("object {id:02X}"), |name| (*name).to_owned());
            found.push((name, text));
        }
        match (answer.get(4), answer.get(5)) {
            (Some(0xFF), Some(next)) if *next > object => object = *next,
            _ => break,
        }
    }
    Ok(found)
}
