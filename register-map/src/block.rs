//! Blocks of registers. Each is declared once: the numbers for the firmware and the texts for people.

use core::ops::Range;

use crate::port;
use crate::rule::Rule;
use crate::value::Value;

/// The texts for a register, or for a run of similar ones, in addition to the numbers of its [`Rule`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    /// Its name.
    pub name: &'static str,
    /// Meaning of its number.
    pub value: Value,
    /// For a setting by point: the meaning of the number for points of the kind of the rule's [`crate::Narrower`],
    /// if it differs.
    pub narrower: Option<Value>,
    /// Description.
    pub about: &'static str,
}

/// A block. A request for registers must lie within one block and within its defined registers.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Title.
    pub title: &'static str,
    /// First address.
    pub first: u16,
    /// Last address.
    pub last: u16,
    /// Rules in ascending order of the addresses.
    pub rules: &'static [Rule],
    /// Texts for each rule, in the same order.
    pub texts: &'static [Text],
}

/// What each value in a run of registers belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// The unit.
    Unit,
    /// Each port, 1 to 8.
    Port,
    /// Each point: four for each port.
    Point,
}

impl Text {
    /// Returns what each value in a run of `count` registers belongs to.
    #[must_use]
    pub const fn scope(&self, count: u16) -> Scope {
        let values = match self.value.registers() {
            Some(registers) => count / registers,
            None => 1,
        };
        match values {
            port::PORTS => Scope::Port,
            // A point may have several values: those of the second row follow the first of all points.
            port::COUNT.. if values.is_multiple_of(port::COUNT) => Scope::Point,
            _ => Scope::Unit,
        }
    }
}

impl Block {
    /// Iterates over every register or run of registers, with numbers and texts.
    pub fn registers(&self) -> impl Iterator<Item = (&'static Rule, &'static Text)> + use<> {
        self.rules.iter().zip(self.texts)
    }
}

/// Returns the first of these values, if there is one: the optional value in a row of [`block!`].
pub(crate) const fn first(values: &[Value]) -> Option<Value> {
    match values {
        [value, ..] => Some(*value),
        [] => None,
    }
}

/// Returns the number of [`spans`].
pub(crate) const fn count_spans(rules: &[Rule]) -> usize {
    let mut count = 0;
    let mut i = 0;
    while i < rules.len() {
        if i == 0 || rules[i - 1].end() != rules[i].first {
            count += 1;
        }
        i += 1;
    }
    count
}

/// Returns the addresses of all rules, with adjacent ones joined.
pub(crate) const fn spans<const N: usize>(rules: &[Rule]) -> [Range<u16>; N] {
    let mut spans = [const { 0..0 }; N];
    let (mut count, mut i) = (0, 0);
    while i < rules.len() {
        if count > 0 && spans[count - 1].end == rules[i].first {
            spans[count - 1].end = rules[i].end();
        } else {
            spans[count] = rules[i].first..rules[i].end();
            count += 1;
        }
        i += 1;
    }
    spans
}

/// Declares the registers of a block. In the module that calls it, it defines
///
/// - a constant for each address, documented by the register's text,
/// - `RULES`, the numbers, which the firmware uses without the texts,
/// - `SPANS`, the registers without gaps between them, as ranges of addresses,
/// - `BLOCK`, numbers and texts, for tools and documentation.
///
/// ```text
/// block! {
///     "title", first address ..= last address;
///     /// What the register is.
///     NAME "name": address x count, Value, Rule;
///     /// What the setting by point is. Its number has another meaning for one kind of point.
///     NAME "name": address x count, Value => Value, Rule;
/// }
/// ```
macro_rules! block {
    (
        $title:literal, $first:literal ..= $last:literal;
        $(
            $(#[doc = $about:literal])+
            $constant:ident $name:literal: $address:literal x $count:literal, $value:expr $(=> $narrower:expr)?, $rule:expr;
        )+
    ) => {
        $($(#[doc = $about])+ pub const $constant: u16 = $address;)+

        const ROWS: &[$crate::Rule] = &[$($rule.at($address, $count)),+];

        /// The rules of this block, in ascending order of the addresses.
        pub static RULES: &[$crate::Rule] = ROWS;

        /// The addresses of this block without gaps, in ascending order. The firmware needs no more to check the
        /// access to registers that can only be read.
        pub static SPANS: &[core::ops::Range<u16>] =
            &$crate::block::spans::<{ $crate::block::count_spans(ROWS) }>(ROWS);

        /// The block with its texts.
        pub static BLOCK: $crate::Block = $crate::Block {
            title: $title,
            first: $first,
            last: $last,
            rules: RULES,
            texts: &[$($crate::Text {
                name: $name,
                value: $value,
                narrower: $crate::block::first(&[$($narrower)?]),
                about: concat!($($about),+),
            }),+],
        };
    };
}
pub(crate) use block;
