"""One of the boards on the line."""

from __future__ import annotations

import time
from typing import Any, Callable, List, Optional

from .connection import Http
from .model import Faults, Finding, Frame, Json, State, taken

# How often it is looked whether something is so, in seconds.
_LOOK = 0.005


class Board:
    """What can be seen of a board and done to it.

    A method that changes something gives the state after it. Channels are numbered 1 to 4. With `port` a method
    means the slot at that port, without it the board's first one."""

    def __init__(self, http: Http, path: str):
        self._http = http
        self._path = path

    def state(self) -> State:
        """All that can be seen of the board."""
        return State.from_json(self._get("state"))

    def frames(self, since: int = 0) -> List[Frame]:
        """The last 1000 frames on the line, oldest first; only those with numbers above `since`."""
        return [Frame.from_json(frame) for frame in self._get(f"frames?since={since}")["frames"]]

    def findings(self) -> List[Finding]:
        """What the firmware has done that a real microcontroller would not take well, oldest first."""
        return [taken(Finding, finding) for finding in self._get("findings")["findings"]]

    def set_channel(
        self, channel: int, *, energised: Optional[bool] = None, manual: Optional[bool] = None,
        millivolts: Optional[int] = None, port: Optional[int] = None,
    ) -> State:
        """Sets what the outside world applies to a channel, of which one is given: `energised`, the voltage at a
        digital input; `manual`, the jumper of a relay; `millivolts`, 0 to 3300 at the pin of an analog input."""
        given = {"energised": energised, "manual": manual, "millivolts": millivolts}
        body = {name: value for name, value in given.items() if value is not None}
        if len(body) != 1:
            raise ValueError("give one of energised, manual and millivolts")
        return self._post(f"{_slot(port)}channels/{channel}", body)

    def set_dip(self, value: int) -> State:
        """Moves the DIP switch; the firmware reads it at the next power-on."""
        return self._post("dip", {"value": value})

    def set_module(self, name: str, *, port: Optional[int] = None) -> State:
        """Plugs another module, such as "4do" or "none"; the power must be off."""
        return self._post(f"{_slot(port)}module", {"name": name})

    def power_on(self) -> State:
        """Switches the power on."""
        return self._post("power", {"on": True})

    def power_off(self) -> State:
        """Switches the power off at this instant, whatever the firmware is doing."""
        return self._post("power", {"on": False})

    def power_cycle(self) -> State:
        """Switches the power off and on again."""
        return self._post("power", {"cycle": True})

    def faults(self) -> Faults:
        """The faults that are set."""
        faults: Faults = self._get("faults")
        return faults

    def set_faults(self, faults: Faults) -> Faults:
        """Sets the faults that are given, such as `{"drop_rate": 0.01}`, and leaves the others as they are. Gives all
        that are set then."""
        self._http.ask("POST", f"{self._path}/faults", faults)
        return self.faults()

    def wait(self, milliseconds: int, *, timeout: float = 60.0) -> None:
        """Lets so much of the board's own, virtual time pass; TimeoutError when it does not within `timeout` seconds."""
        end = self.state().virtual_ms + milliseconds
        what = f"{milliseconds} ms of virtual time did not pass in {timeout:g} s"
        self.wait_for(lambda: self.state().virtual_ms >= end, what=what, timeout=timeout)

    def wait_for(
        self, is_so: Callable[[], Any], *, what: str = "it did not become so", timeout: float = 60.0,
    ) -> None:
        """Waits until `is_so()` is true; TimeoutError, which says `what`, when it is not within `timeout` seconds."""
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
    """The part of a path that names a slot."""
    return "" if port is None else f"slots/{port}/"
