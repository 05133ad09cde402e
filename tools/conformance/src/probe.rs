//! Asks the unit under test whether it answers, and which functions and points it has.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::{Context as _, Result, bail, ensure};
use register_map::points::{self, Kind, output_values};
use register_map::{BLOCKS, Module, Row, Rule, Values, codes, configuration, links, state};

use crate::case::Check;
use crate::endpoint::Endpoint;
use crate::frame::{Mode, Reply};
use crate::hil::Hil;
use crate::points::pdu;
use crate::profile::Profile;
use crate::target::Patience;
use crate::target::{Modio, Span, Support, Target, Words};
use crate::tester::Tester;

/// What the user has given, before the unit is asked.
#[derive(Clone, Debug)]
pub struct Given<'a> {
    /// The unit's address.
    pub unit: u8,
    /// RTU or ASCII.
    pub mode: Mode,
    /// How long to wait.
    pub patience: Patience,
    /// Description of a unit that is not a modio.
    pub profile: Option<&'a Profile>,
    /// Whether its configuration may be written.
    pub allow_config: bool,
}

/// How long a unit may be silent before its first answer, such as a unit that starts.
const FIRST_ANSWER: Duration = Duration::from_secs(3);

/// Every function that cases are about.
pub const FUNCTIONS: [u8; 18] = [
    1, 2, 3, 4, 5, 6, 7, 8, 0x0B, 0x0C, 0x0F, 0x10, 0x11, 0x14, 0x15, 0x16, 0x17, 0x2B,
];

/// Asks the unit. Returns what the unit has, with waiting times that include the unit's own delay. The error says why
/// the unit cannot be tested, and what to do.
pub fn probe(endpoint: &mut dyn Endpoint, given: &Given<'_>) -> Result<Target> {
    let mut target = Target {
        unit: given.unit,
        mode: given.mode,
        patience: given.patience,
        allow_config: given.allow_config,
        functions: BTreeMap::new(),
        readable: Default::default(),
        bits: None,
        words: None,
        strict_t15: given.profile.and_then(|profile| profile.strict_t15),
        modio: None,
        ping: vec![8, 0, 0, 0xA5, 0x37],
        hil: Hil::default(),
    };
    let (line, unit) = (endpoint.line(), given.unit);
    let listed = given.profile.and_then(|profile| profile.functions.as_ref());
    if let Some(listed) = listed {
        let support = |function| match listed.contains(&function) {
            true => Support::Yes,
            false => Support::Refused,
        };
        target.functions = FUNCTIONS
            .map(|function| (function, support(function)))
            .into();
    }
    let first = if let Some(profile) = given.profile {
        let known = profile.known()?;
        target.readable = known.readable;
        (target.bits, target.words) = (known.bits, known.words);
        // Without a list of functions a unit may be silent to an echo.
        ping(&target, |function| match listed {
            Some(_) => target.has(function),
            None => function != 8,
        })
    } else {
        Some(pdu(3, state::PRODUCT_CODE, 2))
    };
    let reply = match &first {
        Some(first) => Some(first_answer(endpoint, &target, first)?),
        None => None,
    };
    ensure!(
        reply != Some(Reply::Silence),
        "unit {unit} does not answer at {line}: check its address, rate, format, mode and wiring"
    );
    if given.profile.is_none() {
        let product = state::PRODUCT.to_be_bytes();
        match &reply {
            Some(Reply::Pdu(reply)) if reply.get(2..) == Some(&product) => {}
            Some(reply @ Reply::Wrong(..)) => bail!(
                "the reply at {line} is not a Modbus frame ({reply}): check rate, format and mode"
            ),
            _ => bail!("unit {unit} answers but is not a modio: describe it with --profile FILE"),
        }
        target = modio(&mut Tester::new(endpoint, &target))?;
    }
    if listed.is_none() {
        for function in FUNCTIONS {
            let request = harmless(&target, function)?;
            let support = match ask(endpoint, &target, &request)? {
                Reply::Silence => Support::Silent,
                reply if reply.exception(function) == Some(1) => Support::Refused,
                _ => Support::Yes,
            };
            target.functions.insert(function, support);
        }
    }
    target.ping = ping(&target, |function| target.has(function)).context(
        "no request is known that the unit answers: name something to read in the profile",
    )?;
    let reply = match reply {
        Some(reply) if first.as_ref() == Some(&target.ping) => reply,
        _ => ask(endpoint, &target, &target.ping)?,
    };
    ensure!(
        matches!(&reply, Reply::Pdu(pdu) if pdu[0] == target.ping[0]),
        "unit {unit} at {line} does not answer an ordinary request: the reply is {reply}"
    );
    Ok(target)
}

fn ask(endpoint: &mut dyn Endpoint, target: &Target, pdu: &[u8]) -> Check<Reply> {
    Tester::new(endpoint, target).ask_due(pdu)
}

/// Asks a unit that may be starting, or may still have earlier bytes in its receiver. Repeats the request until the unit
/// answers. The last request is sent after [`FIRST_ANSWER`].
fn first_answer(endpoint: &mut dyn Endpoint, target: &Target, pdu: &[u8]) -> Check<Reply> {
    let silence = target.patience.silence;
    let started = endpoint.now() + FIRST_ANSWER;
    loop {
        let is_last = endpoint.now() >= started;
        let reply = ask(endpoint, target, pdu)?;
        if is_last || matches!(reply, Reply::Pdu(_)) {
            return Ok(reply);
        }
        // Discard a late reply, so that it is not read as the reply to the next request.
        endpoint.receive(silence, silence, usize::MAX)?;
    }
}

