//! Positions of the parts of the display, for drawing and for clicks of the mouse.

use ratatui::layout::Constraint::{Fill, Length};
use ratatui::layout::{Layout, Rect};

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
        let rows = [Length(1), Length(1), Fill(1), Length(2), Length(1)];
        let [head, tabs, main, message, keys] = Layout::vertical(rows).areas(screen);
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
        let [upper, frames] = Layout::vertical([Fill(1), Length(log)]).areas(main);
        let columns = [Length(TREE), Length(1), Fill(1)];
        let [tree, _, right] = Layout::horizontal(columns).areas(upper);
        let below = if right.height >= CHART + COUNTERS && right.width >= 2 * 28 {
            COUNTERS
        } else {
            0
        };
        let [chart, counters] = Layout::vertical([Fill(1), Length(below)]).areas(right);
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
        let [counters, frames] = Layout::vertical([Length(height), Fill(1)]).areas(main);
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
        let at = |x, width| within(self.tabs, x, 0, width, 1);
        [
            (Page::Points, " 1 Points ", at(0, 10)),
            (Page::Line, " 2 Line ", at(11, 8)),
        ]
    }

    /// Returns the area of the values in the tree. A click there operates an output.
    pub fn values(&self) -> Rect {
        let inside = Self::inside(self.tree);
        within(inside, VALUE_AT, 0, VALUE, inside.height)
    }

    /// Returns the buttons of a failed write: to repeat it, and to drop it.
    pub fn buttons(&self) -> [Rect; 2] {
        let button = |x: usize, text: &str| within(self.message, x as u16, 1, text.len() as u16, 1);
        [button(0, AGAIN), button(AGAIN.len() + 1, DROP)]
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
        let line = |y, x, width: usize| within(window, x, y, width as u16, 1);
        let wide = usize::from(window.width.saturating_sub(4));
        Self {
            window,
            bar: line(3, 2, wide),
            send: line(6, 2, SEND.len()),
            leave: line(6, 3 + SEND.len() as u16, LEAVE.len()),
        }
    }
}

/// Returns a part of an area, at a distance from its upper left corner. What lies outside of the area is left out.
pub fn within(area: Rect, x: u16, y: u16, width: u16, height: u16) -> Rect {
    let (x, y) = (area.x.saturating_add(x), area.y.saturating_add(y));
    Rect::new(x, y, width, height).intersection(area)
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
        for size in ["0x0", "1x1", "60x16", "80x24", "120x40", "300x5", "3x200"] {
            let (width, height) = size.split_once('x').unwrap();
            let screen = Rect::new(0, 0, width.parse().unwrap(), height.parse().unwrap());
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
                    let outside = screen.intersection(part) != part;
                    assert!(part.is_empty() || !outside, "{part:?}");
                }
            }
        }
    }
}
