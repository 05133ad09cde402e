//! `modioctl info`.

use serde_json::{Map, Value as Json, json};

use super::learn;
use crate::bus::decode;
use crate::device::Device;
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::output;
use crate::value::show;

/// The first objects of the device identification (V1.1b3, 6.21).
const OBJECTS: [&str; 7] = [
    "vendor",
    "product code",
    "revision",
    "address on the web",
    "product",
    "model",
    "application",
];

/// Shows what the unit is and how it fares.
///
/// # Errors
///
/// What went wrong with the unit.
pub async fn run(device: &mut Device, json: bool) -> Result<(), Failure> {
    let mut identity = identity(device).await?;
    let book = learn(device).await?.book;
    if book.description().is_some() {
        // The objects beyond the standard's are registers as well.
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

/// Whether this is state of the unit: a register that can only be read, and what is in a slot.
fn is_state(item: &Item) -> bool {
    !item.writable && matches!(item.meaning, Meaning::Value(_))
}

/// The objects of the device identification; none for a unit without it.
///
/// # Errors
///
/// That the unit does not answer.
pub async fn identity(device: &mut Device) -> Result<Vec<(String, String)>, Failure> {
    let mut found = Vec::new();
    let mut object = 0;
    // Extended, from an object on; a unit with few objects says so in one answer.
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
            found.push((name, String::from_utf8_lossy(&text).into_owned()));
        }
        match (answer.get(4), answer.get(5)) {
            (Some(0xFF), Some(next)) if *next > object => object = *next,
            _ => break,
        }
    }
    Ok(found)
}