/// Returns a request that shows whether the unit has a function, and changes nothing.
fn harmless(target: &Target, function: u8) -> Result<Vec<u8>> {
    let nowhere = || {
        target
            .nowhere_to_write(function)
            .context("every address exists: list the unit's functions in the profile")
    };
    let first = |function| target.readable(function).first().map_or(0, |s| s.first);
    Ok(match function {
        1..=4 => pdu(function, first(function), 1),
        5 | 6 => pdu(function, nowhere()?, 0),
        7 | 0x0B | 0x0C | 0x11 => vec![function],
        8 => vec![8, 0, 0, 0xA5, 0x37],
        0x0F | 0x10 => vec![function, 0, 0, 0, 0, 0],
        // A byte count that neither function allows.
        0x14 | 0x15 => vec![function, 0],
        0x16 => [pdu(function, nowhere()?, 0xFFFF), vec![0, 0]].concat(),
        0x17 => vec![function, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        _ => vec![0x2B, 0x0E, 1, 0],
    })
}

/// Returns an ordinary request to a unit that `has` these functions: a short read, else an echo.
fn ping(target: &Target, has: impl Fn(u8) -> bool) -> Option<Vec<u8>> {
    let read = (1..=4)
        .filter(|function| has(*function))
        .find_map(|function| Some(pdu(function, target.readable(function).first()?.first, 1)));
    read.or_else(|| has(8).then(|| vec![8, 0, 0, 0xA5, 0x37]))
}

/// Reads from a modio's registers what the modio has, and how much longer than t3.5 its reply may take.
fn modio(tester: &mut Tester<'_>) -> Check<Target> {
    let board = Row::from_code(tester.read_word(state::BOARD)?);
    let codes = tester.read_words(Span::of(state::MODULE_IN_FORCE, points::PORTS))?;
    let mut modules = [Module::None; points::PORTS as usize];
    for (module, code) in modules.iter_mut().zip(codes) {
        *module = Module::from_code(code).unwrap_or(Module::None);
    }
    let modio = Modio { board, modules };
    let delay = tester.read_word(configuration::RESPONSE_DELAY)?;
    let gap = tester.read_word(configuration::FRAME_GAP)?;
    let strict = tester.read_word(configuration::STRICT_T15)?;
    let slower =
        Duration::from_millis(u64::from(delay)) + Duration::from_micros(100) * u32::from(gap);

    let mut target = tester.target.clone();
    target.patience.reply += slower;
    target.patience.silence += slower;
    target.modio = Some(modio);
    target.strict_t15 = Some(strict == 1);
    let bits = modio.runs(&[Kind::BitInput, Kind::BitOutput]);
    let mut registers = modio.runs(&[Kind::WordInput, Kind::WordOutput]);
    for block in BLOCKS.into_iter().skip(1) {
        if block.first == links::LINKS {
            continue;
        }
        let mut open: Option<Span> = None;
        let there = |(rule, _): &(&Rule, _)| board.is_none_or(|board| board.has(rule.first));
        for (rule, _) in block.registers().filter(there) {
            let here = Span::of(rule.first, rule.count);
            match &mut open {
                Some(span) if span.last + 1 == here.first => span.last = here.last,
                _ => registers.extend(open.replace(here)),
            }
        }
        registers.extend(open);
    }
    if board.is_some_and(|board| links::exist(board.slots.into())) {
        for second in [false, true] {
            let outputs = modio.runs(&[Kind::BitOutput]).into_iter();
            registers.extend(outputs.map(|span| {
                let count = span.last - span.first + 1;
                Span::of(links::of_point(span.first, second), links::WORDS * count)
            }));
        }
    }
    target.readable = [bits.clone(), bits, registers.clone(), registers];
    target.bits = modio.runs(&[Kind::BitOutput]).first().copied();
    target.words = match modio.runs(&[Kind::WordOutput]).first() {
        Some(span) => Some(outputs(tester, *span)?),
        // A setting that touches no output: the NTC constants.
        None if target.allow_config => Some(Words {
            span: Span::of(configuration::BETA, points::COUNT),
            low: 2001,
            high: 5000,
            refused: Some(5001),
            locked: true,
        }),
        None => None,
    };
    Ok(target)
}

/// Reads the values that analog outputs accept. Returns the first outputs of the span that accept the same values.
fn outputs(tester: &mut Tester<'_>, span: Span) -> Check<Words> {
    let mut of_point = |point: u16| {
        let scale = tester.read_word(configuration::SCALE + point)?;
        let signal = tester.read_word(configuration::RANGE + point)?;
        Check::Ok(output_values(
            codes::Signal::from_code(signal).unwrap_or(codes::Signal::Voltage),
            codes::Scale::from_code(scale).unwrap_or(codes::Scale::Raw),
        ))
    };
    let values = of_point(span.first)?;
    let mut last = span.first;
    while last < span.last && of_point(last + 1)? == values {
        last += 1;
    }
    let span = Span { last, ..span };
    let (low, high) = match values {
        Values::Range { min, max } => (min + 1, max),
        _ => (1, 4095),
    };
    Ok(Words {
        span,
        low,
        high,
        refused: Some(high + 1),
        locked: false,
    })
}
