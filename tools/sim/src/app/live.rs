//! The events that `/api/events` streams: the state when it has changed, at most ten times a second, and every frame
//! when it has ended.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::sync::broadcast;

use super::scene::Scene;
use super::{api, frames, state};

/// Shortest time between two states.
const STATE_EVERY: Duration = Duration::from_millis(100);
/// Events that may wait for a client that does not read. Further events replace the oldest.
const WAITING: usize = 1024;

/// An event for the clients.
#[derive(Clone, Debug)]
pub struct Note {
    /// Number of the board that the event is about; `None` for a frame, which is about the whole line.
    pub board: Option<usize>,
    /// `state` or `frame`.
    pub name: &'static str,
    /// The data of the event, as JSON.
    pub data: Arc<str>,
}

impl Note {
    fn new(board: Option<usize>, name: &'static str, data: &Value) -> Self {
        Self {
            board,
            name,
            data: data.to_string().into(),
        }
    }
}

/// Sends the events to all clients that listen.
#[derive(Debug)]
pub struct Live {
    listeners: broadcast::Sender<Note>,
    /// The number of the last frame that was sent.
    frame: u64,
    /// The last state of each board that was sent, without its time.
    states: Vec<Value>,
    /// Time at which the states were compared last.
    compared: Option<Instant>,
}

impl Default for Live {
    fn default() -> Self {
        Self {
            listeners: broadcast::Sender::new(WAITING),
            frame: 0,
            states: Vec::new(),
            compared: None,
        }
    }
}

impl Live {
    /// Returns the channel of the events, for the server to subscribe its clients to.
    pub fn listeners(&self) -> broadcast::Sender<Note> {
        self.listeners.clone()
    }

    /// Sends the changes since the last call. `now` is the time of the wall clock. Without listeners this makes no
    /// JSON.
    pub fn send(&mut self, scene: &mut Scene, now: Instant) {
        if self.listeners.receiver_count() == 0 {
            let last = scene.bus.line().frames().next_back();
            self.frame = last.map_or(self.frame, |frame| frame.number);
            return;
        }
        for frame in scene.bus.line().frames_since(self.frame) {
            self.frame = frame.number;
            let _ =
                self.listeners
                    .send(Note::new(None, "frame", &api::json(&frames::frame(frame))));
        }
        // Only making a state as JSON shows whether it has changed, and that takes its time.
        if self.compared.is_some_and(|at| now < at + STATE_EVERY) {
            return;
        }
        self.compared = Some(now);
        self.states.resize(scene.units.len(), Value::Null);
        for (n, last) in self.states.iter_mut().enumerate() {
            let whole = api::json(&state::of_board(scene, n));
            let mut timeless = whole.clone();
            timeless["virtual_ms"] = Value::Null;
            if timeless != *last {
                *last = timeless;
                let _ = self.listeners.send(Note::new(Some(n), "state", &whole));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use sim::Time;

    use super::*;
    use crate::app::{Origin, testing::scene};

    fn taken(notes: &mut broadcast::Receiver<Note>) -> Vec<(&'static str, Value)> {
        std::iter::from_fn(|| notes.try_recv().ok())
            .map(|note| (note.name, serde_json::from_str(&note.data).unwrap()))
            .collect()
    }

    #[test]
    fn frames_are_sent_once_and_the_state_only_when_it_has_changed() {
        let mut scene = scene(Module::Di4);
        let mut live = Live::default();
        let begin = Instant::now();
        let request = [0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C];
        scene.send(&request, Origin::Pty);
        scene.bus.run_for(Time::from_ms(20));
        live.send(&mut scene, begin);
        let mut notes = live.listeners().subscribe();
        live.send(&mut scene, begin);
        let first = taken(&mut notes);
        assert_eq!(
            first.len(),
            1,
            "earlier frames are not sent again: {first:?}"
        );
        assert_eq!(first[0].0, "state");
        assert_eq!(first[0].1["line"]["rx_frames"], 1);

        scene.bus.run_for(Time::from_ms(500));
        live.send(&mut scene, begin + Duration::from_millis(500));
        assert!(taken(&mut notes).is_empty(), "only time has passed");

        scene.send(&request, Origin::Pty);
        scene.bus.run_for(Time::from_ms(20));
        scene.first().set_energised(2, true).unwrap();
        let later = begin + Duration::from_secs(1);
        for _ in 0..3 {
            live.send(&mut scene, later);
        }
        let then = taken(&mut notes);
        let names: Vec<_> = then.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["frame", "state"]);
        assert_eq!(then[0].1["bytes"], "0101001000043c0c");
        assert_eq!(then[1].1["channels"][1]["energised"], true);
    }

    #[test]
    fn states_are_compared_at_most_ten_times_a_second_also_when_nothing_changes() {
        let mut scene = scene(Module::Di4);
        let mut live = Live::default();
        let mut notes = live.listeners().subscribe();
        let begin = Instant::now();
        live.send(&mut scene, begin);
        live.send(&mut scene, begin + Duration::from_millis(1000));
        assert_eq!(taken(&mut notes).len(), 1, "nothing has changed");
        scene.first().set_energised(1, true).unwrap();
        live.send(&mut scene, begin + Duration::from_millis(1050));
        assert!(taken(&mut notes).is_empty(), "no state was made");
        live.send(&mut scene, begin + Duration::from_millis(1100));
        assert_eq!(taken(&mut notes).len(), 1);
    }

    #[test]
    fn state_is_sent_at_most_ten_times_a_second_and_ends_with_the_last_one() {
        let mut scene = scene(Module::Ai4);
        let mut live = Live::default();
        let mut notes = live.listeners().subscribe();
        let begin = Instant::now();
        for ms in 0..1000 {
            let millivolts = u16::try_from(ms).unwrap();
            scene.first().set_millivolts(1, millivolts).unwrap();
            live.send(&mut scene, begin + Duration::from_millis(ms));
        }
        live.send(&mut scene, begin + Duration::from_millis(1100));
        let sent = taken(&mut notes);
        assert!((9..=12).contains(&sent.len()), "{}", sent.len());
        let last = &sent.last().unwrap().1;
        assert_eq!(last["channels"][0]["millivolts"], 999);
    }
}
