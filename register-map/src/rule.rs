//! What holds for a register, in numbers: all the firmware needs of it.

use crate::values::Values;
use modio_drivers::Kind;

/// What a master may do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read it. A write is exception 02.
    ReadOnly,
    /// Read and write it.
    ReadWrite,
    /// What the module in the slot says: [`crate::Module::points`].
    ByModule,
}

/// When a written value counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InForce {
    /// At once.
    Now,
    /// After the next start, if it has been saved.
    Restart,
}

/// What holds for a point of one kind, where it differs from the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Narrower {
    /// The kind of point.
    pub kind: Kind,
    /// Its values: some of the rule's.
    pub values: Values,
    /// Its default.
    pub default: u16,
}

impl Narrower {
    /// What holds for points of this kind.
    #[must_use]
    pub const fn new(kind: Kind, values: Values, default: u16) -> Self {
        Self {
            kind,
            values,
            default,
        }
    }
}

/// What holds for a run of registers: for each the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// The address of the first.
    pub first: u16,
    /// How many, 1 or more.
    pub count: u16,
    /// What a master may do.
    pub access: Access,
    /// When a written value counts.
    pub in_force: InForce,
    /// Which values it takes. For a setting by point: where nothing is known of the point.
    pub values: Values,
    /// The factory default.
    pub default: u16,
    /// For a setting by point: the kind of point that takes other values.
    pub narrower: Option<&'static Narrower>,
}

impl Rule {
    /// Registers that can only be read.
    #[must_use]
    pub const fn read_only() -> Self {
        Self {
            access: Access::ReadOnly,
            ..Self::now(Values::ANY, 0)
        }
    }

    /// Registers whose values count at once.
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

    /// Registers whose values count after the next start.
    #[must_use]
    pub const fn restart(values: Values, default: u16) -> Self {
        Self {
            in_force: InForce::Restart,
            ..Self::now(values, default)
        }
    }

    /// Registers that are what the module says.
    #[must_use]
    pub const fn by_module(values: Values) -> Self {
        Self {
            access: Access::ByModule,
            ..Self::now(values, 0)
        }
    }

    /// The same, with other values and another default for points of one kind.
    #[must_use]
    pub const fn but(mut self, narrower: &'static Narrower) -> Self {
        self.narrower = Some(narrower);
        self
    }

    /// The same, at these addresses.
    #[must_use]
    pub const fn at(mut self, first: u16, count: u16) -> Self {
        self.first = first;
        self.count = count;
        self
    }

    /// The address after the last.
    #[inline]
    #[must_use]
    pub const fn end(&self) -> u16 {
        self.first.wrapping_add(self.count)
    }

    /// Every address, in order.
    #[inline]
    pub fn addresses(&self) -> impl Iterator<Item = u16> + use<> {
        self.first..self.end()
    }

    /// Which values it takes for a point of this kind.
    #[inline]
    #[must_use]
    pub fn values_for(&self, kind: Kind) -> Values {
        match self.narrower {
            Some(narrower) if narrower.kind == kind => narrower.values,
            _ => self.values,
        }
    }

    /// The default for a point of this kind.
    #[inline]
    #[must_use]
    pub fn default_for(&self, kind: Kind) -> u16 {
        match self.narrower {
            Some(narrower) if narrower.kind == kind => narrower.default,
            _ => self.default,
        }
    }
}

/// Registers next to each other under one rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// What holds for them.
    pub rule: &'static Rule,
    /// How many of the rule's registers come before the first.
    pub index: u16,
    /// How many registers, 1 or more.
    pub count: u16,
}

/// The rule for an address and how many of its registers come before it; `None` in a gap.
///
/// `rules` must be in ascending order, as those of every block are.
#[inline]
#[must_use]
pub fn rule_at(rules: &'static [Rule], address: u16) -> Option<(&'static Rule, u16)> {
    let (rule, index) = from(rules, address)?;
    Some((rule.first()?, index))
}

/// The registers of a span, run by run, so that a caller decides once for many; `None` when the span
/// is empty or touches a gap or an address beyond the block.
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

/// The rules from the one for `address` on, and how many registers of that come before it.
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
    fn an_address_leads_to_its_rule_and_a_gap_to_none() {
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
    fn a_span_is_cut_where_the_rule_changes() {
        let whole = std::vec![(0x100, 0, 4), (0x104, 0, 1)];
        assert_eq!(counts(0x100, 5), Some(whole));
        assert_eq!(counts(0x102, 1), Some(std::vec![(0x100, 2, 1)]));
        assert_eq!(counts(0x111, 1), Some(std::vec![(0x110, 1, 1)]));
    }

    #[test]
    fn a_span_that_touches_a_gap_does_not_exist() {
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
