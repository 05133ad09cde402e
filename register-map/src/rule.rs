//! The rules of registers as numbers, which is all that the firmware needs.

use crate::kind::Kind;
use crate::values::Values;

/// How a master may access a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only. A write returns exception 02.
    ReadOnly,
    /// Read and write.
    ReadWrite,
    /// As the module in the slot defines it: [`crate::Module::points`].
    ByModule,
}

/// When a written value takes effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InForce {
    /// Immediately.
    Now,
    /// After the next start, if it was saved.
    Restart,
}

/// The values of a setting for one kind of point, where they differ from the other kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Narrower {
    /// Kind of point.
    pub kind: Kind,
    /// Allowed values: a subset of those of the rule.
    pub values: Values,
    /// Default value.
    pub default: u16,
}

impl Narrower {
    /// Returns the values for points of this kind.
    #[must_use]
    pub const fn new(kind: Kind, values: Values, default: u16) -> Self {
        Self {
            kind,
            values,
            default,
        }
    }
}

/// The rule for a run of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// Address of the first register.
    pub first: u16,
    /// Number of registers, 1 or more.
    pub count: u16,
    /// How a master may access them.
    pub access: Access,
    /// When a written value takes effect.
    pub in_force: InForce,
    /// Allowed values. For a setting by point: those for a point of unknown kind.
    pub values: Values,
    /// Factory default.
    pub default: u16,
    /// For a setting by point: the kind of point with other values.
    pub narrower: Option<&'static Narrower>,
}

impl Rule {
    /// Returns a rule for registers that can only be read.
    #[must_use]
    pub const fn read_only() -> Self {
        Self {
            access: Access::ReadOnly,
            ..Self::now(Values::ANY, 0)
        }
    }

    /// Returns a rule for registers whose values take effect immediately.
    #[must_use]
    pub const fn now(values: Values, default: u16) -> Self {
        Self {
            first: 0,
            count: 1,
            access: Access::ReadWrite,
            in_force: InForce::Now,
            values,
            default,
            narrower: None,
        }
    }

    /// Returns a rule for registers whose values take effect after the next start.
    #[must_use]
    pub const fn restart(values: Values, default: u16) -> Self {
        Self {
            in_force: InForce::Restart,
            ..Self::now(values, default)
        }
    }

    /// Returns a rule for registers that the module defines.
    #[must_use]
    pub const fn by_module(values: Values) -> Self {
        Self {
            access: Access::ByModule,
            ..Self::now(values, 0)
        }
    }

    /// Returns the rule with other values and another default for points of one kind.
    #[must_use]
    pub const fn but(mut self, narrower: &'static Narrower) -> Self {
        self.narrower = Some(narrower);
        self
    }

    /// Returns the rule for these addresses.
    #[must_use]
    pub const fn at(mut self, first: u16, count: u16) -> Self {
        self.first = first;
        self.count = count;
        self
    }

    /// Returns the address after the last.
    #[inline]
    #[must_use]
    pub const fn end(&self) -> u16 {
        self.first.wrapping_add(self.count)
    }

    /// Iterates over every address in order.
    #[inline]
    pub fn addresses(&self) -> impl Iterator<Item = u16> + use<> {
        self.first..self.end()
    }

    /// Returns the allowed values for a point of this kind.
    #[inline]
    #[must_use]
    pub fn values_for(&self, kind: Kind) -> &Values {
        match self.narrower {
            Some(narrower) if narrower.kind == kind => &narrower.values,
            _ => &self.values,
        }
    }

    /// Returns the default for a point of this kind.
    #[inline]
    #[must_use]
    pub fn default_for(&self, kind: Kind) -> u16 {
        match self.narrower {
            Some(narrower) if narrower.kind == kind => narrower.default,
            _ => self.default,
        }
    }
}

/// Consecutive registers under one rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Rule of the registers.
    pub rule: &'static Rule,
    /// Number of the rule's registers in front of the first.
    pub index: u16,
    /// Number of registers, 1 or more.
    pub count: u16,
}

