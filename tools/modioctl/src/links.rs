//! Links of digital outputs, in the words of `modioctl link` and `modioctl links`, and in registers. With `follows`,
//! `inverts` and `switches` an input holds the output, so a master's write to it has no effect; with the other words input
//! and master share the output. `at each edge` is for a switch that is no button.
//!
//! ```text
//! p1.1 toggles p2.1                                  p2.1 follows p1.1 if alone
//! p1.1 toggles p2.1 at each edge                     p2.1 inverts p1.1
//! p1.1 pulses p2.1 for 90s                           p1.1 sets p2.1, p1.1 resets p2.1
//! p3.1 switches p2.1 on below 15.0 off above 18.0
//! ```

use register_map::codes::{LinkAction, Signal};
use register_map::links::{NO_SOURCE, WORDS};

use crate::failure::Failure;
use crate::names::{Book, Item, Meaning};
use crate::value::{point_name, show, time_of_pulse, words_of};

/// The words of no link.
pub const NONE: [u16; WORDS as usize] = [NO_SOURCE, 0, 0, 0];

/// Returns all links of a unit that has links.
pub fn all(book: &Book) -> Result<Vec<Item>, Failure> {
    check(book)?;
    let outputs = book.points();
    Ok(outputs.flat_map(|output| of(book, &output.name)).collect())
}

/// Returns the links of the output with this name; none for any other name.
pub fn of<'a>(book: &'a Book, output: &str) -> impl Iterator<Item = Item> + use<'a> {
    let output = output.to_owned();
    (1..).map_while(move |n| book.item(&format!("{output}.link{n}")).cloned())
}

/// Returns the output with this name, and its links. The error says why there are none.
pub fn of_output(book: &Book, name: &str) -> Result<(String, Vec<Item>), Failure> {
    check(book)?;
    let point = point(book, name)?;
    let links: Vec<_> = of(book, &point.name).collect();
    if links.is_empty() {
        return Err(Failure::usage(format!(
            "{} is no digital output, but {}: only digital outputs have links (an output is the first word with `follows` and `inverts`, else it follows the verb)",
            point.name,
            with_article(&point)
        )));
    }
    Ok((point.name, links))
}

/// Returns whether a link does something.
pub fn acts(words: &[u16]) -> bool {
    // The low byte is ACTION, the high byte WHEN.
    matches!(words, [source, action, ..] if *source != NO_SOURCE && action & 0xFF != 0)
}

fn check(book: &Book) -> Result<(), Failure> {
    let registers = &book.of_modio()?.registers;
    if registers.iter().any(|register| register.name == "link") {
        return Ok(());
    }
    Err(Failure::usage(
        "the unit has no links: only boards with several slots have them, such as a modio-08, and only with firmware that supports them",
    ))
}

fn point(book: &Book, name: &str) -> Result<Item, Failure> {
    let item = book.find(name)?;
    let ports = book.ports();
    let is_point = ports.iter().any(|port| port.points.contains(&item));
    match is_point {
        true => Ok(item),
        false => Err(Failure::usage(format!(
            "{} is no point: a link is between points such as p1.1 and p2.1",
            item.name
        ))),
    }
}

fn with_article(point: &Item) -> String {
    let article = match point.about.starts_with(['a', 'e', 'i', 'o', 'u']) {
        true => "an",
        false => "a",
    };
    format!("{article} {}", point.about)
}

/// Returns a link in words; as `modioctl write` has it when there are no words for it.
pub fn sentence(book: &Book, link: &Item, words: &[u16]) -> String {
    let output = link.name.rsplit_once('.').map_or("", |(output, _)| output);
    in_words(book, output, words).unwrap_or_else(|| show(link, words, false).text)
}

