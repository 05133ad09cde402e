//! The polling task. Only this task uses the line, and the display never waits for it.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use chrono::Local;
use register_map::edges::log;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};
use tokio::time::{Instant, sleep_until};

use super::edges::{self, Edge};
use super::messages::{Polled, Update, Write};
use super::model::SELDOM;
use super::plan::{Plan, Words, is_analog};
use crate::bus::{Endpoint, Observer};
use crate::device::{Device, fetch};
use crate::failure::Failure;
use crate::names::{Item, PortItems};
use crate::value::long;

/// Longest time from the order of a write to its request. An older order is not sent, because an output must not
/// switch when the user no longer expects it.
const LATEST: Duration = Duration::from_millis(1500);
/// Pause before a port or a connection is opened again, and after a failure.
const AGAIN: Duration = Duration::from_secs(1);
/// Time without an answer after which a connection is opened again. A gateway that has lost its supply never closes
/// it.
const STUCK: Duration = Duration::from_secs(5);
/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_millis(5);

/// Creates an observer each time that the line is opened.
pub type Observers = Box<dyn FnMut() -> Observer + Send>;

/// The polling task.
pub struct Poller {
    endpoint: Endpoint,
    every: Duration,
    observers: Observers,
    updates: UnboundedSender<Update>,
    writes: UnboundedReceiver<Write>,
    /// Whether the display shows the edges of an input.
    wants_edges: Arc<AtomicBool>,
    device: Option<Device>,
    plan: Option<Plan>,
    /// Ports that wait for a restart, since the last restart that was detected.
    waiting: BTreeSet<u8>,
    /// Uptime of the unit in seconds, and the time when it was read.
    uptime: Option<(u64, Instant)>,
    counted: Option<Instant>,
    /// Time when the log of edges was read, since the display shows edges.
    logged: Option<Instant>,
    answered: Instant,
}

enum Round {
    Complete(Box<Polled>),
    /// A write is waiting, which may change values that were read before it.
    Interrupted,
    /// The modules or settings of the unit have changed.
    Changed,
}

impl Poller {
    /// Creates the task for an open device without knowledge about the unit.
    pub fn new(
        device: Device,
        every: Duration,
        observers: Observers,
        updates: UnboundedSender<Update>,
        writes: UnboundedReceiver<Write>,
        wants_edges: Arc<AtomicBool>,
    ) -> Self {
        Self {
            endpoint: device.master.endpoint().clone(),
            every,
            observers,
            updates,
            writes,
            wants_edges,
            device: Some(device),
            plan: None,
            waiting: BTreeSet::new(),
            uptime: None,
            counted: None,
            logged: None,
            answered: Instant::now(),
        }
    }

    /// Polls until the display has ended.
    pub async fn run(mut self) {
        let mut next = Instant::now();
        loop {
            tokio::select! {
                biased;
                write = self.writes.recv() => match write {
                    None => return,
                    Some(write) => {
                        self.write(write).await;
                        next = Instant::now();
                    }
                },
                () = sleep_until(next) => {
                    let start = Instant::now();
                    let pause = match self.step().await {
                        Ok(pause) => pause,
                        Err(failure) => self.lost(failure),
                    };
                    next = (start + pause).max(Instant::now() + PAUSE);
                }
            }
        }
    }

    fn tell(&self, update: Update) {
        // Without a display the task ends when it next reads the channel of writes.
        let _ = self.updates.send(update);
    }

    /// Opens the line, learns the names of the unit, or polls. Returns the time to the next step.
    async fn step(&mut self) -> Result<Duration, Failure> {
        let Some(device) = &mut self.device else {
            let observer = (self.observers)();
            self.device = Some(Device::open(self.endpoint.clone(), Some(observer)).await?);
            self.answered = Instant::now();
            return Ok(Duration::ZERO);
        };
        let Some(plan) = &self.plan else {
            let book = fetch(device).await?.book;
            book.of_modio()?;
            self.answered = Instant::now();
            self.plan = Some(Plan::new(&book));
            self.counted = None;
            self.tell(Update::Learned(Box::new(book)));
            return Ok(Duration::ZERO);
        };
        let plan = plan.clone();
        match self.round(&plan).await? {
            Round::Complete(polled) => {
                self.answered = Instant::now();
                self.tell(Update::Polled(*polled));
                Ok(self.every)
            }
            Round::Interrupted => Ok(Duration::ZERO),
            Round::Changed => {
                self.plan = None;
                Ok(Duration::ZERO)
            }
        }
    }

    async fn round(&mut self, plan: &Plan) -> Result<Round, Failure> {
        let Some(device) = &mut self.device else {
            return Ok(Round::Changed);
        };
        let at = Instant::now();
        let mut words = Words::new();
        let refused = points(device, plan, &mut words).await?;
        // Without analog points there are no settings to read.
        for items in [&plan.settings, &plan.state] {
            if !self.writes.is_empty() {
                return Ok(Round::Interrupted);
            }
            read(device, items, &mut words).await?;
        }
        let took = at.elapsed();
        self.note_restart(&words);
        if !plan.holds(&words) {
            return Ok(Round::Changed);
        }
        self.waiting.extend(plan.waiting_for_restart(&words));
        let ports = plan.ports.iter();
        let waiting = ports.filter(|port| self.waiting.contains(&port.number));
        for point in waiting.flat_map(|port| &port.points) {
            if is_analog(point) {
                words.remove(&point.name);
            }
        }
        let counted = self.counted.map(|counted| counted.elapsed());
        if counted.is_none_or(|age| age >= SELDOM)
            && self.writes.is_empty()
            && let Some(device) = &mut self.device
        {
            read(device, &plan.counters, &mut words).await?;
            read(device, &plan.links_without(&self.waiting), &mut words).await?;
            self.counted = Some(Instant::now());
        }
        let edges = self.edges(plan).await?;
        Ok(Round::Complete(Box::new(Polled {
            at,
            took,
            words,
            refused,
            waiting: self.waiting.clone(),
            edges,
        })))
    }