/// Returns the rule for an address and the number of its registers in front of the address; `None` in a gap.
///
/// `rules` must be in ascending order, like those of every block.
#[inline]
#[must_use]
pub fn rule_at(rules: &'static [Rule], address: u16) -> Option<(&'static Rule, u16)> {
    let (rule, index) = from(rules, address)?;
    Some((rule.first()?, index))
}

/// Returns the registers of a span as runs, so that a caller decides once for many registers. Returns `None` when
/// the span is empty or contains a gap or an address after the block.
#[inline]
#[must_use]
pub fn runs(rules: &'static [Rule], start: u16, count: u16) -> Option<Runs> {
    let (rules, index) = from(rules, start)?;
    let wanted = u32::from(start) + u32::from(count);
    let mut end = rules.first()?.first;
    for rule in rules {
        if rule.first != end {
            return None;
        }
        end = rule.end();
        if u32::from(end) >= wanted {
            return (count > 0).then_some(Runs {
                rules,
                index,
                count,
            });
        }
    }
    None
}

/// Returns the rules starting with the one for `address`, and the number of its registers in front of the address.
#[inline]
fn from(rules: &'static [Rule], address: u16) -> Option<(&'static [Rule], u16)> {
    let after = rules.partition_point(|rule| rule.first <= address);
    let rules = rules.get(after.checked_sub(1)?..)?;
    let rule = rules.first()?;
    let index = address.wrapping_sub(rule.first);
    (index < rule.count).then_some((rules, index))
}

/// The runs of a span, from [`runs`].
#[derive(Clone, Debug)]
pub struct Runs {
    rules: &'static [Rule],
    index: u16,
    count: u16,
}

impl Iterator for Runs {
    type Item = Run;

    #[inline]
    fn next(&mut self) -> Option<Run> {
        if self.count == 0 {
            return None;
        }
        let (rule, rest) = self.rules.split_first()?;
        let run = Run {
            rule,
            index: self.index,
            count: self.count.min(rule.count.saturating_sub(self.index)),
        };
        self.rules = rest;
        self.index = 0;
        self.count = self.count.saturating_sub(run.count);
        Some(run)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    static RULES: [Rule; 3] = [
        Rule::now(Values::up_to(1), 0).at(0x100, 4),
        Rule::restart(Values::up_to(2), 0).at(0x104, 1),
        Rule::read_only().at(0x110, 2),
    ];

    fn counts(start: u16, count: u16) -> Option<Vec<(u16, u16, u16)>> {
        let runs = runs(&RULES, start, count)?;
        Some(
            runs.map(|run| (run.rule.first, run.index, run.count))
                .collect(),
        )
    }

    #[test]
    fn rule_at_finds_the_rule_of_an_address_and_none_in_a_gap() {
        let place = |address| rule_at(&RULES, address).map(|(rule, index)| (rule.first, index));
        assert_eq!(place(0x100), Some((0x100, 0)));
        assert_eq!(place(0x103), Some((0x100, 3)));
        assert_eq!(place(0x104), Some((0x104, 0)));
        assert_eq!(place(0x111), Some((0x110, 1)));
        for gap in [0, 0xFF, 0x105, 0x10F, 0x112, 0xFFFF] {
            assert_eq!(place(gap), None, "{gap:#06x}");
        }
    }

    #[test]
    fn a_span_is_split_where_the_rule_changes() {
        let whole = std::vec![(0x100, 0, 4), (0x104, 0, 1)];
        assert_eq!(counts(0x100, 5), Some(whole));
        assert_eq!(counts(0x102, 1), Some(std::vec![(0x100, 2, 1)]));
        assert_eq!(counts(0x111, 1), Some(std::vec![(0x110, 1, 1)]));
    }

    #[test]
    fn a_span_with_a_gap_is_rejected() {
        for (start, count) in [
            (0x100, 6),
            (0x104, 13),
            (0xFF, 2),
            (0x110, 3),
            (0x100, 0),
            (0x100, 0xFFFF),
            (0xFFFF, 2),
        ] {
            assert_eq!(counts(start, count), None, "{start:#06x}+{count}");
        }
    }
}