fn in_words(book: &Book, output: &str, words: &[u16]) -> Option<String> {
    let [source, action, time_or_high, low] = *words else {
        return None;
    };
    let point = book.item(&point_name(source))?;
    let name = &point.name;
    let is_bit = point.meaning == Meaning::Bit;
    let text = match action_of(action)? {
        LinkAction::Follow if is_bit => format!("{output} follows {name}"),
        LinkAction::Invert if is_bit => format!("{output} inverts {name}"),
        action @ (LinkAction::Follow | LinkAction::Invert) => {
            let [high, low] = [time_or_high, low].map(|word| show(point, &[word], false));
            match action {
                LinkAction::Follow => {
                    format!("{name} switches {output} on above {high} off below {low}")
                }
                _ => format!("{name} switches {output} on below {low} off above {high}"),
            }
        }
        LinkAction::Toggle => format!("{name} toggles {output}"),
        LinkAction::Change => format!("{name} toggles {output} at each edge"),
        LinkAction::Pulse => format!(
            "{name} pulses {output} for {}s",
            f64::from(time_or_high) / 10.0
        ),
        LinkAction::Set => format!("{name} sets {output}"),
        LinkAction::Reset => format!("{name} resets {output}"),
        _ => return None,
    };
    let when = if is_alone(action) { " if alone" } else { "" };
    Some(text + when)
}

/// Returns ACTION of a link, without WHEN.
pub fn action_of(word: u16) -> Option<LinkAction> {
    LinkAction::from_code(word)?;
    LinkAction::from_code(word & 0xFF)
}

/// Returns whether a link acts only while the communication watchdog has expired.
pub const fn is_alone(word: u16) -> bool {
    word >> 8 == 1
}

/// A link to write.
#[derive(Debug, PartialEq)]
pub struct Order {
    /// Name of the output.
    pub output: String,
    /// The links of the output, one of which is to be written.
    pub links: Vec<Item>,
    /// The words of the link.
    pub words: [u16; WORDS as usize],
}

const FORMS: &str = "a link is `INPUT toggles|sets|resets OUTPUT`, `INPUT toggles OUTPUT at each edge`, \
`INPUT pulses OUTPUT for 90s`, `OUTPUT follows|inverts INPUT`, `INPUT switches OUTPUT on above HIGH off below LOW`, each also with `if alone`, or \
`none OUTPUT`";

/// Parses a link in words.
pub fn parse(book: &Book, text: &str) -> Result<Order, Failure> {
    let all: Vec<_> = text.split_whitespace().collect();
    let (sentence, when) = match &all[..] {
        [sentence @ .., "if", "alone"] => (sentence, LinkAction::NoneAlone),
        sentence => (sentence, LinkAction::None),
    };
    let (source, verb, output, values) = match *sentence {
        [output, verb @ ("follows" | "inverts"), source] => (source, verb, output, &[][..]),
        [source, verb @ ("toggles" | "sets" | "resets"), output] => (source, verb, output, &[][..]),
        [source, "toggles", output, "at", "each", "edge"] => (source, "changes", output, &[][..]),
        [source, verb @ "pulses", output, "for", ref time @ ..] => (source, verb, output, time),
        [source, verb @ "switches", output, ref limits @ ..] => (source, verb, output, limits),
        _ => return Err(Failure::usage(FORMS)),
    };
    let (output, links) = of_output(book, output)?;
    let source = input(book, source, verb)?;
    let (action, values) = match verb {
        "follows" => (LinkAction::Follow, [0, 0]),
        "inverts" => (LinkAction::Invert, [0, 0]),
        "toggles" => (LinkAction::Toggle, [0, 0]),
        "changes" => (LinkAction::Change, [0, 0]),
        "sets" => (LinkAction::Set, [0, 0]),
        "resets" => (LinkAction::Reset, [0, 0]),
        "pulses" => (
            LinkAction::Pulse,
            [time_of_pulse(&values.join(" ")).map_err(Failure::usage)?, 0],
        ),
        _ => thresholds(&source, values)?,
    };
    let [time_or_high, low] = values;
    let action = action.code() | when.code();
    Ok(Order {
        output,
        links,
        words: [source.address, action, time_or_high, low],
    })
}

