//! The air around the boards: the gateway radio, other transmitters, and a record of the packets.

use std::collections::VecDeque;

use super::parameters::SLEEP_UART;
use super::{Byte, Module, News, Packet, Parameters, Sender, timing};
use f103::corner::Corner;
use f103::periph::usart::{Sent, TxPin};
use f103::serial::Character;
use f103::time::Time;

/// Number of packets, and of received bytes, that are kept.
const KEPT: usize = 65_536;

/// The air with its gateway radio.
///
/// The gateway is a module of the same type as that of a board, always in normal mode. A master is connected to its
/// UART at 9600 8N1: [`Air::send`] and [`Air::received`]. By default it follows the boards: whenever the module of the
/// first board enters normal mode, the gateway takes over its parameters, except those of the UART.
#[derive(Clone, Debug)]
pub struct Air {
    gateway: Module,
    /// The board that the gateway follows.
    leader: u16,
    follow: bool,
    /// Parameters for the gateway, which it takes over from this instant on, as soon as it is idle.
    tune: Option<(Time, Parameters)>,
    /// End of the last byte that is queued at the gateway's UART.
    queued_until: Time,
    received: VecDeque<Byte>,
    /// Probability that a receiver loses a packet.
    loss: f64,
    /// Number of packets of other transmitters.
    others: u64,
    packets: VecDeque<Packet>,
    /// News for the boards, with the loss of packets.
    news: Vec<(News, f64)>,
    /// Nothing can begin before this instant, because a board has already reached it.
    earliest: Time,
}

impl Air {
    /// Returns air in which nothing is sent, and a gateway with the factory parameters. It follows the board `leader`.
    pub(crate) fn new(leader: u16, now: Time, corner: Corner) -> Self {
        let mut gateway = Module::new(Sender::Gateway, Parameters::FACTORY, corner);
        gateway.advance(now);
        gateway.uart.set_pin(TxPin::Usart, now);
        gateway.start_in_normal_mode();
        gateway.take_news();
        Self {
            gateway,
            leader,
            follow: true,
            tune: None,
            queued_until: Time::ZERO,
            received: VecDeque::new(),
            loss: 0.0,
            others: 0,
            packets: VecDeque::new(),
            news: Vec::new(),
            earliest: now,
        }
    }

    /// Sends `bytes` to the gateway's UART at 9600 8N1, without gaps. The first start bit begins at `at`, or now if
    /// `at` is in the past, or after the bytes that are still queued. Returns the end of the last stop bit.
    pub fn send(&mut self, at: Time, bytes: &[u8]) -> Time {
        let first = at.max(self.queued_until).max(self.now());
        for (&byte, n) in bytes.iter().zip(0..) {
            let start = first + SLEEP_UART.characters(n);
            let character = Character::new(SLEEP_UART, byte).at(start);
            self.gateway.uart.put_in(Sent::Character(character));
        }
        self.queued_until = first + SLEEP_UART.characters(bytes.len() as u64);
        self.queued_until
    }

    /// Returns the bytes that the gateway has sent at its UART, oldest first: the last 65 536.
    pub fn received(&self) -> impl DoubleEndedIterator<Item = &Byte> {
        self.received.iter()
    }

    /// Removes and returns the bytes that the gateway has sent at its UART since the last call, oldest first.
    pub fn take_received(&mut self) -> Vec<Byte> {
        self.received.drain(..).collect()
    }

    /// Sends a packet from another transmitter with these parameters at `at`, or now if `at` is in the past. It has at
    /// most 58 bytes; further bytes are not sent. Returns the packet.
    pub fn transmit(&mut self, at: Time, parameters: Parameters, bytes: &[u8]) -> Packet {
        self.others += 1;
        let bytes = bytes[..bytes.len().min(timing::PACKET_BYTES)].to_vec();
        let start = at.max(self.now());
        let packet = Packet::new(
            self.gateway.corner,
            Sender::Other,
            self.others,
            start,
            parameters,
            Time::ZERO,
            bytes,
        );
        self.take(News::Begun(packet.clone()));
        packet
    }

    /// Returns the packets on the air, in the order in which they became known: the last 65 536. A packet whose
    /// transmitter loses its power ends at that instant.
    pub fn packets(&self) -> impl DoubleEndedIterator<Item = &Packet> {
        self.packets.iter()
    }

