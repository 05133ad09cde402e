//! The steps of serving a request, in their only possible order.

use super::Server;
use crate::line::{Framing, Port, Units};
use crate::{Adu, DataModel, Decision, LineCounters, Outcome};

/// A request that was taken from its port. The unit address of its reply may already be sent.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Request<'a> {
    adu: &'a mut Adu,
    line: LineCounters,
    ended: u32,
}

/// A request about which the server has decided.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Decided<'a> {
    request: Request<'a>,
    decision: Decision,
}

/// A request whose reply has its head.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Answered<'a>(Decided<'a>);

/// A request that counters and event log include.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Committed<'a>(Decided<'a>);

/// A request that has been executed.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Served<'a> {
    adu: &'a mut Adu,
    replying: bool,
    framing: Framing,
}

impl Server {
    /// Takes the request that waits at `port`, if any, and lets its reply start, immediately or after `delay` ticks
    /// ([`Port::start`]). The unit address is sent while the rest is decided.
    ///
    /// The following steps must be called one by one, each under a lock of what it needs: [`Request::decide`]
    /// (model), [`Decided::answer`] (port), [`Answered::commit`], [`Committed::carry_out`] (model),
    /// [`Served::finish`] (port). [`serve`](Self::serve) calls them all.
    #[inline]
    pub fn take<'a, U: Units>(&self, port: &mut Port<'a, U>, delay: u16) -> Option<Request<'a>> {
        let (closed, ended) = port.take_request()?;
        if self.answers(closed.adu) {
            port.open(closed.adu.get(0), self.framing(), delay);
        }
        Some(Request {
            adu: closed.adu,
            line: closed.line,
            ended,
        })
    }

    /// Serves the request that waits at `port`, if any, and returns its result.
    pub fn serve(
        &mut self,
        port: &mut Port<'_, impl Units>,
        delay: u16,
        model: &mut impl DataModel,
    ) -> Option<Outcome> {
        let committed = self
            .take(port, delay)?
            .decide(self, model)
            .answer(port)
            .commit(self);
        let outcome = committed.decision().outcome;
        committed.carry_out(self, model).finish(port);
        Some(outcome)
    }
}

impl<'a> Request<'a> {
    /// Returns the unit address of the request; 0 for a broadcast.
    #[inline]
    #[must_use]
    pub fn unit(&self) -> u8 {
        self.adu.get(0)
    }

    /// Decides the reply. Everything that can be rejected is rejected here. Changes nothing.
    #[inline]
    pub fn decide(self, server: &Server, model: &impl DataModel) -> Decided<'a> {
        Decided {
            decision: server.decide(self.adu, model),
            request: self,
        }
    }
}

impl<'a> Decided<'a> {
    /// Passes the head of the reply to the port, if there is a reply.
    #[inline]
    pub fn answer(self, port: &mut Port<'a, impl Units>) -> Answered<'a> {
        if let Some(head) = self.decision.reply {
            port.set_head(head);
        }
        Answered(self)
    }
}

impl<'a> Answered<'a> {
    /// Counts and logs the request.
    #[inline]
    pub fn commit(self, server: &mut Server) -> Committed<'a> {
        server.commit(&self.0.decision, &self.0.request.line);
        Committed(self.0)
    }
}

impl<'a> Committed<'a> {
    /// Returns the decision.
    #[inline]
    #[must_use]
    pub const fn decision(&self) -> &Decision {
        &self.0.decision
    }

    /// Returns the tick in which the request ended.
    #[inline]
    #[must_use]
    pub const fn ended(&self) -> u32 {
        self.0.request.ended
    }

    /// Executes the request: writes points and registers, and creates the rest of the reply.
    #[inline]
    pub fn carry_out(self, server: &mut Server, model: &mut impl DataModel) -> Served<'a> {
        let Decided { request, decision } = self.0;
        server.carry_out(&decision, request.adu, model);
        Served {
            adu: request.adu,
            replying: decision.reply.is_some(),
            framing: server.framing(),
        }
    }
}

impl<'a> Served<'a> {
    /// Passes the rest of the reply to the port, or gives the buffer back.
    #[inline]
    pub fn finish(self, port: &mut Port<'a, impl Units>) {
        port.finish(self.adu, self.replying, self.framing);
    }
}
