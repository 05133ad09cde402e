//! Blocks of registers, each declared once: the numbers for the firmware and the words for people.

use crate::rule::Rule;

/// A register, or a run of like ones, for people: the words beside the numbers of its [`Rule`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    /// Its name.
    pub name: &'static str,
    /// What its values count, or nothing.
    pub unit: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The names of its codes, where it holds codes.
    pub codes: &'static [(u16, &'static str)],
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

impl Block {
    /// Every register or run of registers: numbers and words.
    pub fn registers(&self) -> impl Iterator<Item = (&'static Rule, &'static Text)> + use<> {
        self.rules.iter().zip(self.texts)
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
///     NAME "name": address x count, "unit", Rule, names of codes;
/// }
/// ```
macro_rules! block {
    (
        $title:literal, $first:literal ..= $last:literal;
        $(
            $(#[doc = $about:literal])+
            $constant:ident $name:literal: $address:literal x $count:literal, $unit:literal, $rule:expr, $codes:expr;
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
                unit: $unit,
                about: concat!($($about),+),
                codes: $codes,
            }),+],
        };
    };
}
pub(crate) use block;
