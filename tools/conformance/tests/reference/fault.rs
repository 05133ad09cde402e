//! The faults of a server, and the cases that must find each fault.

/// Defines an enumeration of faults, and a table of the cases that must find each fault.
macro_rules! faults {
    ($name:ident $table:ident; $($(#[doc = $about:literal])+ $fault:ident => [$($case:literal),+],)+) => {
        /// A fault.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[doc = $about])+ $fault,)+
        }

        /// Every fault, and the names of the cases that must fail because of it.
        pub const $table: &[($name, &[&str])] = &[$(($name::$fault, &[$($case),+])),+];
    };
}

pub(super) use faults;

faults! {
    Fault FAULTS;
    /// Replies to broadcasts.
    AnswersBroadcasts => ["broadcast/coils", "broadcast/registers", "broadcast/read", "broadcast/nonsense", "timing/driver-stays-off"],
    /// Treats address 255 as a broadcast.
    Obeys255 => ["address/other-units-write", "address/other-units-write-words"],
    /// Does not check the CRC.
    IgnoresCrc => ["framing/bad-crc", "ascii/bad-lrc", "worked/errata", "framing/bad-crc-writes-nothing", "framing/unknown-function-bad-crc", "framing/truncated"],
    /// Accepts a CRC with its bytes exchanged as well.
    TakesSwappedCrc => ["framing/swapped-crc"],
    /// Accepts 1234 as "on".
    TakesCoil1234 => ["fc05/value", "broadcast/refused-writes-nothing"],
    /// Answers 126 registers.
    Answers126 => ["fc03/quantity-above-most", "fc04/quantity-above-most"],
    /// Answers quantity 0 with no data.
    AnswersQuantity0 => ["fc04/quantity-0", "fc01/quantity-0", "fc02/quantity-0", "fc03/quantity-0"],
    /// Counts addresses modulo 65536.
    Wraps => ["fc01/no-wrap", "fc02/no-wrap", "fc03/no-wrap", "fc04/no-wrap"],
    /// Checks the address before the quantity.
    AddressFirst => ["fc03/quantity-before-address", "fc01/quantity-before-address", "fc02/quantity-before-address", "fc04/quantity-before-address"],
    /// Leaves old bits in the padding of the last byte.
    DirtyPadding => ["fc02/byte-count", "fc01/byte-count"],
    /// Ignores the length of a read request.
    IgnoresLength => ["fc03/length", "fc01/length", "fc02/length", "fc04/length"],
    /// Writes the registers that exist before it refuses the others.
    WritesPartly => ["fc10/partly-out-of-range", "fc10/one-bad-value"],
    /// Does not compare the byte count of 10 with the quantity.
    IgnoresByteCount => ["fc10/byte-count"],
    /// Writes padding bits of 0F to the coils after the range.
    WritesPadding => ["fc0f/padding"],
    /// Stores a value before it refuses it.
    StoresRefused => ["fc06/refused-value"],
    /// Reads before it writes in 17.
    ReadsFirst => ["fc17/write-before-read"],
    /// Serves a truncated 17 as if the missing bytes were zeros.
    FillsTruncated => ["fc17/truncated"],
    /// Leaves out the complement in the formula of 16.
    PlainOr => ["fc16/formula"],
    /// Echoes two bytes of 08/00 only.
    ShortEcho => ["fc08/echo"],
    /// Replies in listen-only mode.
    TalksInListenOnly => ["fc08/listen-only"],
    /// Writes in listen-only mode.
    WritesInListenOnly => ["fc08/listen-only-writes"],
    /// 08/0A clears nothing.
    NeverClears => ["fc08/clear-counters"],
    /// 08/0A clears the first counter and no other.
    ClearsOneAlone => ["fc08/clear-counters"],
    /// Counts exceptions as events.
    CountsExceptions => ["fc0b/counts"],
    /// Keeps the log at a restart with FF00.
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
    ErrorsUncounted => ["counters/bus-errors", "counters/bus-errors-short"],
    /// Does not count broadcasts as messages without response.
    BroadcastsUncounted => ["counters/no-response"],
    /// Sends the identification in one reply, whatever its length.
    NeverSplits => ["fc2b/extended-stream"],
    /// Answers 03 for an object that does not exist.
    Object03 => ["fc2b/individual-unknown"],
    /// Answers 03 for another MEI type.
    Mei03 => ["fc2b/mei-type"],
    /// Is silent to functions that it does not have.
    SilentToUnknown => ["dispatch/unknown-function", "dispatch/unknown-function-longest"],
    /// Refuses unknown functions for other units as well.
    RefusesForOthers => ["dispatch/unknown-function-elsewhere"],
    /// Stops after a request with function 00.
    DiesOf00 => ["dispatch/function-00-and-80-up", "hurts/odd-frames"],
    /// Accepts frames of any length.
    TakesLongFrames => ["framing/too-long", "ascii/too-long"],
    /// Finds a good request at the end of other bytes.
    FindsRequests => ["framing/good-request-at-the-end-of-noise", "ascii/colon-restarts", "framing/two-at-once"],
    /// Sends a 00 after each reply.
    TrailingZero => ["framing/no-byte-around-the-reply"],
    /// Answers noise with an exception.
    AnswersNoise => ["hurts/noise", "framing/short-noise"],
    /// Ignores one request after another unit's reply.
    DeafAfterOthers => ["bus/others-traffic"],
    /// Treats its own reply as a request.
    HearsItself => ["bus/own-echo"],
    /// Replies before t3.5 has passed.
    RepliesEarly => ["timing/reply-after-t3.5", "timing/exceptions-after-t3.5"],
    /// Pauses in the middle of a reply.
    Pauses => ["timing/no-gap-in-the-reply"],
    /// Switches its driver off a character too early.
    ReleasesEarly => ["timing/driver-held"],
    /// Drops frames with a gap above t1.5 only near their end.
    StrictSometimes => ["gaps/t1.5-to-t3.5"],
    /// Treats two parts of a frame as one frame.
    JoinsParts => ["gaps/above-t3.5", "ascii/gap-above-1-s", "gaps/t3.5-is-enough", "gaps/after-noise", "bus/request-right-after-others-reply"],
    /// Ends frames at three quarters of t3.5.
    ClosesEarly => ["gaps/a-bit-too-soon", "gaps/just-below-t3.5"],
    /// Ends frames at t1.5.
    ClosesAtT15 => ["gaps/too-soon"],
    /// Ignores parity errors.
    IgnoresParity => ["damage/parity-error"],
    /// Ignores framing errors.
    IgnoresStop => ["damage/framing-error", "ascii/damaged-character", "damage/parity-error-broadcast", "counters/bus-errors-characters"],
    /// Accepts a request at power-on without a silence in front of it.
    HasteAtStart => ["power/in-the-middle-of-traffic"],
    /// Checks the address before quantity and byte count in requests that write several points.
    AddressFirstInWrites => ["fc0f/quantity-before-address", "fc10/quantity-before-address", "fc17/quantity-before-address"],
    /// Checks values before the address.
    ValueFirst => ["fc06/address-before-value", "fc10/address-before-value"],
    /// Reads 124 registers at most in 17.
    Reads124 => ["fc17/quantities-most"],
    /// Obeys broadcast diagnostics.
    ObeysBroadcastDiagnostics => ["broadcast/restart", "broadcast/listen-only"],
    /// Is silent to 08/03.
    SilentToDelimiter => ["fc08/delimiter-in-rtu"],
    /// Starts every stream of objects at object 0.
    StreamsFromZero => ["fc2b/stream-from-the-middle"],
    /// Answers 2001 bits.
    Answers2001 => ["fc01/quantity-above-most", "fc02/quantity-above-most"],
    /// Refuses the longest reads.
    RefusesLongestReads => ["fc01/quantity-most", "fc02/quantity-most", "fc03/quantity-most", "fc04/quantity-most"],
    /// Reads one address past the end of each table.
    ReadsPastTheEnd => ["fc01/one-past-the-end", "fc02/one-past-the-end", "fc03/one-past-the-end", "fc04/one-past-the-end"],
    /// Sends the number of registers instead of the byte count.
    CountsRegisters => ["fc03/byte-count", "fc04/byte-count"],
    /// Never switches a coil off by 05.
    NeverSwitchesOff => ["fc05/on-and-off"],
    /// Echoes single writes to addresses that do not exist.
    EchoesNowhere => ["fc05/address", "fc06/address", "fc16/address"],
    /// Checks the address before the value in 05.
    CoilAddressFirst => ["fc05/value-before-address"],
    /// Ignores bytes after a request of a fixed length.
    IgnoresSpareBytes => ["fc05/length", "fc06/length", "fc16/length", "fc07/length", "fc0b/length", "fc0c/length", "fc11/length", "fc2b/length"],
    /// Adds a byte to the replies of 07, 0B, 0C and 11.
    AddsAByte => ["fc07/shape", "fc0b/shape", "fc0c/shape", "fc11/shape"],
    /// Echoes requests of 08 without a whole sub-function.
    EchoesShortDiagnostics => ["fc08/length"],
    /// Ignores data after the byte count of 0F and 10.
    IgnoresSpareData => ["fc0f/data-length", "fc10/data-length"],
    /// Echoes the data of 0F and 10 as well.
    EchoesData => ["fc0f/every-quantity", "fc10/every-quantity"],
    /// Accepts quantity 0 in 0F, 10 and 17.
    WritesQuantity0 => ["fc0f/quantity-0-and-1969", "fc10/quantity-0-and-124", "fc17/quantities"],
    /// Refuses the longest writes.
    RefusesLongestWrites => ["fc0f/quantity-1968", "fc10/quantity-123"],
    /// Does not compare the byte count of 0F and 17 with the quantity.
    IgnoresOtherByteCounts => ["fc0f/byte-count", "fc17/byte-count"],
    /// Writes the coils that exist before it refuses the others.
    WritesCoilsPartly => ["fc0f/past-the-end"],
    /// Writes also the register after the register of 06.
    WritesNeighbour => ["fc06/echo"],
    /// Does not check the result of 16.
    MasksBeyondRange => ["fc16/refused-value"],
    /// Writes to the address to read in 17.
    WritesWhereItReads => ["fc17/two-places"],
    /// Writes in 17 before it checks the address to read.
    WritesBeforeItChecks => ["fc17/address"],
    /// Answers requests of 14 with a wrong byte count, and those whose reply is too long, with no groups.
    TakesAnyFileRequest => ["fc14/byte-count", "fc14/length", "fc14/longest-reply"],
    /// Accepts any reference type.
    TakesAnyReference => ["fc14/reference-type"],
    /// Treats file 0 as file 1.
    TakesFile0 => ["fc14/file-0"],
    /// Treats records above 9999 as record 0.
    WrapsRecords => ["fc14/record-above-9999"],
    /// Counts one object too many in identification replies.
    CountsObjectsWrong => ["fc2b/basic-stream", "fc2b/regular-stream"],
    /// Sends another value of an object when only that object is read.
    IndividualDiffers => ["fc2b/individual"],
    /// Refuses a stream from an object that does not exist.
    RefusesUnknownStart => ["fc2b/stream-restarts"],
    /// Treats read code 0 as 1.
    TakesReadCode0 => ["fc2b/read-code"],
    /// Sends another event count in the log than in 0B.
    LogCountDiffers => ["fc0c/counts"],
    /// Answers sub-functions that it does not have.
    EchoesAnySubFunction => ["fc08/unknown-sub-function"],
    /// Ignores the data of sub-functions.
    IgnoresDiagnosticData => ["fc08/data"],
    /// Sends a diagnostic register of one byte.
    ShortRegister => ["fc08/register"],
    /// Restarts on any data of 08/01.
    TakesAnyRestart => ["fc08/restart"],
    /// Keeps its counters at a restart.
    RestartKeepsCounters => ["fc08/restart"],
    /// Has overruns from the start, which 08/14 does not clear.
    OverrunsStay => ["fc08/clear-overruns"],
    /// Counts every request as not acknowledged.
    CountsNak => ["counters/nak-busy-overrun"],
    /// Does not count exceptions.
    ExceptionsUncounted => ["counters/exceptions"],
    /// Does not count broadcasts as messages for the unit.
    BroadcastsAreNoMessages => ["counters/unit-messages"],
    /// Answers requests for the next address.
    AnswersNeighbour => ["address/other-units"],
    /// Answers requests for address 248 and above.
    AnswersReserved => ["address/reserved"],
    /// Drops frames with a gap above a third of t1.5.
    DropsShortGaps => ["gaps/below-t1.5"],
    /// Ignores one request after a break.
    DeafAfterBreak => ["damage/break"],
    /// Ignores one request after a glitch.
    DeafAfterGlitch => ["damage/glitch"],
    /// Restarts t3.5 after a short pulse.
    PulsesRestartSilence => ["damage/noise-behind-a-frame"],
    /// Ignores one request after a bad frame.
    DeafAfterBadFrames => ["bus/others-truncated-traffic", "bus/stray-zero"],
    /// Ignores one request after a long reply of another unit.
    DeafAfterLongReplies => ["bus/others-long-replies"],
    /// Finds requests inside other units' frames.
    FindsInside => ["bus/others-reply-is-no-request"],
    /// Ignores one byte after a frame.
    IgnoresTrailingByte => ["framing/trailing-byte"],
    /// Loses a request that begins less than twice t3.5 after its own reply.
    SlowToListen => ["timing/back-to-back"],
    /// Holds frames of 254 bytes, or 508 digits, at most.
    ShortBuffer => ["framing/longest", "ascii/longest"],
    /// Refuses requests for unit 1.
    RefusesForUnit1 => ["worked/for-other-units"],
    /// Does not answer after the power was off.
    DeadAfterPowerOff => ["power/answers"],
    /// Sends a 00 when it starts.
    ZeroAtStart => ["power/no-byte-by-itself"],
    /// Accepts any new end character of ASCII frames.
    TakesAnyDelimiter => ["ascii/delimiter-refused"],
    /// Echoes 08/03 and keeps its delimiter.
    KeepsDelimiter => ["ascii/delimiter"],
    /// Accepts lower-case digits in ASCII.
    TakesLowerCase => ["ascii/lower-case"],
    /// Accepts any character as a digit in ASCII.
    TakesAnyDigit => ["ascii/not-a-digit"],
    /// Loses an ASCII frame after characters in front of its colon.
    NeedsColonFirst => ["ascii/before-the-colon"],
    /// Ends ASCII frames after half a second.
    ImpatientInAscii => ["ascii/gap-below-1-s"],
    /// Answers RTU frames in ASCII mode.
    TakesRtuInAscii => ["ascii/rtu-frame"],
    /// Keeps a truncated ASCII frame when a colon is received.
    KeepsTruncated => ["ascii/truncated"],
    /// Takes part in a scan again after it was found.
    FoundAgain => ["fast/scan"],
    /// Answers requests to any serial number.
    AnswersAnySerial => ["fast/other-serial"],
    /// Refuses requests to its serial number.
    RefusesBySerial => ["fast/by-serial"],
    /// Refuses unknown requests of function 70 that are for all units.
    AnswersUnknownToAll => ["fast/unknown-to-all"],
    /// Echoes unknown sub-functions of function 70.
    EchoesUnknownFast => ["fast/unknown-to-unit"],
    /// Does not check the length of a list of settings of function 70.
    IgnoresSettingsLength => ["fast/settings"],
    /// Sends events once, also if they are not confirmed.
    ForgetsEvents => ["fast/events"],
}