    /// Reads the log of edges, if the display shows them and it is time for it. Returns the newest edges.
    async fn edges(&mut self, plan: &Plan) -> Result<Option<Vec<Edge>>, Failure> {
        if !self.wants_edges.load(Ordering::Relaxed) {
            self.logged = None;
            return Ok(None);
        }
        let is_due =
            self.logged.is_none_or(|logged| logged.elapsed() >= SELDOM) && self.writes.is_empty();
        let (true, Some(uptime), Some(device)) = (is_due, &plan.uptime_ms, &mut self.device) else {
            return Ok(None);
        };
        self.logged = Some(Instant::now());
        let records = device.read_records(log::FILE, edges::FIRST, edges::COUNT);
        let records = match records.await {
            Err(Failure::Refused(_)) => {
                // The unit has no log. Do not ask for it again.
                if let Some(plan) = &mut self.plan {
                    plan.uptime_ms = None;
                }
                return Ok(None);
            }
            records => records?,
        };
        // The uptime is read last, so that no edge is newer.
        let uptime = device.read_words(uptime.address, uptime.words).await?;
        Ok(Some(Edge::all(&records, long(&uptime), Local::now())))
    }

    /// Detects a restart from the uptime. A port that waited for a restart no longer waits then.
    fn note_restart(&mut self, words: &Words) {
        let Some(uptime) = words.get("uptime") else {
            return;
        };
        let now = u64::from(long(uptime));
        if let Some((before, at)) = self.uptime {
            // A unit on its internal oscillator may count a few per cent slower.
            let least = before.saturating_add(at.elapsed().as_secs() * 9 / 10);
            if now.saturating_add(2) < least || now < before {
                self.waiting.clear();
                self.plan = None;
            }
        }
        self.uptime = Some((now, Instant::now()));
    }

    /// Handles a failed step. Returns the time to the next one.
    fn lost(&mut self, failure: Failure) -> Duration {
        // A unit that returns may have other modules.
        self.plan = None;
        let serial = self.endpoint.place.is_serial();
        let stuck = !serial && self.answered.elapsed() > STUCK;
        if matches!(failure, Failure::Port(_)) || stuck {
            self.device = None;
        }
        let pause = match failure {
            Failure::NoAnswer(_) | Failure::Garbled(_) | Failure::Busy(_) => self.every,
            _ => AGAIN,
        };
        self.tell(Update::Lost(failure));
        pause
    }

    async fn write(&mut self, write: Write) {
        let result = self.try_to_write(&write).await;
        if let Err(failure) = &result
            && failure.may_pass()
        {
            self.plan = None;
            // The order must not reach the unit later from a buffer of this computer.
            if let Some(device) = self.device.take() {
                device.master.close_unsent();
            }
        }
        self.tell(Update::Wrote(write, result));
    }

    async fn try_to_write(&mut self, write: &Write) -> Result<(), Failure> {
        let item = &write.item;
        let not_sent =
            |why: &str| Failure::Refused(format!("{} was not written: {why}", item.name));
        let too_late = || write.ordered.elapsed() > LATEST;
        let busy = || not_sent("the line was busy for too long");
        if too_late() {
            return Err(busy());
        }
        let (Some(device), Some(plan)) = (&mut self.device, &self.plan) else {
            return Err(not_sent("the unit does not answer"));
        };
        let has = |port: &&PortItems| port.points.iter().any(|point| point == item);
        let Some(port) = plan.ports.iter().find(has) else {
            return Err(not_sent("the unit has other modules or settings now"));
        };
        if is_analog(item) {
            if self.waiting.contains(&port.number) {
                return Err(not_sent("the port waits for a restart"));
            }
            // Another program may have changed RANGE or SCALE since the last round.
            let mut words = Words::new();
            read(device, &plan.settings_of(item), &mut words).await?;
            if !Plan::reads_alike(item, &words) {
                return Err(not_sent("its RANGE or SCALE has changed"));
            }
            if too_late() {
                return Err(busy());
            }
        }
        device.write_item(item, &write.words).await
    }
}

async fn read(device: &mut Device, items: &[Item], words: &mut Words) -> Result<(), Failure> {
    let values = device.read_items(items).await?;
    let names = items.iter().map(|item| item.name.clone());
    words.extend(names.zip(values));
    Ok(())
}

/// Reads all points together. If the unit refuses, reads each port separately, so that one port does not hide the
/// others. Returns the refused ports.
async fn points(
    device: &mut Device,
    plan: &Plan,
    words: &mut Words,
) -> Result<Vec<(u8, String)>, Failure> {
    let ports = plan.ports.iter();
    let all: Vec<_> = ports.flat_map(|port| port.points.clone()).collect();
    match read(device, &all, words).await {
        Err(Failure::Refused(_)) => {}
        result => return result.map(|()| Vec::new()),
    }
    let mut refused = Vec::new();
    for port in &plan.ports {
        match read(device, &port.points, words).await {
            Err(Failure::Refused(text)) => refused.push((port.number, text)),
            result => result?,
        }
    }
    Ok(refused)
}
