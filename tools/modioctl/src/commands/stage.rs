//! What commands report about DEAD_TIME, MAX_ON and MIN_OFF of digital outputs.

use std::collections::BTreeMap;

use register_map::codes::{ChannelStatus, Command};

use crate::device::Device;
use crate::failure::Failure;
use crate::held::Held;
use crate::names::{Book, Item, Meaning, is_module};
use crate::value::{point_name, point_of};
use crate::warnings::stage;

/// Why an output is off that was switched on.
#[derive(Clone, Debug, PartialEq)]
pub enum Off {
    /// MAX_ON has ended it.
    Ended,
    /// The output with this name is on, and the two are a pair.
    Pair(String),
    /// Not known.
    Unknown,
}

impl Off {
    /// Returns MAX_ON or the name of the other output, for programs.
    pub fn by(&self) -> Option<&str> {
        match self {
            Self::Ended => Some("MAX_ON"),
            Self::Pair(other) => Some(other),
            Self::Unknown => None,
        }
    }

    /// Describes it for people.
    pub fn text(&self) -> String {
        match self {
            Self::Ended => "off, because MAX_ON has ended it: a repeated 1 is no new order".into(),
            Self::Pair(other) => format!("off, because {other} of its pair is on"),
            Self::Unknown => "off again".into(),
        }
    }
}

impl Device {
    /// Returns those of these outputs with MAX_ON and DEAD_TIME that were switched on and are off, by name, without those
    /// that links hold.
    pub async fn off(
        &mut self,
        book: &Book,
        held: &Held,
        written: &[(Item, Vec<u16>)],
    ) -> Result<BTreeMap<String, Off>, Failure> {
        let is_on = |(item, words): &&(Item, Vec<u16>)| {
            let has_stage = || book.item(&format!("{}.dead_time", item.name)).is_some();
            let is_on = item.meaning == Meaning::Bit && words[..] == [1];
            is_on && !held.contains_key(&item.name) && has_stage()
        };
        let outputs = written.iter().filter(is_on).map(|(item, _)| item.clone());
        let outputs: Vec<_> = outputs.collect();
        let coils = self.read_items(&outputs).await?;
        let mut off = BTreeMap::new();
        for (output, _) in outputs
            .iter()
            .zip(coils)
            .filter(|(_, coil)| coil[..] == [0])
        {
            off.insert(output.name.clone(), self.why_off(book, &output.name).await?);
        }
        Ok(off)
    }

    async fn why_off(&mut self, book: &Book, output: &str) -> Result<Off, Failure> {
        let number = point_of(output).unwrap_or_default();
        let other = point_name(number ^ 1);
        let dead_time = format!("{}.dead_time", point_name(number & !1));
        let status = format!("{output}.channel_status");
        let mut first_word = async |name: &str| match book.item(name) {
            Some(item) => Ok(self.read_items(std::slice::from_ref(item)).await?[0][0]),
            None => Ok(0),
        };
        if first_word(&status).await? == ChannelStatus::Ended.code() {
            return Ok(Off::Ended);
        }
        let is_pair = stage::pairs(book).iter().any(|pair| pair.name == dead_time);
        if is_pair && first_word(&dead_time).await? != 0 && first_word(&other).await? != 0 {
            return Ok(Off::Pair(other));
        }
        Ok(Off::Unknown)
    }

    /// Returns DEAD_TIME of each pair of outputs, if these changes can set one to 0.
    pub async fn pairs_before(
        &mut self,
        book: &Book,
        changes: &[(Item, Vec<u16>)],
    ) -> Result<Vec<Item>, Failure> {
        let orders = [Command::LoadDefaults, Command::DropChanges].map(|order| [order.code()]);
        let can = |(item, words): &(Item, Vec<u16>)| {
            let is_order = || orders.iter().any(|order| words == order);
            let ends_pair = item.name.ends_with(".dead_time") && words[..] == [0];
            ends_pair || is_module(item) || item.name == "COMMAND" && is_order()
        };
        match changes.iter().any(can) {
            true => self.pairs(book).await,
            false => Ok(Vec::new()),
        }
    }

    /// Returns DEAD_TIME of each pair of outputs.
    pub async fn pairs(&mut self, book: &Book) -> Result<Vec<Item>, Failure> {
        let mut pairs = stage::pairs(book);
        let mut times = self.read_items(&pairs).await?.into_iter();
        pairs.retain(|_| times.next().is_some_and(|time| time[..] != [0]));
        Ok(pairs)
    }

    /// Prints warnings about those of these DEAD_TIMEs, of pairs, that are 0 now. The command has done its work, so it does
    /// not fail when the unit does not answer now.
    pub async fn warn_of_lost_pairs(&mut self, before: &[Item]) {
        if let Ok(values) = self.read_items(before).await {
            for (pair, _) in before
                .iter()
                .zip(values)
                .filter(|(_, time)| time[..] == [0])
            {
                eprintln!("modioctl: warning: {}", stage::of_lost_pair(pair));
            }
        }
    }

    /// Prints warnings about the times of the outputs that these settings concern, after they were written. As
    /// [`Self::warn_of_lost_pairs`], it does not fail.
    pub async fn warn_of_stage(&mut self, book: &Book, written: &[(Item, Vec<u16>)]) {
        let items = stage::items(book, written.iter().map(|(item, _)| item));
        if let Ok(values) = self.read_items(&items).await {
            for warning in stage::warnings(book, &items, &values) {
                eprintln!("modioctl: warning: {warning}");
            }
        }
    }
}
