//! Carries out the plan of an update on a line.

use std::time::Duration;

use chrono::Local;
use tokio::time::{Instant, sleep_until};

use super::progress::Progress;
use crate::bus::Lost;
use crate::cli::Watch;
use crate::commands::watch::print;
use crate::device::Device;
use crate::failure::Failure;
use crate::names::Item;
use crate::update::{Campaign, Patience, Step};

/// Time in which anything that answers a broadcast begins to do so: adapters hold bytes back for 16 ms.
const LISTENING: Duration = Duration::from_millis(100);

/// Interval at which points are polled.
const POLLING: Duration = Duration::from_secs(1);

/// Points that are polled between the blocks.
pub struct Poll {
    items: Vec<Item>,
    form: Watch,
    due: Instant,
}

impl Poll {
    /// Returns the poll of these points, printed as `watch` does.
    pub fn new(items: Vec<Item>, json: bool) -> Self {
        Self {
            items,
            form: Watch {
                names: Vec::new(),
                every: POLLING,
                csv: false,
                json_lines: json,
                raw: false,
                count: None,
            },
            due: Instant::now(),
        }
    }
}

/// The line with the plan's needs.
pub struct Drive<'a> {
    /// The line.
    pub device: &'a mut Device,
    /// How long a unit has to answer when the plan has little patience.
    pub little: Duration,
    /// Points to poll, if any.
    pub poll: Option<Poll>,
    /// Shows how far the units are.
    pub progress: Progress,
}

/// Times of an update.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// Before the first block.
    pub prepare: Duration,
    /// From the first block to the last one that was repeated.
    pub blocks: Duration,
    /// After that.
    pub restart: Duration,
}

/// Returns the pause behind a block that takes this time. Adapters and the simulator may be some milliseconds late. On a
/// slow line a pause of that length costs little, and a block that is joined with the next one costs more.
fn unhurried(block: Duration) -> Duration {
    let pause = block / 20;
    if pause < Duration::from_millis(2) {
        Duration::ZERO
    } else {
        pause
    }
}

impl Drive<'_> {
    /// Carries out a plan. Fails only when the line does.
    pub async fn run(&mut self, campaign: &mut Campaign) -> Result<Times, Failure> {
        let begin = Instant::now();
        let (mut first, mut last) = (None, None);
        let mut block = begin;
        let mut sent = 0;
        self.progress.begin(campaign);
        while let Some(step) = campaign.next_step() {
            self.poll().await?;
            let started = Instant::now();
            let answer = match step {
                Step::Wait(time) => {
                    // The last block may still be on its way.
                    let free = self.device.master.free().max(Instant::now());
                    sleep_until(free + time).await;
                    None
                }
                Step::Probe(pdu) => {
                    let answers = self.device.master.probe(&pdu, LISTENING).await;
                    let answers = answers.map_err(|error| self.broken(error))?;
                    answers.then_some(pdu)
                }
                Step::Broadcast { pdu, apart, pause } => {
                    sleep_until(block + apart).await;
                    block = Instant::now();
                    let time = self.device.master.endpoint().time_of(pdu.len());
                    let pause = pause.max(unhurried(time));
                    let sent = self.device.master.broadcast(&pdu, pause).await;
                    sent.map_err(|error| self.broken(error))?;
                    None
                }
                Step::Ask {
                    unit,
                    pdu,
                    patience,
                } => self.ask(unit, &pdu, patience).await?,
            };
            campaign.take_answer(answer.as_deref());
            let (all, _) = campaign.blocks();
            if all > sent {
                sent = all;
                first.get_or_insert(started);
                last = Some(Instant::now());
            }
            self.progress.show(campaign);
        }
        let end = Instant::now();
        let (first, last) = (first.unwrap_or(end), last.unwrap_or(end));
        Ok(Times {
            prepare: first - begin,
            blocks: last - first,
            restart: end - last,
        })
    }

    fn broken(&self, error: std::io::Error) -> Failure {
        self.device.lost(None, &Lost::Broken(error))
    }

    async fn ask(
        &mut self,
        unit: u8,
        pdu: &[u8],
        patience: Patience,
    ) -> Result<Option<Vec<u8>>, Failure> {
        let master = &mut self.device.master;
        let usual = match patience {
            Patience::Little => Some(master.be_patient(self.little, 0)),
            Patience::Usual => None,
        };
        let answer = master.ask(unit, pdu).await;
        if let Some((timeout, retries)) = usual {
            master.be_patient(timeout, retries);
        }
        match answer {
            Ok(answer) => Ok(Some(answer)),
            Err(Lost::Silent | Lost::Absent(_) | Lost::Garbled(_)) => Ok(None),
            Err(lost @ Lost::Broken(_)) => Err(self.device.lost(None, &lost)),
        }
    }

    /// Polls the points, if it is time. A failed poll is shown, and changes nothing.
    async fn poll(&mut self) -> Result<(), Failure> {
        let Some(poll) = self.poll.as_mut().filter(|poll| Instant::now() >= poll.due) else {
            return Ok(());
        };
        poll.due = Instant::now() + POLLING;
        let usual = self.device.master.be_patient(self.little, 0);
        let values = self.device.read_items(&poll.items).await;
        self.device.master.be_patient(usual.0, usual.1);
        self.progress.pause(|| match values {
            Ok(values) => print(Local::now(), &poll.items, &values, &poll.form),
            Err(failure) => {
                let unit = self.device.unit;
                match failure {
                    Failure::NoAnswer(_) => {
                        eprintln!("modioctl: poll: unit {unit} does not answer")
                    }
                    Failure::Garbled(_) => eprintln!("modioctl: poll: garbled answer"),
                    failure => eprintln!("modioctl: poll: {failure}"),
                }
                Ok(())
            }
        })
    }
}
