//! Handles keys and the mouse.

use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::layout::{Position, Rect};
use tokio::time::Instant;

use super::editor::Step;
use super::layout::{Parts, Slider};
use super::messages::Write;
use super::model::{Focus, Model, Page};

/// Rows per step of the mouse wheel.
const WHEEL: isize = 3;

/// Action of the program after an event, besides drawing.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Nothing.
    None,
    Quit,
    Write(Write),
    /// Handle clicks of the mouse, or leave them to the terminal.
    Mouse(bool),
}

impl From<Option<Write>> for Action {
    fn from(write: Option<Write>) -> Self {
        write.map_or(Self::None, Self::Write)
    }
}

/// Handles a key or the mouse. `screen` is the whole display as it was drawn last.
pub fn event(model: &mut Model, event: &Event, screen: Rect, now: Instant) -> Action {
    match event {
        // Windows also reports released keys.
        Event::Key(key) if key.kind != KeyEventKind::Release => self::key(model, *key, screen, now),
        Event::Mouse(mouse) if model.mouse => self::mouse(model, *mouse, screen, now),
        _ => Action::None,
    }
}

fn key(model: &mut Model, key: KeyEvent, screen: Rect, now: Instant) -> Action {
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        let quits = matches!(key.code, KeyCode::Char('c' | 'C'));
        return if quits { Action::Quit } else { Action::None };
    }
    if model.help {
        let quits = key.code == KeyCode::Char('q');
        model.help = false;
        return if quits { Action::Quit } else { Action::None };
    }
    if model.editor.is_some() {
        return slider_key(model, key, now);
    }
    match key.code {
        KeyCode::Char('q' | 'Q') => return Action::Quit,
        KeyCode::Char('?' | 'h') | KeyCode::F(1) => model.help = true,
        KeyCode::Char('1') => model.page = Page::Points,
        KeyCode::Char('2') => model.page = Page::Line,
        KeyCode::Char('r' | 'R') => return model.retry(now).into(),
        KeyCode::Esc => {
            model.failed.pop();
        }
        KeyCode::Char('m') => {
            model.mouse = !model.mouse;
            let says = if model.mouse {
                "clicks operate the monitor"
            } else {
                "clicks belong to the terminal: select text with them; m returns them to the monitor"
            };
            model.say(says, now);
            return Action::Mouse(model.mouse);
        }
        KeyCode::Char('p') => model.frames.pause(),
        KeyCode::Char('x') => model.frames.hex = !model.frames.hex,
        KeyCode::Tab | KeyCode::BackTab => {
            model.focus = match focus(model) {
                Focus::Tree => Focus::Frames,
                Focus::Frames => Focus::Tree,
            };
        }
        code => return moving(model, code, screen, now),
    }
    Action::None
}

/// Returns the part that receives movement keys. The page of the line contains only its log.
pub fn focus(model: &Model) -> Focus {
    match model.page {
        Page::Points => model.focus,
        Page::Line => Focus::Frames,
    }
}

fn moving(model: &mut Model, code: KeyCode, screen: Rect, now: Instant) -> Action {
    let parts = Parts::new(screen, model.page);
    let focus = focus(model);
    let part = match focus {
        Focus::Tree => parts.tree,
        Focus::Frames => parts.frames,
    };
    let height = usize::from(Parts::inside(part).height);
    let page = isize::try_from(height).unwrap_or(1).max(2) - 1;
    let by = match code {
        KeyCode::Up | KeyCode::Char('k') => -1,
        KeyCode::Down | KeyCode::Char('j') => 1,
        KeyCode::PageUp => -page,
        KeyCode::PageDown => page,
        KeyCode::Home => isize::MIN / 2,
        KeyCode::End => isize::MAX / 2,
        _ if focus == Focus::Tree => return operating(model, code, now),
        _ => return Action::None,
    };
    match focus {
        Focus::Tree => model.tree.move_by(by),
        Focus::Frames => model.frames.scroll(by, height),
    }
    Action::None
}

fn operating(model: &mut Model, code: KeyCode, now: Instant) -> Action {
    match (code, model.tree.port()) {
        (KeyCode::Left, None) => model.tree.select_port(),
        (KeyCode::Left, Some(port)) => model.tree.set_open(port, false),
        (KeyCode::Right, Some(port)) => model.tree.set_open(port, true),
        (KeyCode::Char(' ') | KeyCode::Enter, Some(port)) => model.tree.toggle(port),
        (KeyCode::Char(' ') | KeyCode::Enter, None) => return model.operate(now).into(),
        _ => {}
    }
    Action::None
}

