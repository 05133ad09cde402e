//! Positions of the parts of the display, for drawing and for clicks of the mouse.

use ratatui::layout::{Constraint, Layout, Rect};

use super::model::Page;

/// Smallest width and height that the display fits in.
pub const LEAST: (u16, u16) = (60, 16);
const TREE: u16 = 50;
/// Smallest height of the chart when counters share its column.
const CHART: u16 = 12;
/// Height of the counters, with their title.
pub const COUNTERS: u16 = 12;

/// The parts of the display. A part that is not shown is empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Name of the unit and state of the connection.
    pub head: Rect,
    /// The names of the pages.
    pub tabs: Rect,
    /// The tree, with its title.
    pub tree: Rect,
    /// The chart, with its title.
    pub chart: Rect,
    /// The counters, with their title.
    pub counters: Rect,
    /// The log, with its title.
    pub frames: Rect,
    /// Messages, in two lines.
    pub message: Rect,
    /// The most important keys.
    pub keys: Rect,
}

impl Parts {
    /// Divides the screen.
    pub fn new(screen: Rect, page: Page) -> Self {
        let [head, tabs, main, message, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(2),
            Constraint::Length(1),
        ])
        .areas(screen);
        let parts = Self {
            head,
            tabs,
            message,
            keys,
            ..Self::default()
        };
        match page {
            Page::Points => parts.points(main),
            Page::Line => parts.line(main),
        }
    }

    fn points(self, main: Rect) -> Self {
        let log = (main.height / 3).max(4);
        let [upper, frames] =
            Layout::vertical([Constraint::Fill(1), Constraint::Length(log)]).areas(main);
        let [tree, _, right] = Layout::horizontal([
            Constraint::Length(TREE),
            Constraint::Length(1),
            Constraint::Fill(1),
        ])
        .areas(upper);
        let below = if right.height >= CHART + COUNTERS && right.width >= 2 * 28 {
            COUNTERS
        } else {
            0
        };
        let [chart, counters] =
            Layout::vertical([Constraint::Fill(1), Constraint::Length(below)]).areas(right);
        Self {
            tree,
            chart,
            counters,
            frames,
            ..self
        }
    }

    fn line(self, main: Rect) -> Self {
        let height = COUNTERS.min(main.height.saturating_sub(4));
        let [counters, frames] =
            Layout::vertical([Constraint::Length(height), Constraint::Fill(1)]).areas(main);
        Self {
            counters,
            frames,
            ..self
        }
    }

    /// Returns the rows below the title of a part.
    pub const fn inside(part: Rect) -> Rect {
        Rect {
            y: part.y.saturating_add(1),
            height: part.height.saturating_sub(1),
            ..part
        }
    }

    /// Returns the positions of the page names.
    pub fn pages(&self) -> [(Page, &'static str, Rect); 2] {
        let at = |x: u16, width| {
            let cell = Rect {
                x: self.tabs.x.saturating_add(x),
                width,
                ..self.tabs
            };
            cell.intersection(self.tabs)
        };
        [
            (Page::Points, " 1 Points ", at(0, 10)),
            (Page::Line, " 2 Line ", at(11, 8)),
        ]
    }

    /// Returns the area of the values in the tree. A click there operates an output.
    pub fn values(&self) -> Rect {
        let inside = Self::inside(self.tree);
        Rect {
            x: inside.x.saturating_add(VALUE_AT),
            width: VALUE,
            ..inside
        }
        .intersection(inside)
    }

    /// Returns the buttons of a failed write: to repeat it, and to drop it.
    pub fn buttons(&self) -> [Rect; 2] {
        let line = Rect {
            y: self.message.y.saturating_add(1),
            height: 1,
            ..self.message
        }
        .intersection(self.message);
        [(0, AGAIN.len()), (AGAIN.len() + 1, DROP.len())].map(|(x, width)| {
            let button = Rect {
                x: line.x.saturating_add(x as u16),
                width: width as u16,
                ..line
            };
            button.intersection(line)
        })
    }
}

/// Column of the tree in which values begin.
pub const VALUE_AT: u16 = 22;
/// Width of a value, including brackets.
pub const VALUE: u16 = 12;
/// The button that repeats a failed write.
pub const AGAIN: &str = "[r: try again]";
/// The button that drops a failed write.
pub const DROP: &str = "[Esc: leave it]";

/// The parts of the slider.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slider {
    /// The window.
    pub window: Rect,
    /// The bar.
    pub bar: Rect,
    /// The button that sends the value.
    pub send: Rect,
    /// The button that closes the window.
    pub leave: Rect,
}

/// The button that sends the slider's value.
pub const SEND: &str = "[Enter: send]";
/// The button that closes the slider.
pub const LEAVE: &str = "[Esc: leave]";

impl Slider {
    /// Places the slider in the middle of the screen.
    pub fn new(screen: Rect) -> Self {
        let window = centred(screen, 58, 9);
        let line = |y: u16, x: u16, width: usize| {
            let line = Rect {
                x: window.x.saturating_add(x),
                y: window.y.saturating_add(y),
                width: width as u16,
                height: 1,
            };
            line.intersection(window)
        };
        let wide = usize::from(window.width.saturating_sub(4));
        Self {
            window,
            bar: line(3, 2, wide),
            send: line(6, 2, SEND.len()),
            leave: line(6, 3 + SEND.len() as u16, LEAVE.len()),
        }
    }
}

/// Returns a window in the middle of the screen.
pub fn centred(screen: Rect, width: u16, height: u16) -> Rect {
    let (width, height) = (width.min(screen.width), height.min(screen.height));
    Rect {
        x: screen.x + (screen.width - width) / 2,
        y: screen.y + (screen.height - height) / 2,
        width,
        height,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_inside_a_screen_of_any_size() {
        for (width, height) in [
            (0, 0),
            (1, 1),
            (60, 16),
            (80, 24),
            (120, 40),
            (300, 5),
            (3, 200),
        ] {
            let screen = Rect::new(0, 0, width, height);
            for page in [Page::Points, Page::Line] {
                let parts = Parts::new(screen, page);
                let buttons = parts.buttons();
                let slider = Slider::new(screen);
                let all = [
                    parts.head,
                    parts.tree,
                    parts.chart,
                    parts.frames,
                    parts.keys,
                    parts.values(),
                    buttons[0],
                    buttons[1],
                    slider.window,
                    slider.bar,
                    slider.send,
                    slider.leave,
                ];
                for part in all {
                    assert!(
                        part.is_empty() || screen.intersection(part) == part,
                        "{part:?}"
                    );
                }
            }
        }
    }
}
