//! `modioctl monitor`: a unit on the whole screen.
//!
//! Three parts run concurrently, and none waits for another. Only the [polling task](poll) uses the line. A thread
//! reads keys and the mouse. The loop in [`run`] applies the messages of both to the [model](model::Model) and
//! draws it.

pub mod draw;
pub mod edges;
pub mod editor;
#[cfg(test)]
mod fixture;
pub mod frames;
pub mod history;
pub mod input;
#[cfg(test)]
mod input_tests;
pub mod layout;
pub mod link;
pub mod messages;
pub mod model;
#[cfg(test)]
mod model_tests;
mod orders;
pub mod plan;
pub mod poll;
#[cfg(test)]
mod poll_tests;
pub mod screen;
pub mod tree;

use std::io::{IsTerminal, stderr, stdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ratatui::layout::Rect;
use tokio::sync::mpsc::unbounded_channel;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

use self::input::Action;
use self::messages::Update;
use self::model::Model;
use self::poll::{Observers, Poller};
use self::screen::Screen;
use crate::bus::{Endpoint, Seen};
use crate::cli::Monitor;
use crate::device::{Device, fetch, place};
use crate::failure::Failure;
use crate::trace;

/// Interval at which the display is drawn. The ages of values increase without messages.
const FRAME: Duration = Duration::from_millis(100);

/// Longest time from the loss of a closed terminal to the signal.
const HANGUP: Duration = Duration::from_millis(500);

/// Shows the unit until the user quits. Fails without a terminal, or without a modio at the start. A unit that is lost
/// later is shown as lost.
pub async fn run(
    endpoint: Endpoint,
    options: &Monitor,
    traced: bool,
    refresh: bool,
) -> Result<(), Failure> {
    if !stdout().is_terminal() {
        return Err(Failure::usage(
            "monitor needs a terminal; `modioctl watch` prints values into files and pipes",
        ));
    }
    if traced && stderr().is_terminal() {
        return Err(Failure::usage(
            "--trace would write over the monitor: add `2>FILE`, or look at its own log of frames",
        ));
    }
    // Polling repeats its requests anyway. A write must not be repeated after the user has seen no effect.
    let endpoint = Endpoint {
        retries: 0,
        ..endpoint
    };
    let (updates, mut news) = unbounded_channel();
    let mut observers: Observers = {
        let updates = updates.clone();
        Box::new(move || {
            let updates = updates.clone();
            let mut trace = traced.then(trace::to_stderr);
            Box::new(move |seen: &Seen| {
                if let Some(trace) = &mut trace {
                    trace(seen);
                }
                let _ = updates.send(Update::Seen(seen.clone()));
            })
        })
    };
    let mut device = Device::open(endpoint.clone(), Some(observers())).await?;
    device.refresh = refresh;
    if let Some(failure) = first(&mut device).await? {
        let _ = updates.send(Update::Lost(failure));
    }
    let (orders, writes) = unbounded_channel();
    let mut model = Model::new(
        place(&endpoint),
        endpoint.unit,
        options.every,
        Instant::now(),
    );
    let (mut screen, mut events) = Screen::open()?;
    let wants_edges = Arc::new(AtomicBool::new(false));
    let poller = Poller::new(
        device,
        options.every,
        observers,
        updates,
        writes,
        Arc::clone(&wants_edges),
    );
    let mut poller = tokio::spawn(poller.run());
    let mut ended = std::pin::pin!(ended());
    let mut frames = interval(FRAME);
    frames.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut area = Rect::default();
    let mut dirty = true;
    loop {
        tokio::select! {
            // Messages of a fast line must not delay keys.
            biased;
            () = &mut ended => return Ok(()),
            event = events.recv() => {
                let event = match event {
                    Some(Ok(event)) => event,
                    Some(Err(error)) => return lost(ended, &error.to_string()).await,
                    None => return lost(ended, "no more input").await,
                };
                match input::event(&mut model, &event, area, Instant::now()) {
                    Action::None => {}
                    Action::Quit => return Ok(()),
                    Action::Write(write) => {
                        let _ = orders.send(write);
                    }
                    Action::Mouse(take) => screen.take_mouse(take),
                }
                dirty = true;
            }
            _ = frames.tick() => dirty = true,
            Some(update) = news.recv() => model.update(update, Instant::now()),
            result = &mut poller => {
                return Err(Failure::usage(match result {
                    Err(error) => format!("polling has ended: {error}"),
                    Ok(()) => "polling has ended".to_owned(),
                }));
            }
        }
        if screen.has_panicked() {
            return Err(Failure::usage(
                "a part of the monitor has panicked, as shown above",
            ));
        }
        wants_edges.store(model.shows_edges(), Ordering::Relaxed);
        // Handle waiting events before the next drawing.
        if dirty && events.is_empty() {
            let drawn = screen.terminal.draw(|frame| {
                area = frame.area();
                draw::draw(frame, &mut model, Instant::now());
            });
            if let Err(error) = drawn {
                return lost(ended, &error.to_string()).await;
            }
            dirty = false;
        }
    }
}

/// Checks that the unit is a modio before the display begins. A single lost frame does not end the program: the
/// failure is returned.
async fn first(device: &mut Device) -> Result<Option<Failure>, Failure> {
    let (learned, failure) = match fetch(device).await {
        Err(failure) if failure.may_pass() => (fetch(device).await?, Some(failure)),
        result => (result?, None),
    };
    learned.book.of_modio()?;
    // The poller learns the same again, from the stored description.
    device.refresh = false;
    Ok(failure)
}

/// Ends without a terminal. If it has been closed, the signal of that follows, and this is no failure.
async fn lost(ended: impl Future<Output = ()>, why: &str) -> Result<(), Failure> {
    timeout(HANGUP, ended)
        .await
        .map_err(|_| Failure::usage(format!("the terminal is lost: {why}")))
}

/// Returns when the system asks the program to end, or when the terminal has been closed.
#[cfg(unix)]
async fn ended() {
    use tokio::signal::unix::{SignalKind, signal};
    let (Ok(mut term), Ok(mut hangup)) = (
        signal(SignalKind::terminate()),
        signal(SignalKind::hangup()),
    ) else {
        return std::future::pending().await;
    };
    tokio::select! {
        _ = term.recv() => {}
        _ = hangup.recv() => {}
    }
}

#[cfg(not(unix))]
async fn ended() {
    std::future::pending().await
}
