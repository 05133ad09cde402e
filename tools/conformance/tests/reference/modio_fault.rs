//! What a faulty modio does wrong, one thing at a time, and the cases about a modio that must find it.

use super::fault::faults;

faults! {
    ModioFault MODIO_FAULTS;
    /// Gives input points as 0 by function 01.
    InputsBy02Only => ["fc02/same-as-01"],
    /// Gives a register as 0 by function 04.
    HidesFrom04 => ["fc04/same-as-03"],
    /// Writes the send event of exception 06 as that of exceptions 01 to 03.
    LogsBusyAsRefused => ["fc0c/busy-exception-sent"],
    /// Gives another CRC of its self-description in its register.
    StaleDescriptionCrc => ["files/self-description"],
    /// Gives the first group of a request for each of its groups.
    RepeatsFirstGroup => ["files/groups"],
    /// Refuses the longest group of records.
    RefusesLongestGroup => ["files/longest-reply"],
    /// Gives records beyond the end of its file.
    ReadsBeyondTheFile => ["files/beyond-the-end"],
    /// Echoes writes to its file.
    EchoesFileWrites => ["files/read-only"],
    /// Gives the line's counters one too low in its registers.
    RegistersLag => ["counters/registers"],
    /// Sends a byte too many in exceptions.
    LongExceptions => ["worked/for-this-unit", "worked/requests-readdressed"],
    /// Restarts when a function of 80 or above is asked for.
    RestartsByOddFrames => ["hurts/restarts"],
    /// Loses a request that begins within t1.5 after its own reply.
    LosesFastRequests => ["hurts/masters-without-gaps"],
    /// Takes every value of BAUD.
    AnyBaud => ["hurts/wrong-baud-and-format"],
    /// Clears one half of a counter.
    ClearsHalfCounters => ["hurts/half-written"],
    /// Switches its outputs to SAFE one after the other.
    SafeOneByOne => ["hurts/torn-values"],
    /// Has no communication watchdog.
    WatchdogSleeps => ["outputs/safe-when-the-line-dies"],
    /// Does not count broadcasts as a sign that the line lives.
    BroadcastsAreNoLife => ["outputs/stay-while-the-line-lives"],
    /// Echoes writes to input points.
    EchoesInputs => ["outputs/inputs-take-no-writes"],
    /// Keeps its outputs over a loss of power.
    KeepsOutputs => ["outputs/start-value"],
    /// Takes writes to its configuration while the lock is closed.
    NoLock => ["config/locked"],
    /// Takes any key.
    AnyKey => ["config/wrong-key"],
    /// Checks the lock before the value.
    LockFirst => ["config/value-before-lock"],
    /// Echoes writes to its state.
    EchoesStateWrites => ["config/read-only"],
    /// Gives the last command when COMMAND is read.
    CommandReadsBack => ["config/command-reads-0"],
    /// Writes the values before the one that it refuses.
    WritesUpToTheBadOne => ["config/all-or-nothing"],
    /// Replies without the delay that is set.
    RepliesUndelayed => ["config/response-delay"],
    /// Restarts before its reply, which goes out under the new rate.
    RestartsBeforeReply => ["settings/reply-under-the-old-rate"],
    /// Runs at 115200 bit/s when it is set to 230400.
    LacksARate => ["settings/every-rate"],
    /// Uses even parity when it is set to odd.
    OddIsEven => ["settings/every-format"],
}
