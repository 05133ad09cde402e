//! What a faulty server does wrong, one thing at a time, and the cases that must find it.

macro_rules! faults {
    ($($(#[doc = $about:literal])+ $name:ident => [$($case:literal),+],)+) => {
        /// A mistake.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Fault {
            $($(#[doc = $about])+ $name,)+
            /// Takes any character as the one that ends an ASCII frame.
            TakesAnyDelimiter,
            /// Takes lower-case digits in ASCII.
            TakesLowerCase,
        }

        /// Every mistake, and the names of the cases that must fail by it.
        pub const FAULTS: &[(Fault, &[&str])] = &[$((Fault::$name, &[$($case),+])),+];
    };
}

faults! {
    /// Replies to broadcasts.
    AnswersBroadcasts => ["broadcast/coils"],
    /// Takes 255 for a broadcast.
    Obeys255 => ["address/other-units-write"],
    /// Does not look at the CRC.
    IgnoresCrc => ["framing/bad-crc"],
    /// Takes the CRC high byte first as well.
    TakesSwappedCrc => ["framing/swapped-crc"],
    /// Takes 1234 for "on".
    TakesCoil1234 => ["fc05/value"],
    /// Answers 126 registers.
    Answers126 => ["fc03/quantity-above-most"],
    /// Answers quantity 0 with no data.
    AnswersQuantity0 => ["fc04/quantity-0"],
    /// Counts addresses modulo 65536.
    Wraps => ["fc01/no-wrap"],
    /// Checks the address before the quantity.
    AddressFirst => ["fc03/quantity-before-address"],
    /// Leaves old bits in the padding of the last byte.
    DirtyPadding => ["fc02/byte-count"],
    /// Ignores the length of a read request.
    IgnoresLength => ["fc03/length"],
    /// Writes what it can before it finds that the rest is out of range.
    WritesPartly => ["fc10/partly-out-of-range"],
    /// Does not compare the byte count of 10 with the quantity.
    IgnoresByteCount => ["fc10/byte-count"],
    /// Writes padding bits of 0F to the coils after the range.
    WritesPadding => ["fc0f/padding"],
    /// Stores a value before it refuses it.
    StoresRefused => ["fc06/refused-value"],
    /// Reads before it writes in 17.
    ReadsFirst => ["fc17/write-before-read"],
    /// Does a truncated 17 with zeros.
    FillsTruncated => ["fc17/truncated"],
    /// Forgets the complement in the formula of 16.
    PlainOr => ["fc16/formula"],
    /// Echoes two bytes of 08/00 only.
    ShortEcho => ["fc08/echo"],
    /// Goes on talking in listen-only mode.
    TalksInListenOnly => ["fc08/listen-only"],
    /// Goes on writing in listen-only mode.
    WritesInListenOnly => ["fc08/listen-only-writes"],
    /// 08/0A clears nothing.
    NeverClears => ["fc08/clear-counters"],
    /// 08/0A clears the first counter and no other.
    ClearsOneAlone => ["fc08/clear-counters"],
    /// Counts exceptions as events.
    CountsExceptions => ["fc0b/counts"],
    /// Keeps the log over a restart with FF00.
    KeepsLog => ["fc0c/cleared-by-restart"],
    /// Puts the newest event last.
    LogBackwards => ["fc0c/newest-first"],
    /// Writes no receive event for a frame with a bad check or a damaged character.
    ErrorsUnlogged => ["fc0c/communication-error", "fc0c/communication-error-characters"],
    /// Writes no send event for a request that gets no reply.
    SilenceUnlogged => ["fc0c/broadcast"],
    /// Writes no send event for a reply.
    RepliesUnlogged => ["fc0c/reply-sent"],
    /// Writes receive events of requests for other units.
    LogsOthers => ["fc0c/other-units"],
    /// Writes receive events of broadcasts without bit 6.
    BroadcastsLoggedAsOthers => ["fc0c/broadcast"],
    /// Writes send events of exceptions as those of ordinary replies.
    ExceptionsLoggedAsReplies => ["fc0c/exception-sent"],
    /// Writes events without bit 5 in listen-only mode.
    ModeUnlogged => ["fc0c/listen-only"],
    /// Writes no event 04 when it enters listen-only mode.
    EntryUnlogged => ["fc0c/listen-only"],
    /// Writes no event 00 for a restart.
    RestartUnlogged => ["fc0c/restart", "fc0c/cleared-by-restart"],
    /// Counts only its own messages as bus messages.
    DeafCounter => ["counters/bus-messages"],
    /// Does not count bad CRCs.
    ErrorsUncounted => ["counters/bus-errors"],
    /// Does not count broadcasts as messages without response.
    BroadcastsUncounted => ["counters/no-response"],
    /// Sends identification in one piece, however long.
    NeverSplits => ["fc2b/extended-stream"],
    /// Answers 03 for an object that is not there.
    Object03 => ["fc2b/individual-unknown"],
    /// Answers 03 for another MEI type.
    Mei03 => ["fc2b/mei-type"],
    /// Silent to functions it does not have.
    SilentToUnknown => ["dispatch/unknown-function"],
    /// Refuses unknown functions for other units, too.
    RefusesForOthers => ["dispatch/unknown-function-elsewhere"],
    /// Dies of a function 00.
    DiesOf00 => ["dispatch/function-00-and-80-up"],
    /// Takes frames of any length.
    TakesLongFrames => ["framing/too-long"],
    /// Finds a good request at the end of other bytes.
    FindsRequests => ["framing/good-request-at-the-end-of-noise"],
    /// Sends a 00 after each reply.
    TrailingZero => ["framing/no-byte-around-the-reply"],
    /// Answers noise with an exception.
    AnswersNoise => ["hurts/noise"],
    /// Deaf after another unit's reply.
    DeafAfterOthers => ["bus/others-traffic"],
    /// Takes its own echo for a request.
    HearsItself => ["bus/own-echo"],
    /// Replies at once, without waiting for t3.5.
    RepliesEarly => ["timing/reply-after-t3.5"],
    /// Pauses in the middle of a reply.
    Pauses => ["timing/no-gap-in-the-reply"],
    /// Switches its driver off a character too early.
    ReleasesEarly => ["timing/driver-held"],
    /// Drops frames with a gap above t1.5 only near their end.
    StrictSometimes => ["gaps/t1.5-to-t3.5"],
    /// Takes a frame in two parts for one.
    JoinsParts => ["gaps/above-t3.5"],
    /// Ends frames at three quarters of t3.5.
    ClosesEarly => ["gaps/a-bit-too-soon", "gaps/just-below-t3.5"],
    /// Ends frames at t1.5.
    ClosesAtT15 => ["gaps/too-soon"],
    /// Ignores parity errors.
    IgnoresParity => ["damage/parity-error"],
    /// Ignores framing errors.
    IgnoresStop => ["damage/framing-error"],
    /// Looks for a request in what it hears first, without a silence before it.
    HasteAtStart => ["power/in-the-middle-of-traffic"],
    /// Checks the address before quantity and byte count in requests that write several points.
    AddressFirstInWrites => ["fc0f/quantity-before-address", "fc10/quantity-before-address", "fc17/quantity-before-address"],
    /// Checks values before the address.
    ValueFirst => ["fc06/address-before-value", "fc10/address-before-value"],
    /// Reads 124 registers at most in 17.
    Reads124 => ["fc17/quantities-most"],
    /// Obeys broadcast diagnostics.
    ObeysBroadcastDiagnostics => ["broadcast/restart", "broadcast/listen-only"],
    /// Silent to 08/03.
    SilentToDelimiter => ["fc08/delimiter-in-rtu"],
    /// Starts every stream of objects at object 0.
    StreamsFromZero => ["fc2b/stream-from-the-middle"],
}

/// Mistakes of an ASCII server.
pub const ASCII_FAULTS: &[(Fault, &[&str])] = &[
    (Fault::IgnoresCrc, &["ascii/bad-lrc"]),
    (Fault::JoinsParts, &["ascii/gap-above-1-s"]),
    (Fault::FindsRequests, &["ascii/colon-restarts"]),
    (Fault::TakesLongFrames, &["ascii/too-long"]),
    (Fault::AnswersBroadcasts, &["broadcast/registers"]),
    (Fault::IgnoresStop, &["ascii/damaged-character"]),
    (Fault::TakesLowerCase, &["ascii/lower-case"]),
    (Fault::TakesAnyDelimiter, &["ascii/delimiter-refused"]),
];
