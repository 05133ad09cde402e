"""Types of the data that the simulator returns. Fields have the names of its HTTP interface."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Dict, Mapping, Optional, Tuple, Type, TypedDict, TypeVar

T = TypeVar("T")


def taken(what: Type[T], data: Mapping[str, Any]) -> T:
    """Returns a `what` from those members of a JSON object that are its fields.

    A newer simulator may send more members."""
    names = {field.name for field in fields(what)}  # type: ignore[arg-type]
    return what(**{name: value for name, value in data.items() if name in names})


@dataclass(frozen=True)
class Leds:
    """The LEDs of a board; true when lit."""

    activity: bool
    fault: bool
    run: bool


@dataclass(frozen=True)
class Line:
    """The RS-485 line, from the side of its client."""

    baud: int
    format: str
    """Such as "8N2"."""
    rx_frames: int
    """Number of frames sent to the unit."""
    tx_frames: int
    """Number of frames that the unit has sent."""


@dataclass(frozen=True)
class Channel:
    """A channel of a module. Fields that its kind does not have are None."""

    kind: str
    """"di", "do", "relay", "ai", "ao" or "none"."""
    energised: Optional[bool] = None
    """Of a digital input: voltage is applied. Of a relay: its coil is energised."""
    on: Optional[bool] = None
    """Of a digital output."""
    manual: Optional[bool] = None
    """Of a relay: its jumper is set to manual."""
    millivolts: Optional[int] = None
    """Of an analog input: voltage at the pin in mV, 0 to 3300."""
    code: Optional[int] = None
    """Of an analog output: code of its converter, 0 to 4095."""


@dataclass(frozen=True)
class Slot:
    """A slot of a board."""

    port: int
    module: str
    configured: str
    """The module that the unit has stored for this slot."""
    channels: Tuple[Channel, ...]

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Slot:
        """Returns a slot from JSON."""
        return taken(Slot, {**data, "channels": channels(data)})


@dataclass(frozen=True)
class Terminal:
    """A terminal of a board with fixed inputs and outputs. Fields that its kind does not have are None."""

    name: str
    """Name on the board, such as "X0"."""
    kind: str
    """"input", "relay", "voltage", "current", "potentiometer", "output", "switch" or "supply"."""
    point: Optional[int] = None
    """Address of its point, 0 to 31. None for a terminal without one."""
    energised: Optional[bool] = None
    """Of a digital input: voltage is applied. Of a relay: its coil is energised."""
    millivolts: Optional[int] = None
    """Of a voltage input, 0 to 12000, and of an analog output: voltage at the terminal in mV."""
    microamperes: Optional[int] = None
    """Of a current input: current in uA, 0 to 25000."""
    permille: Optional[int] = None
    """Of a potentiometer: position in thousandths, 0 to 1000."""
    high: Optional[bool] = None
    """Of a switch: its pin is connected to the supply, not to ground."""
    present: Optional[bool] = None
    """Of the monitor of the 24 V supply."""


@dataclass(frozen=True)
class Radio:
    """The LoRa module of a board."""

    mode: Optional[str]
    """"normal", "wake-up", "power-saving" or "sleep". None without power, during the start, and with a fault."""
    aux: bool
    """The pin AUX is high: the module is idle."""
    address: int
    channel_mhz: int
    """Frequency of the channel in MHz, 410 to 441."""
    air_rate: int
    """Bit rate on the air, in bit/s."""
    power_dbm: int
    packets_sent: int
    packets_received: int


@dataclass(frozen=True)
class State:
    """The state of a board."""

    virtual_ms: int
    """Virtual time since the simulator was started."""
    board: str
    """Such as "modio-02"."""
    powered: bool
    dip: int
    """The DIP switch as a number."""
    address: Optional[int]
    """The unit address in force: the DIP switch at the last power-on, or register UNIT of a board without a switch. None
    without power, and when the position is no address."""
    module: str
    """The module in the first slot."""
    configured: str
    """The module that the unit has stored for the first slot."""
    leds: Leds
    driver_enable: bool
    """The unit's RS-485 driver is on."""
    line: Line
    channels: Tuple[Channel, ...]
    """The four channels of the first slot: `channels[0]` is channel 1."""
    log_tail: Tuple[str, ...]
    """The last lines of the firmware's log."""
    slots: Tuple[Slot, ...] = ()
    """All slots of a board that has several; empty for a board with one."""
    terminals: Tuple[Terminal, ...] = ()
    """The terminals of a board with fixed inputs and outputs, in their order; empty for any other board."""
    radio: Optional[Radio] = None
    """The LoRa module; None if it is not fitted."""
    running_slot: Optional[str] = None
    """Slot of the flash whose image runs, "A" or "B". None without power, in the loader, and for an image that runs
    without a loader."""

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> State:
        """Returns a state from JSON."""
        return taken(State, {
            **data,
            "leds": taken(Leds, data["leds"]),
            "line": taken(Line, data["line"]),
            "channels": channels(data),
            "log_tail": tuple(data["log_tail"]),
            "slots": tuple(Slot.from_json(slot) for slot in data.get("slots", ())),
            "terminals": tuple(taken(Terminal, terminal) for terminal in data.get("terminals", ())),
            "radio": taken(Radio, data["radio"]) if "radio" in data else None,
        })

    def slot(self, port: int) -> Slot:
        """Returns the slot at a port of a board that has several. KeyError when there is none."""
        for slot in self.slots:
            if slot.port == port:
                return slot
        raise KeyError(f"the board has no slot at port {port}")

    def terminal(self, name: str) -> Terminal:
        """Returns the terminal with this name. KeyError when there is none."""
        for terminal in self.terminals:
            if terminal.name == name:
                return terminal
        raise KeyError(f"the board has no terminal {name}")


