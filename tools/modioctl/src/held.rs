//! Outputs that links hold. A link that follows or inverts its input and always acts decides what its output is: the unit
//! accepts a write to that output, and the link undoes it.

use std::collections::BTreeMap;

use register_map::codes::LinkAction;
use register_map::configuration::MODULE;
use register_map::{links::NO_SOURCE, points};

use crate::device::Device;
use crate::failure::Failure;
use crate::links;
use crate::names::{Book, Item, port_of};
use crate::value::point_name;

/// The outputs that links hold, by name, each with the names of the inputs.
pub type Held = BTreeMap<String, Vec<String>>;

/// Returns the input with which a link holds its output, whether the master is there or not; `None` for a link that does not.
pub fn source(words: &[u16]) -> Option<String> {
    let [source, action, ..] = *words else {
        return None;
    };
    let levels = [LinkAction::Follow, LinkAction::Invert];
    // With WHEN 1 the code is another one.
    let holds = source != NO_SOURCE && levels.iter().any(|level| level.code() == action);
    holds.then(|| point_name(source))
}

/// Says which links hold an output.
pub fn text(sources: &[String]) -> String {
    let links = if sources.len() == 1 { "link" } else { "links" };
    format!(
        "held by {links} {}; a write to a held output has no effect",
        sources.join(" and ")
    )
}

impl Device {
    /// Returns those of these points that links hold. Sends no request if none of them has links.
    pub async fn held<'a>(
        &mut self,
        book: &Book,
        points: impl IntoIterator<Item = &'a Item>,
    ) -> Result<Held, Failure> {
        let points = points.into_iter();
        let mut links: Vec<_> = points
            .flat_map(|point| links::of(book, &point.name))
            .collect();
        if links.is_empty() {
            return Ok(Held::new());
        }
        // A link from or to a port whose module waits for a restart does not act before it.
        let set = self.read_words(MODULE, points::PORTS).await?;
        let ports = book.ports();
        let is_in_force = |name: &str| {
            let port = ports.iter().find(|port| port_of(name) == Some(port.number));
            port.is_some_and(|port| {
                set.get(usize::from(port.number.max(1)) - 1) == Some(&port.code)
            })
        };
        links.retain(|link| is_in_force(&link.name));
        let values = self.read_items(&links).await?;
        let mut held = Held::new();
        for (link, words) in links.iter().zip(&values) {
            let source = source(words).filter(|source| is_in_force(source));
            if let (Some(source), Some((output, _))) = (source, link.name.rsplit_once('.')) {
                let sources = held.entry(output.to_owned()).or_default();
                if !sources.contains(&source) {
                    sources.push(source);
                }
            }
        }
        Ok(held)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_level_links_that_always_act_hold_their_output() {
        let holding = |source: u16| {
            let codes = 0..=LinkAction::ChangeAlone.code();
            let holds = |action: &u16| super::source(&[source, *action, 0, 0]).is_some();
            codes.filter(holds).collect::<Vec<_>>()
        };
        assert_eq!(holding(8), [1, 2]);
        assert!(holding(NO_SOURCE).is_empty());
        assert_eq!(source(&[9, 2, 180, 150]), Some("p3.2".to_owned()));
    }
}
