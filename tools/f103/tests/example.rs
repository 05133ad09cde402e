//! The example of another board behaves as docs/simulator-library.md describes.

#[path = "../examples/blue_pill.rs"]
#[allow(dead_code, reason = "main is for the command line")]
mod blue_pill;

use f103::Time;

#[test]
fn blue_pill_blinks_and_sends_lines_at_their_times() {
    let chip =
        blue_pill::run(&blue_pill::blinking(), Time::from_ms(200)).expect("the program fits");
    let events: Vec<_> = chip
        .circuit()
        .events
        .iter()
        .map(|(at, what)| (at.as_us(), what.as_str()))
        .collect();
    assert_eq!(
        events,
        [
            (2_501, "LED on"),
            (3_124, "UART: hello"),
            (52_954, "LED off"),
            (53_477, "UART: hello"),
            (103_306, "LED on"),
            (103_829, "UART: hello"),
            (153_659, "LED off"),
            (154_182, "UART: hello"),
        ]
    );
    assert!(chip.findings().is_empty());
}