    /// Returns the gateway radio.
    #[must_use]
    pub const fn gateway(&self) -> &Module {
        &self.gateway
    }

    /// Chooses whether the gateway takes over the parameters of the first board's module. It keeps its parameters when
    /// this is switched off.
    pub fn set_follow(&mut self, follow: bool) {
        self.follow = follow;
    }

    /// Sets the parameters of the gateway, which takes them over as soon as it is idle. Its UART stays at 9600 8N1.
    pub fn set_parameters(&mut self, parameters: Parameters) {
        self.tune = Some((self.now(), parameters.with_default_uart()));
    }

    /// Sets the probability, 0 to 1, that a receiver loses a packet that begins from now on. Each receiver of a packet
    /// loses it independently of the others. The losses are the same in every run.
    pub fn set_loss(&mut self, loss: f64) {
        self.loss = loss;
    }

    /// Returns the probability that a receiver loses a packet.
    #[must_use]
    pub const fn loss(&self) -> f64 {
        self.loss
    }

    /// Returns the earliest instant at which something can begin.
    #[must_use]
    pub fn now(&self) -> Time {
        self.earliest.max(self.gateway.now())
    }

    /// Sets the instant before which nothing can begin.
    pub(crate) fn set_earliest(&mut self, earliest: Time) {
        self.earliest = earliest;
    }

    /// Returns the instant of the next event; never before the present of the gateway.
    pub(crate) fn next_event(&self) -> Option<Time> {
        let tune = self.tune.filter(|_| self.gateway.is_idle());
        let tune = tune.map(|(at, _)| at.max(self.gateway.now()));
        [self.gateway.next_event(), tune]
            .into_iter()
            .flatten()
            .min()
    }

    /// Computes the gateway up to `to`.
    pub(crate) fn advance(&mut self, to: Time) {
        while let Some(at) = self.next_event().filter(|&at| at <= to) {
            self.gateway.advance(at);
            if self.gateway.is_idle()
                && let Some((_, parameters)) = self.tune.take_if(|(from, _)| *from <= at)
            {
                self.gateway.retune(parameters);
            }
        }
        self.gateway.advance(to);
        for news in self.gateway.take_news() {
            self.take(news);
        }
        let sent = self.gateway.uart.take_sent(to);
        self.received.extend(sent);
        let excess = self.received.len().saturating_sub(KEPT);
        self.received.drain(..excess);
    }

    /// Takes news of the gateway or of another transmitter, which the boards do not know.
    fn take(&mut self, news: News) {
        if !matches!(news, News::Tuned(..)) {
            self.news.push((news.clone(), self.loss));
            self.enter(&news);
        }
    }

    /// Takes news of the module of a board. Returns the loss of packets.
    pub(crate) fn take_of_board(&mut self, board: u16, news: &News) -> f64 {
        if let News::Tuned(at, parameters) = news
            && self.follow
            && board == self.leader
        {
            let from = *at + timing::CHECK;
            self.tune = Some((from, parameters.with_default_uart()));
        }
        self.enter(news);
        self.loss
    }

    /// Enters a packet in the record, and passes it on to the gateway.
    fn enter(&mut self, news: &News) {
        tell(&mut self.gateway, news, self.loss);
        match news {
            News::Begun(packet) => {
                if self.packets.len() >= KEPT {
                    self.packets.pop_front();
                }
                self.packets.push_back(packet.clone());
            }
            News::Cut(sender, number, at) => {
                let mut packets = self.packets.iter_mut().rev();
                let cut = packets.find(|packet| packet.is(*sender, *number));
                cut.into_iter().for_each(|packet| packet.end = *at);
            }
            News::Tuned(..) => {}
        }
    }

    /// Removes and returns the news for the boards, with the loss of packets.
    pub(crate) fn take_news(&mut self) -> Vec<(News, f64)> {
        core::mem::take(&mut self.news)
    }

    /// Returns whether there is news for the boards.
    pub(crate) fn has_news(&self) -> bool {
        !self.news.is_empty()
    }
}

/// Passes news of another transmitter on to a module.
pub(crate) fn tell(module: &mut Module, news: &News, loss: f64) {
    match news {
        News::Begun(packet) => module.add(packet, loss),
        News::Cut(sender, number, at) => module.cut(*sender, *number, *at),
        News::Tuned(..) => {}
    }
}
