//! Blocks of registers, each declared once: the numbers for the firmware and the words for people.

use crate::points;
use crate::rule::Rule;
use crate::value::Value;

/// A register, or a run of like ones, for people: the words beside the numbers of its [`Rule`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    /// Its name.
    pub name: &'static str,
    /// What its number means.
    pub value: Value,
    /// For a setting by point: what its number means for points of the kind of the rule's [`crate::Narrower`], where
    /// that differs.
    pub narrower: Option<Value>,
    /// What it is.
    pub about: &'static str,
}

/// A block: a request for registers must lie within one, and within its defined registers.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// What it holds.
    pub title: &'static str,
    /// Its first address.
    pub first: u16,
    /// Its last address.
    pub last: u16,
    /// The rules, in ascending order of the addresses.
    pub rules: &'static [Rule],
    /// The words for each rule, in the same order.
    pub texts: &'static [Text],
}

/// The things that have one value each in a run of registers.
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
    /// The things that have one value each in a run of `count` registers.
    #[must_use]
    pub const fn scope(&self, count: u16) -> Scope {
        let values = match self.value.registers() {
            Some(1) => count,
            Some(_) => count / 2,
            None => 1,
        };
        match values {
            points::COUNT => Scope::Point,
            points::PORTS => Scope::Port,
            _ => Scope::Unit,
        }
    }
}

impl Block {
    /// Every register or run of registers: numbers and words.
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

/// Declares the registers of a block. It makes, in the module it stands in,
///
/// - a constant for each address, documented by the register's text,
/// - `RULES`, the numbers, which the firmware uses without the words,
/// - `BLOCK`, everything, for tools and documentation.
///
/// ```text
/// block! {
///     "title", first address ..= last address;
///     /// What the register is.
///     NAME "name": address x count, Value, Rule;
///     /// What the setting by point is, whose number means something else for one kind of point.
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

        /// What holds for the registers of this block, in ascending order of the addresses.
        pub static RULES: &[$crate::Rule] = &[$($rule.at($address, $count)),+];

        /// The block with its words.
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
