//! Writes that the user orders.

use tokio::time::Instant;

use super::editor::Editor;
use super::link::State;
use super::messages::Write;
use super::model::{Failed, Model, Pending};
use crate::names::{Item, Meaning};

impl Model {
    /// Switches the selected digital output to the state that is not shown, or opens the slider of an analog output.
    pub fn operate(&mut self, now: Instant) -> Option<Write> {
        let item = self.point()?.clone();
        let name = &item.name;
        if !item.writable {
            self.say(&format!("{name} is an input: it cannot be set"), now);
            return None;
        }
        if self.pending.contains_key(name) {
            self.say(&format!("{name} is still being written"), now);
            return None;
        }
        let fresh = self.value(name, now).filter(|(_, fresh)| *fresh);
        let words = fresh.map(|(value, _)| value.words.clone());
        let Some(words) = words.filter(|_| self.link.state(now) == State::Answers) else {
            self.say(
                &format!("{name} is not switched: its present value is not known"),
                now,
            );
            return None;
        };
        match item.meaning {
            Meaning::Bit => {
                let on = words.first().is_some_and(|word| *word != 0);
                Some(self.order(item, vec![u16::from(!on)], now))
            }
            Meaning::Analog(_) => {
                self.editor = Editor::new(&item, Some(&words));
                None
            }
            _ => {
                let text = format!("{name}: its RANGE and SCALE are not known to this program");
                self.say(&text, now);
                None
            }
        }
    }

    /// Closes the slider and returns its value to write.
    pub fn send_edited(&mut self, now: Instant) -> Option<Write> {
        let mut editor = self.editor.take()?;
        match editor.words() {
            Some(words) => Some(self.order(editor.item, words, now)),
            None => {
                self.editor = Some(editor);
                None
            }
        }
    }

    /// Returns the write that failed last, to repeat it.
    pub fn retry(&mut self, now: Instant) -> Option<Write> {
        let Failed { write, .. } = self.failed.pop()?;
        Some(self.order(write.item, write.words, now))
    }

    fn order(&mut self, item: Item, words: Vec<u16>, now: Instant) -> Write {
        let pending = Pending {
            words: words.clone(),
            confirmed: None,
        };
        self.pending.insert(item.name.clone(), pending);
        Write {
            item,
            words,
            ordered: now,
        }
    }
}
