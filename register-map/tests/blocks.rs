//! Rules for the declarations of all blocks, and the numbers of the map written out by hand for comparison.

use register_map::*;

#[test]
fn registers_are_in_order_within_their_block_and_do_not_overlap() {
    let mut next = 0;
    for block in BLOCKS {
        assert!(
            block.first >= next && block.first <= block.last,
            "{}",
            block.title
        );
        assert_eq!(block.rules.len(), block.texts.len());
        next = block.first;
        for (rule, text) in block.registers() {
            assert!(rule.first >= next && rule.count > 0, "{}", text.name);
            next = rule.end();
            assert!(next - 1 <= block.last, "{}", text.name);
        }
    }
}

#[test]
fn every_register_has_a_text_and_its_codes_are_its_values() {
    for (rule, text) in BLOCKS.iter().flat_map(|block| block.registers()) {
        assert!(
            !text.name.is_empty() && text.about.trim().len() > 2,
            "{text:?}"
        );
        if let (Access::ReadWrite, Value::Codes(codes)) = (rule.access, text.value) {
            let allowed = (0..=0xFFFF).filter(|value| rule.values.allow(*value));
            assert!(
                allowed.eq(codes.iter().map(|(code, _)| *code)),
                "{}",
                text.name
            );
        }
        if let Some(registers) = text.value.registers() {
            assert!(rule.count.is_multiple_of(registers), "{}", text.name);
        }
        assert!(
            text.narrower.is_none() || rule.narrower.is_some(),
            "{}",
            text.name
        );
        if let Value::Bits(bits) = text.value {
            let numbers = bits.iter().map(|(bit, _)| *bit);
            assert!(numbers.is_sorted_by(|a, b| a < b), "{}", text.name);
        }
    }
}

/// first, count, some valid values, some invalid values, default, in force
type Expected = (u16, u16, &'static [u16], &'static [u16], u16, InForce);

const NOW: InForce = InForce::Now;
const RESTART: InForce = InForce::Restart;

#[rustfmt::skip]
const CONFIGURATION: &[Expected] = &[
    (0x0100, 1, &[0x5A17], &[0, 1, 0x175A, 0xFFFF], 0, NOW),
    (0x0101, 1, &[12, 24, 48, 96, 192, 384, 576, 1152, 2304, 4608, 9216], &[0, 11, 13, 144, 9600, 0xFFFF], 96, RESTART),
    (0x0102, 1, &[0, 1, 2, 3, 4, 5, 6], &[7, 0xFFFF], 0, RESTART),
    (0x0103, 1, &[0, 1], &[2, 0xFFFF], 0, RESTART),
    (0x0104, 1, &[0, 1, 36_000], &[36_001, 0xFFFF], 0, NOW),
    (0x0105, 1, &[0, 1000], &[1001, 0xFFFF], 0, NOW),
    (0x0106, 1, &[0, 2, 1000], &[1, 1001, 0xFFFF], 0, RESTART),
    (0x0107, 1, &[0, 1], &[2], 0, RESTART),
    (0x0108, 1, &[1, 2, 3, 4, 5, 6, 0xB001, 0xB002, 0xB003, 0xB004, 0xB007], &[0, 7, 0xB000, 0xB005, 0xFFFF], 0, NOW),
    (0x0109, 1, &[0, 1, 2, 3], &[4, 0xFFFF], 0, NOW),
    (0x010A, 1, &[1, 247], &[0, 248, 0xFFFF], 1, RESTART),
    (0x010B, 1, &[0, 1, 0xFFFF], &[], 0, RESTART),
    (0x010C, 1, &[0, 1, 0xFFFF], &[], 0, NOW),
    (0x0110, 8, &[0, Module::LAST], &[Module::LAST + 1, 0xFFFF], 0, RESTART),
    (0x0120, 32, &[0, 1000], &[1001, 0xFFFF], 5, NOW),
    (0x0140, 1, &[0, 1, 2], &[3], 0, RESTART),
    (0x0141, 1, &[0, 0xFFFF], &[], 0, RESTART),
    (0x0142, 1, &[0, 31], &[32, 0xFFFF], 23, RESTART),
    (0x0143, 1, &[0, 5], &[6], 2, RESTART),
    (0x0144, 1, &[0, 3], &[4], 0, RESTART),
    (0x0145, 1, &[5, 500], &[0, 4, 501], 300, RESTART),
    (0x0160, 32, &[2000, 5000], &[0, 1999, 5001], 3950, NOW),
    (0x0180, 32, &[0, 2], &[3], 0, NOW),
    (0x01A0, 32, &[0, 1], &[2], 0, NOW),
    (0x01C0, 32, &[0, 4095, 0xFFFF], &[4096, 0xFFFE], 0, NOW),
    (0x01E0, 32, &[0, 4095, 0xFFFE], &[4096, 0xFFFD, 0xFFFF], 0, RESTART),
];

#[test]
fn the_configuration_matches_the_numbers_written_by_hand() {
    assert_eq!(configuration::RULES.len(), CONFIGURATION.len());
    for (rule, expected) in configuration::RULES.iter().zip(CONFIGURATION) {
        let (first, count, good, bad, default, in_force) = *expected;
        assert_eq!((rule.first, rule.count), (first, count));
        assert_eq!(
            (rule.default, rule.in_force),
            (default, in_force),
            "{first:#06x}"
        );
        assert!(
            good.iter().all(|value| rule.values.allow(*value)),
            "{first:#06x}"
        );
        assert!(
            !bad.iter().any(|value| rule.values.allow(*value)),
            "{first:#06x}"
        );
    }
}

#[test]
fn the_state_registers_are_readable_except_for_gaps() {
    let there = |start, count| runs(state::RULES, start, count).is_some();
    for (start, count) in [(0x200, 43), (0x230, 9), (0x240, 32)] {
        assert!(there(start, count), "{start:#06x}");
        assert!(
            !there(start, count + 1) && !there(start - 1, 2),
            "{start:#06x}"
        );
    }
    assert!(runs(fault::RULES, 0x260, 16).is_some());
    assert!(runs(second::RULES, 0x270, 9).is_some() && runs(second::RULES, 0x270, 10).is_none());
    assert!(runs(counters::RULES, 0x300, 64).is_some() && counters::of_point(16) == 0x320);
    assert!(runs(edges::RULES, 0x380, 64).is_some() && runs(edges::RULES, 0x380, 65).is_none());
}

#[test]
fn spans_are_the_addresses_of_the_rules_with_adjacent_ones_joined() {
    assert_eq!(state::SPANS, [0x200..0x22B, 0x230..0x239, 0x240..0x260]);
    let blocks = [
        (configuration::RULES, configuration::SPANS),
        (state::RULES, state::SPANS),
        (fault::RULES, fault::SPANS),
        (second::RULES, second::SPANS),
        (counters::RULES, counters::SPANS),
        (edges::RULES, edges::SPANS),
        (links::RULES, links::SPANS),
    ];
    for (rules, spans) in blocks {
        let of_rules = rules.iter().flat_map(|rule| rule.addresses());
        assert!(of_rules.eq(spans.iter().cloned().flatten()));
    }
}
