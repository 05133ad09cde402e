//! Bench files, right and wrong.

use super::*;

#[test]
fn examples_in_the_manual_are_read() {
    let manual = include_str!("../../../../../docs/hil.md");
    let examples: Vec<BenchFile> = manual
        .split("```toml\n")
        .skip(1)
        .map(|rest| BenchFile::parse(rest.split("```").next().unwrap(), None).unwrap())
        .collect();
    let [bench, wires] = &examples[..] else {
        panic!("{} examples", examples.len());
    };
    assert_eq!((bench.unit, bench.baud), (Some(1), Some(9600)));
    assert_eq!(bench.module, Some(Module::Do4));
    assert_eq!(bench.probe.as_deref(), Some("0483:3748"));
    let [wire, analog] = wires.wires[..] else {
        panic!("{wires:?}");
    };
    let shown = "unit 1 point 0x0010 to unit 2 point 0x0010";
    assert_eq!(wire.to_string(), shown);
    let carries = Carries::Bit {
        inverted: true,
        pulses: 100,
    };
    assert_eq!((wire.within.as_millis(), wire.carries), (50, carries));
    let carries = Carries::Word { tolerance: 40 };
    assert_eq!((analog.carries, analog.from.unit), (carries, 3));
}

#[test]
fn keys_that_are_left_out_have_their_defaults_and_the_unit_is_that_of_the_command_line() {
    let text = "unit = 8\n[[wire]]\nfrom = { point = 0x10 }\nto = { unit = 2, point = 17 }\n\
                [[analog]]\nfrom = { point = 18 }\nto = { point = 17 }\ntolerance = 1\n";
    let file = BenchFile::parse(text, None).unwrap();
    assert_eq!(file.wires[0].from.unit, 8);
    let file = BenchFile::parse(text, Some(9)).unwrap();
    let (wire, analog) = (file.wires[0], file.wires[1]);
    assert_eq!((wire.from.unit, analog.to.unit), (9, 9));
    let carries = Carries::Bit {
        inverted: false,
        pulses: 0,
    };
    assert_eq!((wire.within, wire.carries), (usual(), carries));
    assert_eq!(analog.within, filtered());
    assert_eq!(BenchFile::parse("", None), Ok(BenchFile::default()));
}

#[test]
fn error_is_one_line_that_begins_with_the_number_of_the_line() {
    let wire =
        |from: &str, to: &str, more: &str| format!("[[wire]]\nfrom = {from}\nto = {to}\n{more}\n");
    let good = wire("{ point = 16 }", "{ unit = 2, point = 16 }", "");
    let (one, two) = ("{ point = 1 }", "{ point = 2 }");
    let back = wire("{ unit = 2, point = 16 }", one, "");
    for (text, wrong) in [
        ("\ncolour = 3".to_owned(), "2: unknown field `colour`"),
        ("\n[[wires]]".to_owned(), "2: unknown field `wires`"),
        ("[[wire".to_owned(), "1: "),
        ("unit = 248".to_owned(), "1: unit = 248 is not"),
        ("unit = \"1\"".to_owned(), "1: invalid type"),
        ("baud = 100".to_owned(), "1: baud = 100 is not"),
        ("format = \"8X2\"".to_owned(), "1: "),
        ("\nmodule = \"5do\"".to_owned(), "2: "),
        (wire(one, "{ unit = 2 }", ""), "3: missing field `point`"),
        (wire(one, "{ point = -1 }", ""), "3: point = "),
        (wire("{ point = 32 }", one, ""), "2: point = 0x0020 is not"),
        (wire("{ unit = 0, point = 1 }", two, ""), "2: unit = 0"),
        (wire(one, two, "within_ms = 0"), "4: within_ms = 0"),
        (wire(one, two, "within = 5"), "4: unknown field"),
        (wire(one, two, "pulses = -1"), "4: "),
        (wire(one, one, ""), "1: a point is an output"),
        (format!("{good}{good}"), "5: unit 2 point 0x0010 has a wire"),
        (format!("{good}{back}"), "5: a point is an output"),
        (good.replace("wire", "analog"), "1: missing field `tol"),
    ] {
        let error = BenchFile::parse(&text, None).unwrap_err();
        assert!(
            error.starts_with(wrong) && !error.contains('\n'),
            "{text}: {error}"
        );
    }
}