/// Says what a link with an analog source does when the wire of the source breaks; `None` for any other link.
pub fn note(book: &Book, order: &Order) -> Option<String> {
    let [source, ..] = order.words;
    let source = book.item(&point_name(source))?;
    let Meaning::Analog(reading) = &source.meaning else {
        return None;
    };
    let (name, output) = (&source.name, &order.output);
    let wants_safe = format!("the link wants what {output}.safe says");
    Some(match Signal::from_code(reading.range)? {
        // `warnings::of_links` warns of it.
        Signal::Voltage => return None,
        Signal::Current => format!(
            "while the loop of {name} is broken, {wants_safe}; a loop that fails high reads as above HIGH"
        ),
        Signal::Ntc => {
            format!("while the sensor of {name} is cut or short-circuited, {wants_safe}")
        }
    })
}

/// Returns the input with this name, which must suit the verb.
fn input(book: &Book, name: &str, verb: &str) -> Result<Item, Failure> {
    let point = point(book, name)?;
    let is = format!("{} is {}", point.name, with_article(&point));
    if point.writable {
        return Err(Failure::usage(format!(
            "{is}: the source of a link is an input"
        )));
    }
    match (verb, point.meaning == Meaning::Bit) {
        ("switches", true) => Err(Failure::usage(format!(
            "{is}: `switches ... on above ... off below ...` is for analog inputs; use `OUTPUT follows {name}`"
        ))),
        ("switches", false) | (_, true) => Ok(point),
        _ => Err(Failure::usage(format!(
            "{is}: use `{name} switches OUTPUT on above HIGH off below LOW`, or `on below LOW off above HIGH`"
        ))),
    }
}

/// Parses `on above HIGH off below LOW` or `on below LOW off above HIGH`, for this source.
fn thresholds(source: &Item, parts: &[&str]) -> Result<(LinkAction, [u16; 2]), Failure> {
    let off = parts.iter().position(|part| *part == "off");
    let (on, off) = parts.split_at(off.unwrap_or(parts.len()));
    let (action, high, low) = match (on, off) {
        (["on", "above", high @ ..], ["off", "below", low @ ..]) => (LinkAction::Follow, high, low),
        (["on", "below", low @ ..], ["off", "above", high @ ..]) => (LinkAction::Invert, high, low),
        _ => {
            return Err(Failure::usage(
                "an analog input switches an output `on above HIGH off below LOW`, or `on below LOW off above HIGH`",
            ));
        }
    };
    let word = |text: &[&str]| {
        let words = words_of(source, &text.join(" "));
        let word = words.map(|words| words.first().copied().unwrap_or_default());
        word.map_err(|takes| Failure::usage(format!("threshold {:?}: {takes}", text.join(" "))))
    };
    let [high, low] = [word(high)?, word(low)?];
    if low.cast_signed() > high.cast_signed() {
        return Err(Failure::usage(format!(
            "the threshold after `below` is higher than the one after `above`: {} > {}",
            show(source, &[low], false),
            show(source, &[high], false)
        )));
    }
    Ok((action, [high, low]))
}

#[cfg(test)]
mod tests {
    use modio_description::describe;
    use register_map::Module;
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::names;

    /// Returns the names of a modio-08 with inputs in port 1, outputs in port 2, and thermistors in port 3.
    fn book() -> Book {
        let description = describe(&MODIO_08, "0.1.0", |port| match port {
            1 => Module::Di4,
            2 => Module::Do4,
            3 => Module::Ai4,
            _ => Module::None,
        });
        Book::new(description, vec![(2, 1); 32])
    }

    fn wrong(text: &str) -> String {
        parse(&book(), text).unwrap_err().to_string()
    }

