//! Sub-function 18: which points report events. It is a request to the unit's own address.

use super::{FUNCTION, sub};

/// How a point reports its events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Priority {
    /// Not.
    Off = 0,
    /// After all units with an event of high priority.
    Low = 1,
    /// Before all units with events of low priority.
    High = 2,
}

/// A point and how it reports its events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Type of the events, as in [`kind`](super::kind).
    pub kind: u8,
    /// Address of the point.
    pub id: u16,
    /// The priority.
    pub priority: Priority,
}

/// Returns the PDU that makes these settings, 40 at most. Neighbours of one type are one range.
#[must_use]
pub fn settings(all: &[Setting]) -> Vec<u8> {
    let mut ranges = Vec::new();
    for range in each(all) {
        let Some(first) = range.first() else { continue };
        let [high, low] = first.id.to_be_bytes();
        ranges.extend([first.kind, high, low, range.len() as u8]);
        ranges.extend(range.iter().map(|setting| setting.priority as u8));
    }
    let mut pdu = vec![FUNCTION, sub::SETTINGS, ranges.len() as u8];
    pdu.extend(ranges);
    pdu
}

/// Returns for each of these settings whether the point reports events, by the PDU of the reply; `None` if that is not the
/// reply to them.
#[must_use]
pub fn are_on(all: &[Setting], reply: &[u8]) -> Option<Vec<bool>> {
    let mut masks = reply.strip_prefix(&[FUNCTION, sub::SETTINGS])?.get(1..)?;
    let mut on = Vec::new();
    for range in each(all) {
        let (mask, rest) = masks.split_at_checked(range.len().div_ceil(8))?;
        on.extend((0..range.len()).map(|n| mask[n / 8] >> (n % 8) & 1 == 1));
        masks = rest;
    }
    masks.is_empty().then_some(on)
}

/// Iterates over the ranges of neighbours.
fn each(all: &[Setting]) -> impl Iterator<Item = &[Setting]> {
    all.chunk_by(|one, next| one.kind == next.kind && one.id.checked_add(1) == Some(next.id))
}

#[cfg(test)]
mod tests {
    use super::super::kind;
    use super::*;

    /// The example of the document, with the points between those that it switches on.
    fn example() -> Vec<Setting> {
        let high = [464, 466, 473];
        let discrete = (4..=6).map(|id| Setting {
            kind: kind::DISCRETE_INPUT,
            id,
            priority: if id == 5 {
                Priority::Off
            } else {
                Priority::Low
            },
        });
        let input = (464..=473).map(|id| Setting {
            kind: kind::INPUT_REGISTER,
            id,
            priority: if high.contains(&id) {
                Priority::High
            } else {
                Priority::Off
            },
        });
        discrete.chain(input).collect()
    }

    #[test]
    fn the_request_and_the_reply_are_the_example_of_the_document() {
        // The CRC that the document gives does not fit this request, so it is not compared.
        assert_eq!(
            settings(&example()),
            [
                0x46, 0x18, 0x15, 2, 0, 4, 3, 1, 0, 1, 4, 1, 0xD0, 0x0A, 2, 0, 2, 0, 0, 0, 0, 0, 0,
                2
            ]
        );
        let on = are_on(&example(), &[0x46, 0x18, 3, 5, 5, 0]).unwrap();
        let ids: Vec<_> = example()
            .iter()
            .zip(&on)
            .filter(|(_, on)| **on)
            .map(|(setting, _)| setting.id)
            .collect();
        assert_eq!(ids, [4, 6, 464, 466], "the unit has no register 473");
    }

    #[test]
    fn a_reply_of_another_length_is_none() {
        for reply in [
            &[0x46, 0x18, 2, 5, 5][..],
            &[0x46, 0x18, 4, 5, 5, 0, 0],
            &[0x46, 0x18],
        ] {
            assert_eq!(are_on(&example(), reply), None);
        }
    }
}