def channels(data: Mapping[str, Any]) -> Tuple[Channel, ...]:
    """Returns the channels of a state or a slot."""
    return tuple(taken(Channel, channel) for channel in data["channels"])


@dataclass(frozen=True)
class Frame:
    """A frame on the line."""

    number: int
    direction: str
    """Direction as the unit sees it: "rx" or "tx"."""
    start_us: int
    """Virtual time in microseconds."""
    end_us: int
    bytes: bytes
    summary: str
    """Meaning of the frame, in one line."""
    crc_ok: bool
    gap_us: Optional[int]
    """Silence before the frame. None for the first frame."""
    turnaround_us: Optional[int]
    """Of a reply: time from the end of the request to its start. None for any other frame."""
    silence_us: float
    """Longest silence between two characters of the frame."""
    damaged: bool
    """A character collided with another one, or was damaged."""

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Frame:
        """Returns a frame from JSON."""
        return taken(Frame, {**data, "bytes": bytes.fromhex(data["bytes"])})


@dataclass(frozen=True)
class Finding:
    """An action of the firmware that could fail on a real microcontroller."""

    at_us: int
    """Virtual time of the first time."""
    pc: str
    """Address of the instruction."""
    what: str
    count: int
    """Number of times that it happened."""


@dataclass(frozen=True)
class BoardInfo:
    """A board on the line."""

    name: str
    """Name for `Simulator.board`."""
    board: str
    """Such as "modio-02"."""
    dip: int
    address: Optional[int]
    """The unit address in force, as in `State`."""
    powered: bool
    fault: bool
    """The fault LED is lit."""
    modules: Tuple[str, ...]
    """The modules in the slots."""

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> BoardInfo:
        """Returns a board from JSON."""
        return taken(BoardInfo, {**data, "modules": tuple(data["modules"])})


@dataclass(frozen=True)
class Lost:
    """Events that were lost because they were not read in time."""

    count: int


class Faults(TypedDict, total=False):
    """Faults of the line, the air, the board or the chip, set on purpose. A missing member does not change its fault."""

    bit_error_rate: float
    drop_rate: float
    noise_hz: float
    radio_loss: float
    """Only if LoRa modules are fitted."""
    i2c_absent: bool
    hse_failed: bool
    hsi_percent: float
    lsi_khz: float


# The JSON of an answer.
Json = Dict[str, Any]