fn slider_key(model: &mut Model, key: KeyEvent, now: Instant) -> Action {
    let Some(editor) = &mut model.editor else {
        return Action::None;
    };
    let step = if key.modifiers.contains(KeyModifiers::SHIFT) {
        Step::Large
    } else {
        Step::Small
    };
    match key.code {
        KeyCode::Enter => return model.send_edited(now).into(),
        KeyCode::Esc => model.editor = None,
        KeyCode::Left => editor.slide(-1, step),
        KeyCode::Right => editor.slide(1, step),
        KeyCode::Down => editor.slide(-1, Step::Least),
        KeyCode::Up => editor.slide(1, Step::Least),
        KeyCode::PageDown => editor.slide(-1, Step::Large),
        KeyCode::PageUp => editor.slide(1, Step::Large),
        KeyCode::Home => editor.place_at(0.0),
        KeyCode::End => editor.place_at(1.0),
        KeyCode::Backspace => editor.rub_out(),
        KeyCode::Char(character) => {
            editor.type_in(character);
        }
        _ => {}
    }
    Action::None
}

fn mouse(model: &mut Model, mouse: MouseEvent, screen: Rect, now: Instant) -> Action {
    let at = Position::new(mouse.column, mouse.row);
    let wheel = match mouse.kind {
        MouseEventKind::ScrollUp => -WHEEL,
        MouseEventKind::ScrollDown => WHEEL,
        MouseEventKind::Down(MouseButton::Left) => 0,
        MouseEventKind::Drag(MouseButton::Left) if model.editor.is_some() => 0,
        _ => return Action::None,
    };
    if model.help {
        model.help = wheel != 0;
        return Action::None;
    }
    if model.editor.is_some() {
        return slider_mouse(model, mouse, screen, now);
    }
    let parts = Parts::new(screen, model.page);
    if wheel != 0 {
        let height = usize::from(Parts::inside(parts.frames).height);
        if parts.frames.contains(at) {
            model.frames.scroll(wheel, height);
        } else if parts.tree.contains(at) {
            model.tree.move_by(wheel.signum());
        }
        return Action::None;
    }
    click(model, &parts, at, now)
}

fn click(model: &mut Model, parts: &Parts, at: Position, now: Instant) -> Action {
    for (page, _, cell) in parts.pages() {
        if cell.contains(at) {
            model.page = page;
        }
    }
    if !model.failed.is_empty() {
        let [again, drop] = parts.buttons();
        if again.contains(at) {
            return model.retry(now).into();
        }
        if drop.contains(at) {
            model.failed.pop();
        }
    }
    if parts.frames.contains(at) {
        model.focus = Focus::Frames;
    }
    if parts.tree.contains(at) {
        model.focus = Focus::Tree;
    }
    let inside = Parts::inside(parts.tree);
    if !inside.contains(at) {
        return Action::None;
    }
    let index = model.tree.offset() + usize::from(at.y - inside.y);
    if index >= model.tree.rows().len() {
        return Action::None;
    }
    model.tree.select(index);
    if let Some(port) = model.tree.port() {
        model.tree.toggle(port);
    }
    let writable = model.point().is_some_and(|point| point.writable);
    if writable && parts.values().contains(at) {
        return model.operate(now).into();
    }
    Action::None
}

fn slider_mouse(model: &mut Model, mouse: MouseEvent, screen: Rect, now: Instant) -> Action {
    let slider = Slider::new(screen);
    let at = Position::new(mouse.column, mouse.row);
    let Some(editor) = &mut model.editor else {
        return Action::None;
    };
    let click = mouse.kind == MouseEventKind::Down(MouseButton::Left);
    match mouse.kind {
        MouseEventKind::ScrollUp => editor.slide(1, Step::Small),
        MouseEventKind::ScrollDown => editor.slide(-1, Step::Small),
        _ if slider.bar.contains(at) => {
            let last = slider.bar.width.saturating_sub(1).max(1);
            editor.place_at(f64::from(at.x - slider.bar.x) / f64::from(last));
        }
        _ if click && slider.send.contains(at) => return model.send_edited(now).into(),
        _ if click && slider.leave.contains(at) => model.editor = None,
        _ => {}
    }
    Action::None
}
