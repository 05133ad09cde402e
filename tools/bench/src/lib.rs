//! Measures the release image on the virtual board, in instructions, so that the same image gives the same figures
//! on every machine. Minimal servers on other crates receive the same requests for comparison.
//!
//! `cargo xtask bench` builds the images, runs this crate, adds the sizes, shows the result and compares it with
//! the baseline. This crate only measures.

pub mod boot;
mod framing;
pub mod load;
pub mod requests;
pub mod rival;
pub mod unit;

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;
use sim::{Corner, Image};

use rival::Rival;
use unit::{Cost, Unit};

/// The baud rates of [`load`], in units of 100 bit/s.
const RATES: [u16; 3] = [96, 1152, 9216];

/// Cost of a request.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The function and its parameters.
    pub request: String,
    /// The cost on the image.
    #[serde(flatten)]
    pub cost: Cost,
    /// What is allowed for some of these figures in this row, by their names.
    pub budgets: BTreeMap<&'static str, u32>,
    /// Cost on each rival, from complete frame to complete response; `None` when the rival does not answer.
    pub rivals: BTreeMap<String, Option<u32>>,
}

/// All results.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The requests.
    pub requests: Vec<Row>,
    /// The load of the processor.
    pub load: Vec<load::Load>,
    /// The times of the loader.
    pub boot: Vec<boot::Boot>,
}

/// Measures the image of a board, its loader with a signed image, and the rivals with their names.
///
/// # Errors
///
/// When the image does not serve a request correctly: names the request and the error.
pub fn measure(
    image: &Image,
    (loader, signed): (&Image, &[u8]),
    board: &register_map::Row,
    rivals: &[(String, Image)],
) -> Result<Report, String> {
    // Each case has another virtual part, so they can run on all cores of the host.
    let corners = [Corner::Nominal, Corner::Slow].into_iter();
    let cases = corners.flat_map(|corner| RATES.map(|rate| (corner, rate)));
    let cases: Vec<_> = cases
        .flat_map(|(corner, rate)| [(corner, rate, false), (corner, rate, true)])
        .collect();
    let load = || {
        let cases = cases.into_par_iter();
        cases
            .map(|(corner, rate, long)| load::measure(image, board, corner, rate, long))
            .collect::<Result<_, String>>()
    };
    let requests = || self::requests(image, board, rivals);
    let boot = || boot::measure(loader, signed, board);
    let (requests, (load, boot)) = rayon::join(requests, || rayon::join(load, boot));
    Ok(Report {
        requests: requests?,
        load: load?,
        boot: boot?,
    })
}

fn requests(
    image: &Image,
    board: &register_map::Row,
    rivals: &[(String, Image)],
) -> Result<Vec<Row>, String> {
    let mut units: BTreeMap<(&str, u16), Unit> = BTreeMap::new();
    let mut rivals = rivals
        .iter()
        .map(|(name, image)| Ok((name.clone(), Rival::new(image)?)))
        .collect::<Result<Vec<_>, String>>()?;
    let mut requests = Vec::new();
    for request in requests::all(board) {
        let (module, mode) = (request.module, request.mode);
        let unit = match units.entry((module.name(), mode.code())) {
            std::collections::btree_map::Entry::Occupied(unit) => unit.into_mut(),
            std::collections::btree_map::Entry::Vacant(place) => {
                let unit = Unit::new(image, board, module, Corner::Nominal, 1152, mode)?;
                place.insert(unit)
            }
        };
        let cost = unit.measure(&request);
        let cost = cost.map_err(|error| format!("{}: {error}", request.name))?;
        let mut others = BTreeMap::new();
        for (name, rival) in &mut rivals {
            let taken = match &request.rival {
                Some(pdu) => rival
                    .measure(pdu)
                    .map_err(|error| format!("{name}: {error}"))?,
                None => None,
            };
            others.insert(name.clone(), taken);
        }
        requests.push(Row {
            budgets: request.budgets(),
            request: request.name,
            cost,
            rivals: others,
        });
    }
    Ok(requests)
}
