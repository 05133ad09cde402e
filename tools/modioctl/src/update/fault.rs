//! Why an update of a unit fails, for people.

use std::fmt;

use modbus_line::names;
use register_map::update::{Reason, State};

/// Why a unit takes no further part. The texts say what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It does not answer.
    Silent,
    /// It refuses an order or a block with this exception.
    Refused(&'static str, u8),
    /// It has rejected the image.
    Rejected(Reason),
    /// The image that it is to go back to is no longer whole.
    Aged,
    /// Its answers are not those of an update.
    Strange,
    /// It has taken no block in many rounds.
    NoProgress,
    /// It has restarted again and again.
    Restarts,
    /// It has not started the image.
    NotStarted,
    /// It runs another image than the update sent.
    OtherImage,
    /// It has not confirmed the image.
    NotConfirmed,
    /// A restart would lose its settings, so it was left out.
    Unsaved,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Silent => {
                "does not answer any more: check power and wiring, and whether another program uses the line, then run the same command again"
            }
            Self::Refused(what, code) => {
                let name = names::exception(*code).unwrap_or("unknown exception");
                let advice = match code {
                    6 => {
                        "another command may be under way, or there were too many saves: wait a minute and run the same command again; over the air LORA must be 1. Otherwise the key of that image is revoked, or its security epoch is below the floor"
                    }
                    _ => "its firmware may not fit this program",
                };
                return write!(
                    f,
                    "refuses {what} with exception {code:02X} ({name}): {advice}"
                );
            }
            Self::Rejected(reason) => {
                let text = reason_text(*reason);
                write!(f, "rejected the image ({text}), and runs the previous one")?;
                return f.write_str(advice(*reason));
            }
            Self::Strange => {
                "answers what this program does not understand: a newer modioctl may be needed"
            }
            Self::NoProgress => {
                "takes no more blocks: the line may be disturbed (try --unicast), or its flash may be worn"
            }
            Self::Restarts => {
                "restarts during the update: check its supply, then run the same command again"
            }
            Self::NotStarted => {
                "has not started the image, and runs the previous one: run the same command again"
            }
            Self::OtherImage => {
                "runs another image than this command sent: another program may update it; see `modioctl update --status`"
            }
            Self::Aged => {
                "cannot go back: the image in its other slot has aged (its CRC-32 is wrong), so it runs what it ran before; send the file of that firmware instead"
            }
            Self::Unsaved => {
                "has settings in force that are not saved, and its restart would lose them, so it was left out: save them with `modioctl config save`, or give --force to lose them"
            }
            Self::NotConfirmed => {
                "runs the image, but has not confirmed it: run the same command again (the unit goes back after half an hour at most)"
            }
        })
    }
}

/// Returns what to do about an image that was rejected, if the reason does not say it.
const fn advice(reason: Reason) -> &'static str {
    match reason {
        Reason::Interrupted => ": check its supply, then run the same command again",
        Reason::Crc | Reason::Hash => {
            ": run the same command again; if that fails, too, its flash may be worn"
        }
        Reason::NotConfirmed => ": this firmware starts and does not serve; report it",
        _ => "",
    }
}

/// Describes the state of a slot.
pub const fn state_text(state: State) -> &'static str {
    match state {
        State::Empty => "empty",
        State::Receiving => "receiving",
        State::New => "not checked yet",
        State::Checking => "being checked",
        State::Trial(_) => "on trial",
        State::Confirmed => "confirmed",
        State::Rejected(_) => "rejected",
    }
}

/// Describes why an image was rejected.
pub fn reason_text(reason: Reason) -> &'static str {
    match reason {
        Reason::Magic => "it has no header",
        Reason::Board => "it is for another board",
        Reason::Address => "it is for the other slot",
        Reason::Length => "its length is wrong",
        Reason::Epoch => "its security epoch is too old",
        Reason::Crc => "its CRC-32 is wrong",
        Reason::Hash => "its hash is wrong",
        Reason::Signature => "its signature is not by a key of the unit's loader",
        Reason::Interrupted => "its check was interrupted",
        Reason::NotConfirmed => "it was started twice and not confirmed",
    }
}
