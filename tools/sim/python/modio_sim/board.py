"""One of the boards on the line."""

from __future__ import annotations

import time
from typing import Any, Callable, List, Optional
from urllib.parse import quote

from .connection import Http
from .model import Faults, Finding, Frame, Json, State, taken

# Interval in seconds at which a condition is checked.
_LOOK = 0.005


class Board:
    """A board: its state, and the operations on it.

    A method that changes the board returns the new state. Channels are numbered 1 to 4. With `port` a method
    applies to the slot at that port, without it to the board's first slot."""

    def __init__(self, http: Http, path: str):
        self._http = http
        self._path = path

    def state(self) -> State:
        """Returns the state of the board."""
        return State.from_json(self._get("state"))

    def frames(self, since: int = 0) -> List[Frame]:
        """Returns the last 1000 frames on the line, oldest first; only those with numbers above `since`."""
        since = _number("since", since)
        return [Frame.from_json(frame) for frame in self._get(f"frames?since={since}")["frames"]]

    def findings(self) -> List[Finding]:
        """Returns the actions of the firmware that could fail on a real microcontroller, oldest first."""
        return [taken(Finding, finding) for finding in self._get("findings")["findings"]]

    def set_channel(
        self, channel: int, *, energised: Optional[bool] = None, manual: Optional[bool] = None,
        millivolts: Optional[int] = None, port: Optional[int] = None,
    ) -> State:
        """Sets the outside of a channel. Exactly one value must be given: `energised`, the voltage at a
        digital input; `manual`, the jumper of a relay; `millivolts`, 0 to 3300 at the pin of an analog input."""
        given = {"energised": energised, "manual": manual, "millivolts": millivolts}
        body = {name: value for name, value in given.items() if value is not None}
        if len(body) != 1:
            raise ValueError("give one of energised, manual and millivolts")
        return self._post(f"{_slot(port)}channels/{_number('channel', channel)}", body)

    def set_terminal(
        self, name: str, *, energised: Optional[bool] = None, millivolts: Optional[int] = None,
        microamperes: Optional[int] = None, permille: Optional[int] = None, high: Optional[bool] = None,
        present: Optional[bool] = None,
    ) -> State:
        """Applies a value to a terminal of a board with fixed inputs and outputs, such as "X0". Exactly one value must
        be given, of the kind of the terminal, as in `Terminal`."""
        given = {"energised": energised, "millivolts": millivolts, "microamperes": microamperes, "permille": permille,
                 "high": high, "present": present}
        body = {key: value for key, value in given.items() if value is not None}
        if len(body) != 1:
            raise ValueError(f"give one of {', '.join(given)}")
        return self._post(f"terminals/{quote(name, safe='')}", body)

    def set_dip(self, value: int) -> State:
        """Moves the DIP switch; the firmware reads it at the next power-on."""
        return self._post("dip", {"value": value})

    def set_module(self, name: str, *, port: Optional[int] = None) -> State:
        """Plugs in another module, such as "4do" or "none". The power must be off."""
        return self._post(f"{_slot(port)}module", {"name": name})

    def power_on(self) -> State:
        """Switches the power on."""
        return self._post("power", {"on": True})

    def power_off(self) -> State:
        """Switches the power off immediately, at any state of the firmware."""
        return self._post("power", {"on": False})

    def power_cycle(self) -> State:
        """Switches the power off and on again."""
        return self._post("power", {"cycle": True})

    def request(self, pdu: bytes) -> bytes:
        """Sends a request to the unit, as another master on the line does, and returns the reply. Both are function code
        and data, without address and CRC. The reply may be an exception. RefusedError when the unit does not reply."""
        reply = self._http.ask("POST", f"{self._path}/pdu", {"pdu": pdu.hex()})
        return bytes.fromhex(reply["pdu"])

    def faults(self) -> Faults:
        """Returns the faults that are set."""
        faults: Faults = self._get("faults")
        return faults

    def set_faults(self, faults: Faults) -> Faults:
        """Sets the given faults, such as `{"drop_rate": 0.01}`, and does not change the others. Returns all faults
        that are then set."""
        self._http.ask("POST", f"{self._path}/faults", faults)
        return self.faults()

    def wait(self, milliseconds: int, *, timeout: float = 60.0) -> None:
        """Waits until this much of the board's virtual time has passed. TimeoutError when that takes more than
        `timeout` seconds."""
        end = self.state().virtual_ms + milliseconds
        what = f"{milliseconds} ms of virtual time did not pass in {timeout:g} s"
        self.wait_for(lambda: self.state().virtual_ms >= end, what=what, timeout=timeout)

    def wait_for(
        self, is_so: Callable[[], Any], *, what: str = "it did not become so", timeout: float = 60.0,
    ) -> None:
        """Waits until `is_so()` is true. TimeoutError, with the text `what`, when that takes more than `timeout`
        seconds."""
        end = time.monotonic() + timeout
        while not is_so():
            if time.monotonic() > end:
                raise TimeoutError(what)
            time.sleep(_LOOK)

    def _get(self, what: str) -> Any:
        return self._http.ask("GET", f"{self._path}/{what}")

    def _post(self, what: str, body: Json) -> State:
        return State.from_json(self._http.ask("POST", f"{self._path}/{what}", body))


def _slot(port: Optional[int]) -> str:
    """Returns the part of a path that names a slot."""
    return "" if port is None else f"slots/{_number('port', port)}/"


def _number(name: str, value: int) -> int:
    """Returns a number that becomes a part of a path. ValueError when it is no whole number, such as a text."""
    if type(value) is not int or value < 0:
        raise ValueError(f"{name} must be a whole number from 0, not {value!r}")
    return value
