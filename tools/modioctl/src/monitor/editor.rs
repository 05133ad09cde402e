//! The slider that sets an analog output.

use modio_description::Reading;

use crate::names::{Item, Meaning};
use crate::value::{Shown, parse, show};

/// Largest number of characters that can be typed.
const MOST: usize = 12;

/// The slider, while it is open.
#[derive(Clone, Debug)]
pub struct Editor {
    /// The output.
    pub item: Item,
    /// Meaning of its number.
    pub reading: Reading,
    /// The new value in steps of the register.
    position: i32,
    /// Characters of an exact value; empty while the slider is used.
    pub typed: String,
    /// Reason why the typed value cannot be sent.
    pub wrong: Option<String>,
}

/// Distance that the slider moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// One step of the register.
    Least,
    /// A hundredth of the range.
    Small,
    /// A tenth of the range.
    Large,
}

impl Editor {
    /// Opens the slider at the present value, or at the lowest value when the present one is not known. Returns
    /// `None` when the point is not an analog output.
    pub fn new(item: &Item, words: Option<&[u16]>) -> Option<Self> {
        let Meaning::Analog(reading) = &item.meaning else {
            return None;
        };
        if !item.writable || reading.max <= reading.min {
            return None;
        }
        let now = words.and_then(|words| words.first()).map(|word| {
            if reading.min < 0 {
                i32::from(word.cast_signed())
            } else {
                i32::from(*word)
            }
        });
        Some(Self {
            item: item.clone(),
            reading: reading.clone(),
            position: now.unwrap_or(reading.min).clamp(reading.min, reading.max),
            typed: String::new(),
            wrong: None,
        })
    }

    /// Moves the slider; a negative number moves it to the left.
    pub fn slide(&mut self, steps: i32, step: Step) {
        let span = self.reading.max.saturating_sub(self.reading.min);
        let one = match step {
            Step::Least => 1,
            Step::Small => (span / 100).max(1),
            Step::Large => (span / 10).max(1),
        };
        self.place(self.position.saturating_add(steps.saturating_mul(one)));
    }

    /// Moves the slider to a position from 0 (left) to 1 (right).
    pub fn place_at(&mut self, part: f64) {
        let span = f64::from(self.reading.max) - f64::from(self.reading.min);
        let steps = (span * part.clamp(0.0, 1.0)).round();
        self.place(self.reading.min.saturating_add(steps as i32));
    }

    fn place(&mut self, position: i32) {
        self.position = position.clamp(self.reading.min, self.reading.max);
        self.typed.clear();
        self.wrong = None;
    }

    /// Returns the position of the slider, from 0 (left) to 1 (right).
    pub fn part(&self) -> f64 {
        let span = f64::from(self.reading.max) - f64::from(self.reading.min);
        (f64::from(self.position) - f64::from(self.reading.min)) / span
    }

    /// Adds a character of an exact value. Returns whether it can be part of a value.
    pub fn type_in(&mut self, character: char) -> bool {
        let fits = character.is_ascii_digit() || matches!(character, '.' | '-');
        if fits && self.typed.len() < MOST {
            self.typed.push(character);
            self.wrong = None;
        }
        fits
    }

    /// Removes the last character that was typed.
    pub fn rub_out(&mut self) {
        self.typed.pop();
        self.wrong = None;
    }

    /// Returns the value of the slider, for people.
    pub fn shown(&self) -> Shown {
        show(&self.item, &[self.position as u16], false)
    }

    /// Returns the lowest and the highest value, for people.
    pub fn ends(&self) -> [Shown; 2] {
        [self.reading.min, self.reading.max].map(|end| show(&self.item, &[end as u16], false))
    }

    /// Returns the words to write: the typed value, or the slider's value. When the typed value is not allowed,
    /// `wrong` contains the reason.
    pub fn words(&mut self) -> Option<Vec<u16>> {
        if self.typed.is_empty() {
            return Some(vec![self.position as u16]);
        }
        parse(&self.item, &self.typed, false)
            .map_err(|failure| self.wrong = Some(failure.to_string()))
            .ok()
    }
}

#[cfg(test)]
mod tests {
    use register_map::Module;
    use register_map::board::MODIO_02;

    use super::*;
    use crate::names::book;

    fn editor(now: Option<&[u16]>) -> Editor {
        let book = book(&MODIO_02, Module::Ao4, (1, 1));
        Editor::new(&book.find("p5.1").unwrap(), now).unwrap()
    }

    #[test]
    fn slider_moves_by_its_steps_and_stays_in_the_range() {
        let mut editor = editor(Some(&[12_000]));
        assert_eq!(editor.shown().to_string(), "12000 µA");
        editor.slide(1, Step::Small);
        editor.slide(-1, Step::Least);
        assert_eq!(editor.words(), Some(vec![12_159]));
        editor.slide(100, Step::Large);
        assert_eq!((editor.words(), editor.part()), (Some(vec![20_000]), 1.0));
        editor.place_at(-3.0);
        assert_eq!(editor.words(), Some(vec![4000]));
        editor.place_at(f64::NAN);
        assert_eq!(editor.words(), Some(vec![4000]));
    }

    #[test]
    fn typed_value_is_checked_when_it_is_sent() {
        let mut editor = editor(None);
        for character in "3000".chars() {
            assert!(editor.type_in(character));
        }
        assert!(!editor.type_in('x'));
        assert_eq!(editor.words(), None);
        assert!(
            editor
                .wrong
                .as_deref()
                .unwrap()
                .contains("4000 to 20000 µA")
        );
        editor.rub_out();
        editor.typed = "12345".to_owned();
        assert_eq!(editor.words(), Some(vec![12_345]));
        editor.slide(1, Step::Least);
        assert_eq!(
            editor.words(),
            Some(vec![4001]),
            "the slider replaces what was typed"
        );
    }

    #[test]
    fn only_analog_outputs_have_a_slider() {
        let book = book(&MODIO_02, Module::Ai4, (1, 1));
        assert!(Editor::new(&book.find("p5.1").unwrap(), None).is_none());
        assert!(Editor::new(&book.find("BAUD").unwrap(), None).is_none());
    }
}
