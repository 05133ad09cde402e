//! Tests of keys and the mouse.

use ratatui::crossterm::event::{
    Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::layout::Rect;
use register_map::Module;
use register_map::board::MODIO_08;
use tokio::time::Instant;

use super::fixture::{model, show};
use super::input::{Action, event};
use super::layout::{Parts, Slider};
use super::messages::Update;
use super::model::{Focus, Model, Page};
use crate::failure::Failure;
use crate::names::book;

const SCREEN: Rect = Rect::new(0, 0, 80, 24);

fn press(model: &mut Model, code: KeyCode, modifiers: KeyModifiers) -> Action {
    let pressed = Event::Key(KeyEvent::new(code, modifiers));
    event(model, &pressed, SCREEN, Instant::now())
}

fn key(model: &mut Model, code: KeyCode) -> Action {
    press(model, code, KeyModifiers::NONE)
}

fn mouse(model: &mut Model, screen: Rect, kind: MouseEventKind, at: (u16, u16)) -> Action {
    let mouse = MouseEvent {
        kind,
        column: at.0,
        row: at.1,
        modifiers: KeyModifiers::NONE,
    };
    event(model, &Event::Mouse(mouse), screen, Instant::now())
}

fn click(model: &mut Model, at: (u16, u16)) -> Action {
    mouse(model, SCREEN, MouseEventKind::Down(MouseButton::Left), at)
}

fn outputs(module: Module) -> Model {
    let now = Instant::now();
    let mut model = model(module, now);
    show(&mut model, now, &[4000, 4000, 4000, 4000]);
    model
}

fn written(action: &Action) -> Option<(&str, &[u16])> {
    match action {
        Action::Write(write) => Some((&write.item.name, &write.words)),
        _ => None,
    }
}

#[test]
fn space_and_enter_switch_the_selected_output() {
    let mut model = outputs(Module::Do4);
    let action = key(&mut model, KeyCode::Char(' '));
    assert_eq!(written(&action), Some(("p5.1", &[0][..])));
    key(&mut model, KeyCode::Down);
    let action = key(&mut model, KeyCode::Enter);
    assert_eq!(written(&action), Some(("p5.2", &[0][..])));
}

#[test]
fn q_and_ctrl_c_quit_and_released_keys_do_nothing() {
    let now = Instant::now();
    let mut model = outputs(Module::Ao4);
    assert_eq!(key(&mut model, KeyCode::Char('q')), Action::Quit);
    let ctrl_c = (KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert_eq!(press(&mut model, ctrl_c.0, ctrl_c.1), Action::Quit);
    key(&mut model, KeyCode::Enter);
    assert!(model.editor.is_some());
    assert_eq!(press(&mut model, ctrl_c.0, ctrl_c.1), Action::Quit);
    let mut released = KeyEvent::new(KeyCode::Char('q'), KeyModifiers::NONE);
    released.kind = KeyEventKind::Release;
    let action = event(&mut model, &Event::Key(released), SCREEN, now);
    assert_eq!(action, Action::None);
}

#[test]
fn slider_takes_arrows_digits_enter_and_esc() {
    let mut model = outputs(Module::Ao4);
    key(&mut model, KeyCode::Enter);
    key(&mut model, KeyCode::Right);
    press(&mut model, KeyCode::Right, KeyModifiers::SHIFT);
    key(&mut model, KeyCode::PageUp);
    key(&mut model, KeyCode::Down);
    let action = key(&mut model, KeyCode::Enter);
    assert_eq!(written(&action), Some(("p5.1", &[7359][..])));
    key(&mut model, KeyCode::Down);
    key(&mut model, KeyCode::Enter);
    for digit in "12q500".chars() {
        assert_eq!(key(&mut model, KeyCode::Char(digit)), Action::None);
    }
    let action = key(&mut model, KeyCode::Enter);
    assert_eq!(written(&action), Some(("p5.2", &[12_500][..])));
    key(&mut model, KeyCode::Down);
    key(&mut model, KeyCode::Enter);
    key(&mut model, KeyCode::Esc);
    assert!(model.editor.is_none());
}

#[test]
fn click_on_a_value_operates_and_elsewhere_only_selects() {
    let mut model = outputs(Module::Do4);
    model.tree.scrolled(10);
    assert_eq!(click(&mut model, (3, 6)), Action::None);
    assert_eq!(model.point().unwrap().name, "p5.3");
    let action = click(&mut model, (30, 6));
    assert_eq!(written(&action), Some(("p5.3", &[0][..])));
    assert_eq!(click(&mut model, (3, 3)), Action::None);
    assert!(!model.tree.is_open(5));
    assert_eq!(
        click(&mut model, (30, 12)),
        Action::None,
        "below the last row"
    );
    model.mouse = false;
    assert_eq!(click(&mut model, (30, 3)), Action::None);
    assert!(!model.tree.is_open(5), "the mouse is disabled");
}

#[test]
fn slider_is_set_by_the_mouse() {
    let mut model = outputs(Module::Ao4);
    key(&mut model, KeyCode::Enter);
    let slider = Slider::new(SCREEN);
    let end = (slider.bar.right() - 1, slider.bar.y);
    let drag = MouseEventKind::Drag(MouseButton::Left);
    mouse(&mut model, SCREEN, drag, end);
    let action = click(&mut model, (slider.send.x + 1, slider.send.y));
    assert_eq!(written(&action), Some(("p5.1", &[20_000][..])));
    key(&mut model, KeyCode::Down);
    key(&mut model, KeyCode::Enter);
    click(&mut model, (slider.leave.x, slider.leave.y));
    assert!(model.editor.is_none());
}

#[test]
fn failed_write_has_keys_and_buttons() {
    let now = Instant::now();
    let mut model = outputs(Module::Do4);
    let fail = |model: &mut Model| {
        model.pending.clear();
        show(model, now, &[0; 4]);
        let Some(write) = model.operate(now) else {
            panic!("the output cannot be operated");
        };
        let refused = Failure::Refused("exception 04".to_owned());
        model.update(Update::Wrote(write, Err(refused)), now);
    };
    fail(&mut model);
    let action = key(&mut model, KeyCode::Char('r'));
    assert_eq!(written(&action), Some(("p5.1", &[1][..])));
    fail(&mut model);
    key(&mut model, KeyCode::Esc);
    assert_eq!(key(&mut model, KeyCode::Char('r')), Action::None);
    fail(&mut model);
    let [again, drop] = Parts::new(SCREEN, Page::Points).buttons();
    let action = click(&mut model, (again.x, again.y));
    assert_eq!(written(&action), Some(("p5.1", &[1][..])));
    fail(&mut model);
    click(&mut model, (drop.x, drop.y));
    assert!(model.failed.is_empty());
}

#[test]
fn help_closes_with_any_key_and_blocks_other_actions() {
    let mut model = outputs(Module::Do4);
    key(&mut model, KeyCode::Char('?'));
    assert!(model.help);
    assert_eq!(key(&mut model, KeyCode::Char(' ')), Action::None);
    assert!(!model.help && model.pending.is_empty());
}

#[test]
fn pages_focus_and_log_follow_their_keys() {
    let mut model = outputs(Module::Do4);
    key(&mut model, KeyCode::Tab);
    assert_eq!(model.focus, Focus::Frames);
    key(&mut model, KeyCode::Char('2'));
    key(&mut model, KeyCode::Char('p'));
    key(&mut model, KeyCode::Char('x'));
    assert!(model.page == Page::Line && model.frames.paused && model.frames.hex);
    click(&mut model, (3, 1));
    assert_eq!(model.page, Page::Points);
    assert_eq!(key(&mut model, KeyCode::Char('m')), Action::Mouse(false));
}

#[test]
fn any_event_on_any_screen_is_handled() {
    let now = Instant::now();
    let mut model = outputs(Module::Ao4);
    let eight = Box::new(book(&MODIO_08, Module::Do4, (0, 0)));
    model.update(Update::Learned(eight), now);
    let codes = [
        KeyCode::Home,
        KeyCode::End,
        KeyCode::PageUp,
        KeyCode::PageDown,
        KeyCode::Left,
        KeyCode::Right,
        KeyCode::Enter,
        KeyCode::Tab,
        KeyCode::Char('\u{0}'),
        KeyCode::Null,
    ];
    for (width, height) in [(0, 0), (1, 1), (80, 24), (u16::MAX, u16::MAX)] {
        let screen = Rect::new(0, 0, width, height);
        for code in codes {
            let pressed = Event::Key(KeyEvent::new(code, KeyModifiers::SHIFT));
            event(&mut model, &pressed, screen, now);
        }
        for at in [(0, 0), (79, 23), (u16::MAX, u16::MAX)] {
            for kind in [
                MouseEventKind::Down(MouseButton::Left),
                MouseEventKind::ScrollUp,
            ] {
                mouse(&mut model, screen, kind, at);
            }
        }
    }
}
