//! The state of the monitor, apart from how it is drawn.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use modio_description::Description;
use tokio::time::Instant;

use super::edges::Edge;
use super::editor::Editor;
use super::frames::Frames;
use super::history::History;
use super::link::Link;
use super::messages::{Polled, Update, Write};
use super::plan::{is_analog, is_digital_input};
use super::tree::{Row, Tree};
use crate::failure::Failure;
use crate::held;
use crate::links;
use crate::names::{Book, Item};
use crate::value::show;

/// Time for which a message without an answer is shown.
const NOTICE: Duration = Duration::from_secs(6);
/// Interval at which counters are read. They may be older than other values by this time.
pub const SELDOM: Duration = Duration::from_secs(1);

/// A page of the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Page {
    /// Tree, chart and a short log.
    #[default]
    Points,
    /// Counters and a long log.
    Line,
}

/// Part of a page that receives movement keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Focus {
    #[default]
    Tree,
    Frames,
}

/// Words with the time when they were read.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamped {
    /// The words.
    pub words: Vec<u16>,
    /// Time when they were read.
    pub at: Instant,
}

/// A write that is not complete.
#[derive(Clone, Debug)]
pub struct Pending {
    /// The words.
    pub words: Vec<u16>,
    /// Time when the unit confirmed the write. The write is pending until a later round shows the value.
    pub confirmed: Option<Instant>,
}

/// A write that failed. The user may order it again.
#[derive(Clone, Debug)]
pub struct Failed {
    /// The write.
    pub write: Write,
    /// Description of the failure.
    pub text: String,
}

/// The state of the display.
pub struct Model {
    /// Connection to the unit.
    pub place: String,
    /// The unit's address.
    pub unit: u8,
    /// Name and firmware of the unit.
    pub title: String,
    /// Names of the unit.
    pub book: Book,
    /// Ports and points.
    pub tree: Tree,
    /// State of the connection.
    pub link: Link,
    /// Duration of the last round of polling.
    pub took: Duration,
    /// The log and its counters.
    pub frames: Frames,
    /// Pending writes, by the name of the output.
    pub pending: BTreeMap<String, Pending>,
    /// Writes that failed, the latest one last.
    pub failed: Vec<Failed>,
    /// The slider, while it is open.
    pub editor: Option<Editor>,
    /// The page that is shown.
    pub page: Page,
    /// Part that receives movement keys.
    pub focus: Focus,
    /// Whether the help is shown.
    pub help: bool,
    /// Whether the program handles clicks of the mouse.
    pub mouse: bool,
    notice: Option<(String, Instant)>,
    values: BTreeMap<String, Stamped>,
    histories: BTreeMap<String, History>,
    refused: BTreeMap<u8, String>,
    waiting: BTreeSet<u8>,
    edges: Vec<Edge>,
}

impl Model {
    /// Returns a display of a unit before the first message of the polling task.
    pub fn new(place: String, unit: u8, every: Duration, now: Instant) -> Self {
        Self {
            place,
            unit,
            title: String::new(),
            book: Book::default(),
            tree: Tree::default(),
            link: Link::new(now, every),
            took: Duration::ZERO,
            frames: Frames::default(),
            pending: BTreeMap::new(),
            failed: Vec::new(),
            editor: None,
            page: Page::default(),
            focus: Focus::default(),
            help: false,
            mouse: true,
            notice: None,
            values: BTreeMap::new(),
            histories: BTreeMap::new(),
            refused: BTreeMap::new(),
            waiting: BTreeSet::new(),
            edges: Vec::new(),
        }
    }

    /// Applies a message of the polling task.
    pub fn update(&mut self, update: Update, now: Instant) {
        match update {
            Update::Learned(book) => self.learned(*book, now),
            Update::Polled(polled) => self.polled(polled, now),
            Update::Lost(failure) => {
                self.count(&failure);
                self.link.failed(failure);
            }
            Update::Wrote(write, result) => self.wrote(write, result, now),
            Update::Seen(seen) => self.frames.add(&seen),
        }
    }