    #[test]
    fn sentences_are_parsed_and_printed_alike() {
        let book = book();
        let link = book.find("p2.1.link1").unwrap();
        for (text, words) in [
            ("p1.1 toggles p2.1", [0, 3, 0, 0]),
            ("p1.1 toggles p2.1 at each edge", [0, 7, 0, 0]),
            ("p1.1 toggles p2.1 at each edge if alone", [0, 0x107, 0, 0]),
            ("p1.2 sets p2.1 if alone", [1, 0x105, 0, 0]),
            ("p1.2 resets p2.1", [1, 6, 0, 0]),
            ("p1.1 pulses p2.1 for 90s", [0, 4, 900, 0]),
            ("p1.1 pulses p2.1 for 0.3s if alone", [0, 0x104, 3, 0]),
            ("p2.1 follows p1.4", [3, 1, 0, 0]),
            ("p2.1 inverts p1.1", [0, 2, 0, 0]),
            (
                "p3.1 switches p2.1 on above 18.0 °C off below 15.0 °C",
                [8, 1, 180, 150],
            ),
            (
                "p3.4 switches p2.1 on below -5.5 °C off above 0.0 °C if alone",
                [11, 0x102, 0, 0xFFC9],
            ),
        ] {
            let order = parse(&book, text).unwrap();
            assert_eq!(order.words, words, "{text}");
            assert_eq!(order.links.len(), 2);
            assert_eq!(sentence(&book, &link, &words), text);
        }
        let short = parse(&book, "P3.1 switches 2.1 on above 18 off below 15");
        assert_eq!(short.unwrap().words, [8, 1, 180, 150]);
    }

    #[test]
    fn link_without_words_is_printed_as_write_has_it() {
        let book = book();
        let link = book.find("p2.1.link2").unwrap();
        for (words, text) in [
            (NONE, "none"),
            ([0, 0, 0, 7], "p1.1, none, 0, 7"),
            ([0, 99, 0, 0], "p1.1, 99"),
            ([31, 3, 0, 0], "p8.4, toggle"),
        ] {
            assert_eq!(sentence(&book, &link, &words), text);
        }
    }

    #[test]
    fn wrong_points_are_reported() {
        assert!(wrong("p2.2 toggles p2.1").contains("p2.2 is a digital output: the source"));
        assert!(
            wrong("p1.1 toggles p1.2").contains("p1.2 is no digital output, but a digital input")
        );
        assert!(wrong("p1.1 toggles p3.1").contains("but an analog input"));
        assert!(wrong("BAUD toggles p2.1").contains("BAUD is no point"));
        assert!(wrong("p1.1 toggles p4.1").contains("no such point"));
        for text in ["p3.1 toggles p2.1", "p3.1 toggles p2.1 at each edge"] {
            assert!(wrong(text).contains("use `p3.1 switches OUTPUT"), "{text}");
        }
        let digital = wrong("p1.1 switches p2.1 on above 1 off below 0");
        assert!(digital.contains("use `OUTPUT follows p1.1`"), "{digital}");
        let one_slot = names::book(&MODIO_02, Module::Do4, (0, 0));
        let failure = parse(&one_slot, "p5.1 toggles p5.2").unwrap_err();
        assert!(failure.to_string().contains("several slots"), "{failure}");
    }

    #[test]
    fn wrong_values_are_reported() {
        for text in [
            "",
            "p1.1",
            "p1.1 blinks p2.1",
            "p1.1 toggles p2.1 for 1s",
            "p1.1 sets p2.1 at each edge",
            "p1.1 pulses p2.1",
        ] {
            assert!(wrong(text).contains("a link is `INPUT toggles"), "{text}");
        }
        for time in ["", "0", "-1s", "90d", "110min", "6553.6", "0.05s"] {
            let text = wrong(&format!("p1.1 pulses p2.1 for {time}"));
            assert!(text.contains("0.1 to 6553.5 s"), "{text}");
        }
        let limits = |text: &str| wrong(&format!("p3.1 switches p2.1 {text}"));
        for text in [
            "",
            "on above 18",
            "on above 18 off above 15",
            "off below 15 on above 18",
        ] {
            assert!(
                limits(text).contains("on below LOW off above HIGH"),
                "{text}"
            );
        }
        assert!(limits("on above 15 off below 18").contains("18.0 °C > 15.0 °C"));
        assert!(limits("on above 400 off below 18").contains("threshold \"400\": it takes -"));
        assert!(limits("on above off below 18").contains("threshold \"\""));
    }
}
