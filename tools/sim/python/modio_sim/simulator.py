"""A simulator that was started here or attached to."""

from __future__ import annotations

import os
from typing import Dict, List, Mapping, Optional, Sequence
from urllib.parse import quote

from .board import Board
from .errors import RefusedError, StartError
from .events import Events
from .connection import Http
from .process import Argument, Process
from .model import BoardInfo, Json

# Longest time in seconds for an answer, a start or an end.
PATIENCE = 60.0


class Simulator(Board):
    """A simulator. It is also a `Board`: its first one, which is usually the only one.

    Create it with `start` or `attach`. In a `with` statement it is closed at the end."""

    def __init__(self, url: str, timeout: float = PATIENCE, process: Optional[Process] = None):
        super().__init__(Http(url, timeout), "/api")
        self._process = process
        self._has_lora = False

    @classmethod
    def start(
        cls, *, program: Optional[Argument] = None, elf: Optional[Argument] = None, board: Optional[str] = None,
        dip: Optional[int] = None, module: Optional[str] = None, slots: Optional[Mapping[int, str]] = None,
        flash: Optional[Argument] = None, pty: Optional[Argument] = None, tcp: Optional[str] = None,
        lora: Optional[Argument] = None,
        http: str = "127.0.0.1:0", options: Sequence[Argument] = (), timeout: float = PATIENCE,
    ) -> Simulator:
        """Starts a simulator and waits until it is ready. StartError, with its output, when it does not start.

        `program` is the program; the default is the environment variable MODIO_SIM, or `modio-sim` on
        the PATH. `elf` is the firmware image, which a program from a release contains. `slots` has the modules to plug
        in, by port, such as `{1: "4di", 3: "4do"}`. `options` are more options of the command line;
        the other parameters have the names of their options. The HTTP interface uses a free port of this computer. A
        request that gets no answer in `timeout` seconds fails."""
        command: List[Argument] = [program or os.environ.get("MODIO_SIM") or "modio-sim"]
        given = {"elf": elf, "board": board, "dip": dip, "module": module, "flash": flash, "pty": pty, "tcp": tcp,
                 "lora": lora, "http": http}
        for name, value in given.items():
            if value is not None:
                command += [f"--{name}", value if isinstance(value, os.PathLike) else str(value)]
        for port, plugged in (slots or {}).items():
            command += ["--slot", f"{port}={plugged}"]
        process = Process([*command, *options])
        try:
            simulator = cls(process.endpoint("http", timeout), timeout, process)
        except BaseException:
            process.end(timeout)
            raise
        simulator._has_lora = lora is not None
        return simulator

    @classmethod
    def attach(cls, url: str = "http://127.0.0.1:8502", *, timeout: float = PATIENCE) -> Simulator:
        """Attaches to a running simulator. UnreachableError when there is none at this address."""
        simulator = cls(url, timeout)
        simulator.boards()
        return simulator

    @property
    def url(self) -> str:
        """Address of the HTTP interface and of the page."""
        return self._http.url

    @property
    def pty(self) -> Optional[str]:
        """The pseudo-terminal of the line, which a Modbus master opens as a serial port. None when there is none, or
        when this simulator was attached to."""
        return self.endpoint("pty") if self._process and self._process.has("pty") else None

    @property
    def lora(self) -> Optional[str]:
        """The pseudo-terminal of the gateway radio. None when `start` was called without
        `lora`."""
        return self.endpoint("lora") if self._has_lora else None

    def endpoint(self, name: str) -> str:
        """Returns the address of an endpoint that was requested at the start, such as "tcp" or "gdb", as
        the simulator has printed it. StartError when it has not."""
        if self._process is None:
            raise StartError("the endpoints of a simulator that was attached to are not known")
        return self._process.endpoint(name, self._http.timeout)

    @property
    def output(self) -> List[str]:
        """The lines that the simulator has printed: its endpoints and the firmware's log. Empty when attached to."""
        return list(self._process.lines) if self._process else []

    @property
    def complaints(self) -> List[str]:
        """The lines that the simulator has printed on stderr so far. Empty when attached to."""
        return list(self._process.complaints) if self._process else []

    def boards(self) -> List[BoardInfo]:
        """Returns the boards on the line, in their order there."""
        return [BoardInfo.from_json(board) for board in self._get("boards")]

    def endpoints(self) -> Dict[str, str]:
        """Returns the addresses of all endpoints by name, also of a simulator that was attached to."""
        endpoints: Dict[str, str] = self._get("endpoints")
        return endpoints

    def board(self, name: str) -> Board:
        """Returns the board with this name. RefusedError when there is none."""
        names = [board.name for board in self.boards()]
        if name not in names:
            raise RefusedError(404, f"there is no board {name!r}; the boards are {', '.join(names)}")
        return Board(self._http, f"{self._path}/boards/{quote(name, safe='')}")

    def events(self) -> Events:
        """Returns the events from now on, as an iterator; see `Events`."""
        return Events(self._http)

    def openapi(self) -> Json:
        """Returns the description of the HTTP interface."""
        description: Json = self._get("openapi.json")
        return description

    def close(self) -> Optional[int]:
        """Ends the process as Ctrl-C does, if the simulator was started here. Returns its exit status."""
        return self._process.end(self._http.timeout) if self._process else None

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