    fn count(&mut self, failure: &Failure) {
        let counts = &mut self.frames.counts;
        match failure {
            Failure::NoAnswer(_) => counts.no_answer += 1,
            Failure::Garbled(_) => counts.garbled += 1,
            Failure::Port(_) => counts.lost += 1,
            Failure::Refused(_) | Failure::Busy(_) | Failure::Usage(_) => {}
        }
        self.frames.give_up();
    }

    fn learned(&mut self, book: Book, now: Instant) {
        let before: BTreeMap<_, _> = points(&self.book).collect();
        let after: BTreeMap<_, _> = points(&book).collect();
        let same = |name: &str| after.contains_key(name) && after.get(name) == before.get(name);
        // Words of a point that has changed would be shown with the wrong unit.
        self.values
            .retain(|name, _| !before.contains_key(name) || same(name));
        self.histories.retain(|name, _| same(name));
        self.pending.retain(|name, _| same(name));
        let offered = self.failed.len();
        self.failed.retain(|failed| same(&failed.write.item.name));
        let dropped = self.failed.len() < offered;
        let closes = self
            .editor
            .as_ref()
            .is_some_and(|editor| !same(&editor.item.name));
        if closes {
            self.editor = None;
        }
        if !before.is_empty() && before != after {
            let dropped = if dropped {
                "; a failed write is no longer offered"
            } else {
                ""
            };
            let text = format!("the unit has other modules or settings than before{dropped}");
            self.say(&text, now);
        }
        let title = |unit: &Description| format!("{} {}", unit.board, unit.firmware);
        self.title = book.description().map(title).unwrap_or_default();
        self.tree.set(book.ports());
        self.book = book;
    }

    fn polled(&mut self, polled: Polled, now: Instant) {
        let at = polled.at;
        self.link.answered(now, polled.took);
        self.took = polled.took;
        self.refused = polled.refused.into_iter().collect();
        self.waiting = polled.waiting;
        if let Some(edges) = polled.edges {
            self.take_edges(edges);
        }
        for (name, words) in polled.words {
            self.values.insert(name, Stamped { words, at });
        }
        let waiting = &self.waiting;
        let ports = self.tree.ports().iter();
        let unknown = ports.filter(|port| waiting.contains(&port.number));
        for point in unknown.flat_map(|port| &port.points) {
            if is_analog(point) {
                self.values.remove(&point.name);
            }
        }
        for point in self.book.points().filter(|point| is_analog(point)) {
            let fresh = self.values.get(&point.name).filter(|value| value.at == at);
            if let Some(number) = fresh.and_then(|value| number(point, &value.words)) {
                let history = self.histories.entry(point.name.clone()).or_default();
                history.add(at, number);
            }
        }
        self.pending
            .retain(|_, pending| pending.confirmed.is_none_or(|confirmed| at < confirmed));
    }

    /// Replaces the edges. One that is known keeps its time of day, which would otherwise change a little each time.
    fn take_edges(&mut self, edges: Vec<Edge>) {
        let known = std::mem::take(&mut self.edges);
        let same = |edge: &Edge| known.iter().find(|known| known.is_same(edge)).cloned();
        let edges = edges.into_iter().map(|edge| same(&edge).unwrap_or(edge));
        self.edges = edges.collect();
    }

    fn wrote(&mut self, write: Write, result: Result<(), Failure>, now: Instant) {
        let name = write.item.name.clone();
        self.failed.retain(|failed| failed.write.item.name != name);
        let value = show(&write.item, &write.words, false);
        match result {
            Ok(()) => {
                if let Some(pending) = self.pending.get_mut(&name) {
                    pending.confirmed = Some(now);
                }
                let text = match self.held(&write.item, now) {
                    Some(held) => format!("{name}: {held}"),
                    None => format!("{name} = {value}: the unit has confirmed it"),
                };
                self.say(&text, now);
            }
            Err(failure) => {
                self.pending.remove(&name);
                let unsure = if failure.may_pass() {
                    self.count(&failure);
                    " (the unit may have executed it)"
                } else {
                    ""
                };
                if failure.may_pass() {
                    self.link.failed(failure.clone());
                }
                let text = format!("{name} = {value} failed{unsure}: {failure}");
                self.failed.push(Failed { write, text });
            }
        }
    }

