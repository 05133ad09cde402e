"""Events of the simulator, as a stream."""

from __future__ import annotations

import json
from http.client import HTTPException
from typing import Callable, Dict, Iterator, List, Union

from .connection import Http
from .model import Frame, Lost, State

Event = Union[State, Frame, Lost]

# The type of each event. Other events, which a newer simulator may send, are ignored.
_KINDS: Dict[str, Callable[[str], Event]] = {
    "state": lambda data: State.from_json(json.loads(data)),
    "frame": lambda data: Frame.from_json(json.loads(data)),
    "lost": lambda data: Lost(int(data)),
}


class Events(Iterator[Event]):
    """An iterator over events: a `State` at the beginning and after each change (at most ten a
    second), a `Frame` for each frame on the line as it ends, `Lost` when events were not read in time.

    It ends when the simulator does. Close it, or use it in a `with` statement, when it is no longer needed."""

    def __init__(self, http: Http):
        self._http = http
        self._stream = http.open("GET", "/api/events")

    def __next__(self) -> Event:
        name = ""
        data: List[str] = []
        while True:
            line = self._line()
            field, _, value = line.partition(":")
            value = value[1:] if value.startswith(" ") else value
            if field == "event":
                name = value
            elif field == "data":
                data.append(value)
            elif not line:
                if name in _KINDS:
                    return _KINDS[name]("\n".join(data))
                name, data = "", []

    def _line(self) -> str:
        """Returns the next line of the stream. StopIteration at its end. Without events, a comment arrives every few
        seconds."""
        try:
            line = self._stream.readline()
        except (OSError, HTTPException) as error:
            raise self._http.unreachable(error) from error
        if not line:
            raise StopIteration
        return line.decode().rstrip("\r\n")

    def close(self) -> None:
        """Stops receiving events."""
        self._stream.close()

    def __enter__(self) -> Events:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
