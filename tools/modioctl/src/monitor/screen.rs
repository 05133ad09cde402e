//! The terminal: prepared for the display, and restored at every kind of end.

use std::io::{self, stdout};
use std::mem::ManuallyDrop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, DisableMouseCapture, EnableMouseCapture, Event};
use ratatui::crossterm::execute;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

use crate::failure::Failure;

/// Interval at which the thread that reads keys checks whether the display has ended.
const LOOK: Duration = Duration::from_millis(50);

/// The terminal while the display is shown. Dropping it restores the terminal.
pub struct Screen {
    /// Draws on the terminal. It is never dropped: that would print on a terminal that is closed, and panic.
    pub terminal: ManuallyDrop<DefaultTerminal>,
    /// Whether a task or a thread has panicked. In that case the terminal has been restored and shows the reason.
    panicked: Arc<AtomicBool>,
    ended: Arc<AtomicBool>,
    reader: JoinHandle<()>,
}

impl Screen {
    /// Prepares the terminal and reads its events.
    pub fn open() -> Result<(Self, UnboundedReceiver<io::Result<Event>>), Failure> {
        // The hook that ratatui sets prints on a terminal that is closed, and so panics again: it is replaced below.
        let hook = std::panic::take_hook();
        let terminal = ratatui::try_init().map_err(|error| {
            restore();
            Failure::usage(format!("the terminal cannot be used: {error}"))
        })?;
        let panicked = Arc::new(AtomicBool::new(false));
        std::panic::set_hook(Box::new({
            let panicked = Arc::clone(&panicked);
            move |info| {
                panicked.store(true, Ordering::Relaxed);
                let _ = execute!(stdout(), DisableMouseCapture);
                restore();
                hook(info);
            }
        }));
        let ended = Arc::new(AtomicBool::new(false));
        let (events, receiver) = unbounded_channel();
        let reader = std::thread::Builder::new().name("keys".to_owned()).spawn({
            let ended = Arc::clone(&ended);
            move || read(&events, &ended)
        });
        let reader = reader.map_err(|error| {
            restore();
            Failure::usage(format!("keys cannot be read: {error}"))
        })?;
        let mut screen = Self {
            terminal: ManuallyDrop::new(terminal),
            panicked,
            ended,
            reader,
        };
        screen.take_mouse(true);
        Ok((screen, receiver))
    }

    /// Returns whether a part of the program has panicked, so that nothing may be drawn any more.
    pub fn has_panicked(&self) -> bool {
        self.panicked.load(Ordering::Relaxed)
    }

    /// Handles clicks of the mouse, or leaves them to the terminal.
    pub fn take_mouse(&mut self, take: bool) {
        // A terminal without a mouse is operated by keys.
        let _ = if take {
            execute!(stdout(), EnableMouseCapture)
        } else {
            execute!(stdout(), DisableMouseCapture)
        };
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        let _ = self.terminal.show_cursor();
        // Restoring it a second time would move the cursor into the text of the panic.
        if self.has_panicked() {
            return;
        }
        self.take_mouse(false);
        // Pending reports of the mouse must not reach the shell. On a closed terminal the thread never returns from
        // crossterm, so the program stops waiting for it after a moment.
        let until = Instant::now() + LOOK * 4;
        while !self.reader.is_finished() && Instant::now() < until {
            std::thread::sleep(LOOK / 10);
        }
        restore();
    }
}

/// Restores the terminal, if it is still there.
fn restore() {
    let _ = ratatui::try_restore();
}

fn read(events: &UnboundedSender<io::Result<Event>>, ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        let event = match event::poll(LOOK) {
            Ok(false) => continue,
            Ok(true) => event::read(),
            Err(error) => Err(error),
        };
        let failed = event.is_err();
        if events.send(event).is_err() || failed {
            return;
        }
    }
}
