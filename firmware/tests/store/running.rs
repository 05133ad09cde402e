//! The steps of a device's life that concern the store.

use firmware::store::{Given, Saving, WriteError};
use register_map::board::Board;
use register_map::configuration::{COMMAND, HEARTBEAT, KEY, RULES, module_of};
use register_map::record::OUTPUTS;
use register_map::{Module, Rule, deadband};

use crate::B;
use crate::flash::{Fault, MockFlash, Noise};

/// The settings, and what a start finds.
pub type Settings = firmware::config::Settings<B>;
pub type Loaded = firmware::store::Loaded<B>;
pub type Store = firmware::store::Store<B>;

/// MODULE of the first slot.
pub const MODULE_SLOT: u16 = module_of(B::ROW.first_port);

/// Values of outputs, as pairs of a record.
pub type Outputs = Vec<(u16, u16)>;

pub type Failure = WriteError<Fault>;

/// Starts the device: loads the configuration and prepares the store.
pub fn start(flash: &mut MockFlash) -> (Loaded, Result<Store, Failure>) {
    let mut store = Store::open(flash);
    let loaded = store.load(flash);
    let prepared = store.prepare(flash);
    (loaded, prepared.map(|()| store))
}

/// Starts the device without a power cut.
pub fn start_well(flash: &mut MockFlash) -> (Loaded, Store) {
    let (loaded, store) = start(flash);
    (loaded, store.unwrap())
}

/// Saves as the firmware's background task does. Returns `false` when there was nothing to do.
pub fn save(
    store: &mut Store,
    flash: &mut MockFlash,
    settings: &Settings,
) -> Result<bool, Failure> {
    let Some(mut saving) = Saving::of_settings(store, flash, settings) else {
        return Ok(false);
    };
    let performed = saving.perform(flash, Given::Settings(settings));
    // The error of the operation is more specific.
    performed.and(saving.finish(store, flash))?;
    Ok(true)
}

/// Records outputs as the firmware's background task does. Returns `false` when there was nothing to do.
pub fn record(
    store: &mut Store,
    flash: &mut MockFlash,
    outputs: &[(u16, u16)],
) -> Result<bool, Failure> {
    let Some(mut saving) = Saving::of_outputs(store, flash, outputs) else {
        return Ok(false);
    };
    let performed = saving.perform(flash, Given::Outputs(outputs));
    performed.and(saving.finish(store, flash))?;
    Ok(true)
}

/// Returns the stored outputs.
pub fn stored(store: &Store, flash: &MockFlash) -> Outputs {
    let record = store.outputs(flash);
    let pairs = record.iter().flat_map(|record| record.pairs());
    pairs.filter(|(address, _)| *address >= OUTPUTS).collect()
}

/// Returns values of some outputs that differ from round to round.
pub fn outputs(round: u16) -> Outputs {
    let all = [0, 1, 2, 3].map(|point| (OUTPUTS + 0x0510 + point, round));
    all[..1 + usize::from(round % 4)].to_vec()
}

pub fn settings(pairs: &[(u16, u16)]) -> Settings {
    let (settings, rejected) = Settings::load(pairs.iter().copied());
    assert_eq!(rejected, 0, "{pairs:?}");
    settings
}

/// Returns settings of which about `changed` differ from the defaults. The same seed always gives the same
/// settings.
pub fn random_settings(seed: u64, changed: usize) -> Settings {
    let mut noise = Noise(seed);
    let addresses: Vec<_> = addresses().collect();
    let mut pairs = vec![(MODULE_SLOT, noise.next() as u16 % 7)];
    for _ in 0..changed {
        let (rule, address) = addresses[noise.next() as usize % addresses.len()];
        if address != MODULE_SLOT {
            pairs.extend(some_value(rule, &mut noise).map(|value| (address, value)));
        }
    }
    Settings::load(pairs.into_iter()).0
}

/// Returns settings in which every value that can be changed differs from its default.
pub fn fullest_settings(seed: u64) -> Settings {
    let mut noise = Noise(seed);
    let mut pairs = vec![(MODULE_SLOT, Module::Ao4.code())];
    for (rule, address) in addresses().filter(|(_, address)| *address != MODULE_SLOT) {
        pairs.extend(some_value(rule, &mut noise).map(|value| (address, value)));
    }
    Settings::load(pairs.into_iter()).0
}

/// Returns the addresses of all settings but links, with their rules, in ascending order.
fn addresses() -> impl Iterator<Item = (&'static Rule, u16)> {
    let rules = RULES.iter().chain(deadband::RULES);
    rules
        .filter(|rule| B::ROW.has(rule.first))
        .filter(|rule| ![KEY, COMMAND, HEARTBEAT].contains(&rule.first))
        .flat_map(|rule| rule.addresses().map(move |address| (rule, address)))
}

/// Returns a random allowed value that is not the default, if a few tries find one.
fn some_value(rule: &Rule, noise: &mut Noise) -> Option<u16> {
    let some = [1, 0xFFFE, 2000, 100, 12, 24, 384, 30, 3, 0, 1];
    let some = some.map(|value: u16| value.wrapping_add(noise.next() as u16 % 2));
    let from = noise.next() as usize % some.len();
    let some = some[from..].iter().chain(&some);
    some.copied()
        .find(|value| *value != rule.default && rule.values.allow(*value))
}
