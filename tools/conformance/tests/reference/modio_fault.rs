//! What a faulty modio does wrong, one thing at a time, and the cases about a modio that must find it.

use super::fault::faults;

faults! {
    ModioFault MODIO_FAULTS;
    /// Sends input points as 0 by function 01.
    InputsBy02Only => ["fc02/same-as-01"],
    /// Sends a register as 0 by function 04.
    HidesFrom04 => ["fc04/same-as-03"],
    /// Writes the send event of exception 06 as that of exceptions 01 to 03.
    LogsBusyAsRefused => ["fc0c/busy-exception-sent"],
    /// Has a wrong CRC of its self-description in its register.
    StaleDescriptionCrc => ["files/self-description"],
    /// Sends the first group of a request for each of its groups.
    RepeatsFirstGroup => ["files/groups"],
    /// Refuses the longest group of records.
    RefusesLongestGroup => ["files/longest-reply"],
    /// Sends records after the end of its file.
    ReadsBeyondTheFile => ["files/beyond-the-end"],
    /// Echoes writes to its file.
    EchoesFileWrites => ["files/read-only"],
    /// Has the counters of the line one too low in its registers.
    RegistersLag => ["counters/registers"],
    /// Sends one byte too many in exceptions.
    LongExceptions => ["worked/for-this-unit", "worked/requests-readdressed"],
    /// Restarts at a request with function 80 or above.
    RestartsByOddFrames => ["hurts/restarts"],
    /// Loses a request that begins within t1.5 after its own reply.
    LosesFastRequests => ["hurts/masters-without-gaps"],
    /// Accepts every value of BAUD.
    AnyBaud => ["hurts/wrong-baud-and-format"],
    /// Clears one half of a counter.
    ClearsHalfCounters => ["hurts/half-written"],
    /// Switches its outputs to SAFE one after the other.
    SafeOneByOne => ["hurts/torn-values"],
    /// Has no communication watchdog.
    WatchdogSleeps => ["outputs/safe-when-the-line-dies"],
    /// Restarts the communication timeout at a request to another unit.
    OtherUnitsAreLife => ["outputs/safe-when-the-line-dies"],
    /// Restarts the communication timeout at a frame with a wrong checksum.
    BadFramesAreLife => ["outputs/safe-when-the-line-dies"],
    /// Does not restart the communication timeout at a broadcast.
    BroadcastsAreNoLife => ["outputs/stay-while-the-line-lives"],
    /// Does not restart the communication timeout at a write of HEARTBEAT.
    HeartbeatsAreNoLife => ["outputs/stay-while-heartbeats-come"],
    /// Echoes writes to input points.
    EchoesInputs => ["outputs/inputs-take-no-writes"],
    /// Keeps its outputs at a loss of power.
    KeepsOutputs => ["outputs/start-value"],
    /// Accepts writes to its configuration while the lock is closed.
    NoLock => ["config/locked"],
    /// Refuses HEARTBEAT while the lock is closed.
    LocksHeartbeat => ["config/heartbeat"],
    /// Accepts any key.
    AnyKey => ["config/wrong-key"],
    /// Checks the lock before the value.
    LockFirst => ["config/value-before-lock"],
    /// Echoes writes to its state.
    EchoesStateWrites => ["config/read-only"],
    /// Sends the last command when COMMAND is read.
    CommandReadsBack => ["config/command-reads-0"],
    /// Writes the values in front of a value that it refuses.
    WritesUpToTheBadOne => ["config/all-or-nothing"],
    /// Ignores RESPONSE_DELAY.
    RepliesUndelayed => ["config/response-delay"],
    /// Restarts before its reply, which is then sent at the new rate.
    RestartsBeforeReply => ["settings/reply-under-the-old-rate"],
    /// Uses 115200 bit/s when it is set to 230400.
    LacksARate => ["settings/every-rate"],
    /// Has DEAD_TIME, MAX_ON and MIN_OFF without an effect.
    TimesWithoutEffect => [
        "stage/both-in-one-request", "stage/other-direction", "stage/master-repeats", "stage/shortest-time-off"
    ],
    /// Uses even parity when it is set to odd.
    OddIsEven => ["settings/every-format"],
}
