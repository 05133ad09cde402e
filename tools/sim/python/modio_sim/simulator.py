"""A simulator, started or attached to."""

from __future__ import annotations

import os
from typing import List, Mapping, Optional, Sequence
from urllib.parse import quote

from .board import Board
from .errors import StartError
from .events import Events
from .connection import Http
from .process import Argument, Process
from .model import BoardInfo, Json, taken

# Seconds that an answer, a start or an end may take.
PATIENCE = 60.0


class Simulator(Board):
    """A simulator. It is a `Board` as well: the first one, which mostly is the only one.

    Make it with `start` or `attach`. In a `with` statement it is closed at the end."""

    def __init__(self, url: str, timeout: float = PATIENCE, process: Optional[Process] = None):
        super().__init__(Http(url, timeout), "/api")
        self._process = process

    @classmethod
    def start(
        cls, *, program: Optional[Argument] = None, elf: Optional[Argument] = None, board: Optional[str] = None,
        dip: Optional[int] = None, module: Optional[str] = None, slots: Optional[Mapping[int, str]] = None,
        flash: Optional[Argument] = None, pty: Optional[Argument] = None, tcp: Optional[str] = None,
        http: str = "127.0.0.1:0", options: Sequence[Argument] = (), timeout: float = PATIENCE,
    ) -> Simulator:
        """Starts a simulator and waits until it is ready. StartError, with what it says, when it does not start.

        `program` is the program; without it the one that the environment variable MODIO_SIM names, or `modio-sim` on
        the PATH. `elf` is the firmware image, which a program from a release has inside. `slots` says what is plugged
        into the slots at which ports, such as `{1: "4di", 3: "4do"}`. `options` are more options of the command line;
        the others have the names that they have there. The HTTP interface takes a free port of this computer. A request
        that is not answered in `timeout` seconds has failed."""
        command: List[Argument] = [program or os.environ.get("MODIO_SIM") or "modio-sim"]
        given = {"elf": elf, "board": board, "dip": dip, "module": module, "flash": flash, "pty": pty, "tcp": tcp,
                 "http": http}
        for name, value in given.items():
            if value is not None:
                command += [f"--{name}", value if isinstance(value, os.PathLike) else str(value)]
        for port, plugged in (slots or {}).items():
            command += ["--slot", f"{port}={plugged}"]
        process = Process([*command, *options])
        try:
            return cls(process.endpoint("http", timeout), timeout, process)
        except BaseException:
            process.end(timeout)
            raise

    @classmethod
    def attach(cls, url: str = "http://127.0.0.1:8502", *, timeout: float = PATIENCE) -> Simulator:
        """A simulator that runs already; UnreachableError when there is none at this address."""
        simulator = cls(url, timeout)
        simulator.boards()
        return simulator

    @property
    def url(self) -> str:
        """Where its HTTP interface and its page are."""
        return self._http.url

    @property
    def pty(self) -> Optional[str]:
        """The pseudo-terminal of the line, which a Modbus master opens as a serial port; None when there is none, or
        when this simulator was attached to."""
        return self.endpoint("pty") if self._process and self._process.has("pty") else None

    def endpoint(self, name: str) -> str:
        """Where an endpoint is that was asked for at the start, such as "tcp" or "gdb": what the simulator has printed.
        StartError when it has not."""
        if self._process is None:
            raise StartError("the endpoints of a simulator that was attached to are not known")
        return self._process.endpoint(name, self._http.timeout)

    @property
    def output(self) -> List[str]:
        """The lines that it has printed so far: its endpoints and the firmware's log. Empty when attached to."""
        return list(self._process.lines) if self._process else []

    @property
    def complaints(self) -> List[str]:
        """The lines that it has printed on its standard error so far. Empty when attached to."""
        return list(self._process.complaints) if self._process else []

    def boards(self) -> List[BoardInfo]:
        """The boards on the line, the first one first."""
        return [taken(BoardInfo, board) for board in self._get("boards")]

    def board(self, name: str) -> Board:
        """The board of this name."""
        return Board(self._http, f"{self._path}/boards/{quote(name, safe='')}")

    def events(self) -> Events:
        """What happens from now on, as an iterator; see `Events`."""
        return Events(self._http)

    def openapi(self) -> Json:
        """The description of its HTTP interface."""
        description: Json = self._get("openapi.json")
        return description

    def close(self) -> Optional[int]:
        """Ends the process, if this simulator was started here, as Ctrl-C does. Gives its exit status."""
        return self._process.end(self._http.timeout) if self._process else None

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