    /// Shows a message for some seconds.
    pub fn say(&mut self, text: &str, now: Instant) {
        self.notice = Some((text.to_owned(), now));
    }

    /// Returns the message to show, if it is not too old.
    pub fn notice(&self, now: Instant) -> Option<&str> {
        let (text, at) = self.notice.as_ref()?;
        (now.saturating_duration_since(*at) < NOTICE).then_some(text.as_str())
    }

    /// Returns the conditions that the unit reports; `None` when there are none, or when they are not known.
    pub fn status(&self, now: Instant) -> Option<String> {
        let (value, _) = self.value("status", now).filter(|(_, fresh)| *fresh)?;
        let item = self.book.item("status")?;
        let is_set = value.words.iter().any(|word| *word != 0);
        is_set.then(|| show(item, &value.words, false).to_string())
    }

    /// Returns the words of an item, and whether they are fresh.
    pub fn value(&self, name: &str, now: Instant) -> Option<(&Stamped, bool)> {
        let value = self.values.get(name)?;
        Some((value, self.link.is_fresh(value.at, now, Duration::ZERO)))
    }

    /// Returns the words of a counter, and whether they are fresh.
    pub fn counter(&self, name: &str, now: Instant) -> Option<(&Stamped, bool)> {
        let value = self.values.get(name)?;
        Some((value, self.link.is_fresh(value.at, now, SELDOM)))
    }

    /// Says which links hold an output, as far as that is known; `None` if none does.
    pub fn held(&self, output: &Item, now: Instant) -> Option<String> {
        let links = links::of(&self.book, &output.name);
        let sources = links.filter_map(|link| {
            let (value, is_fresh) = self.counter(&link.name, now)?;
            held::source(&value.words).filter(|_| is_fresh)
        });
        let mut sources: Vec<_> = sources.collect();
        sources.dedup();
        (!sources.is_empty()).then(|| held::text(&sources))
    }

    /// Returns the history of a point.
    pub fn history(&self, name: &str) -> Option<&History> {
        self.histories.get(name)
    }

    /// Returns the reason why the unit refuses the points of a port.
    pub fn refusal(&self, port: u8) -> Option<&str> {
        self.refused.get(&port).map(String::as_str)
    }

    /// Returns whether a port waits for a restart, so that its analog values have no known meaning.
    pub fn waits(&self, port: u8) -> bool {
        self.waiting.contains(&port)
    }

    /// Returns whether the edges of the selected point are shown.
    pub fn shows_edges(&self) -> bool {
        self.page == Page::Points && self.point().is_some_and(is_digital_input)
    }

    /// Iterates over the last edges of a digital input, newest first.
    pub fn edges(&self, point: u16) -> impl Iterator<Item = &Edge> {
        self.edges.iter().filter(move |edge| edge.point == point)
    }

    /// Returns the point that is selected.
    pub fn point(&self) -> Option<&Item> {
        match self.tree.selected()? {
            Row::Point(item) => Some(item),
            Row::Port(_) => None,
        }
    }
}

/// Returns the points by name.
fn points(book: &Book) -> impl Iterator<Item = (String, Item)> {
    let ports = book.ports().into_iter();
    ports.flat_map(|port| {
        port.points
            .into_iter()
            .map(|item| (item.name.clone(), item))
    })
}

/// Returns the value of an analog point as a number.
fn number(item: &Item, words: &[u16]) -> Option<f64> {
    show(item, words, false).json.as_f64()
}
