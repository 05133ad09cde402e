//! Fetching events, without sending: which packet to confirm, and which one is a repetition.

use std::collections::BTreeMap;

use super::{Packet, Reply, Request};

/// Most bytes of events in a packet. Short packets let other units through.
const ROOM: u8 = 64;

/// Fetches the events of all units.
#[derive(Debug, Default)]
pub struct Fetcher {
    /// The last packet of each unit.
    last: BTreeMap<u8, Packet>,
    /// Unit and flag of the packet to confirm.
    confirmed: Option<(u8, u8)>,
}

impl Fetcher {
    /// Returns the next request. Without a reply it is sent again.
    #[must_use]
    pub const fn request(&self) -> Request {
        Request::Fetch {
            least: 0,
            room: ROOM,
            confirmed: self.confirmed,
        }
    }

    /// Takes a reply. Returns its packet, unless the unit has repeated the one before: it has not received the
    /// confirmation then.
    pub fn take(&mut self, reply: Reply) -> Option<Packet> {
        let Reply::Events(packet) = reply else {
            self.confirmed = None;
            return None;
        };
        self.confirmed = Some((packet.unit, packet.flag));
        let before = self.last.insert(packet.unit, packet.clone());
        (before.as_ref() != Some(&packet)).then_some(packet)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Event, kind};
    use super::*;

    fn packet(unit: u8, flag: u8, id: u16) -> Packet {
        Packet {
            unit,
            flag,
            waiting: 1,
            events: vec![Event {
                kind: kind::COIL,
                id,
                data: vec![1],
            }],
        }
    }

    #[test]
    fn a_packet_is_confirmed_in_the_next_request_and_its_repetition_is_dropped() {
        let mut fetcher = Fetcher::default();
        let confirmed = |fetcher: &Fetcher| match fetcher.request() {
            Request::Fetch { confirmed, .. } => confirmed,
            _ => None,
        };
        assert_eq!(confirmed(&fetcher), None);
        for (packet, is_new) in [
            (packet(5, 0, 1), true),
            (packet(5, 0, 1), false),
            (packet(7, 0, 1), true),
            // The confirmation of unit 5 was lost, and unit 7 came first.
            (packet(5, 0, 1), false),
            (packet(5, 1, 1), true),
            // The unit has started again, with the same flag but another event.
            (packet(5, 1, 2), true),
        ] {
            let told = (packet.unit, packet.flag);
            let taken = fetcher.take(Reply::Events(packet));
            assert_eq!(taken.is_some(), is_new, "{told:?}");
            assert_eq!(confirmed(&fetcher), Some(told));
        }
        assert_eq!(fetcher.take(Reply::NoEvents), None);
        assert_eq!(confirmed(&fetcher), None);
    }
}
