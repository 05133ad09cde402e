"""The simulator as a child process."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import threading
import time
from typing import IO, Dict, List, Sequence, Union

from .errors import StartError

# Lines that announce an endpoint.
_ENDPOINT = re.compile(r"(pty|tcp|modbus-tcp|exact-line|http|gdb|lora): (\S+)")

Argument = Union[str, "os.PathLike[str]"]


class Process:
    """A running simulator and its output."""

    def __init__(self, command: Sequence[Argument]):
        self.lines: List[str] = []
        self.complaints: List[str] = []
        self._endpoints: Dict[str, str] = {}
        # On Windows only a process in its own group can receive Ctrl-Break.
        group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                encoding="utf-8", errors="replace", creationflags=group)
        except OSError as error:
            raise StartError(f"cannot run {os.fspath(command[0])}: {error.strerror}") from error
        self._readers = [
            threading.Thread(target=self._read, args=of, daemon=True)
            for of in ((self._process.stdout, self.lines), (self._process.stderr, self.complaints))]
        for reader in self._readers:
            reader.start()

    def _read(self, pipe: IO[str], lines: List[str]) -> None:
        for line in pipe:
            line = line.rstrip("\n")
            endpoint = _ENDPOINT.fullmatch(line)
            if endpoint and lines is self.lines:
                self._endpoints.setdefault(*endpoint.groups())
            lines.append(line)

    @property
    def status(self) -> Union[int, None]:
        """The exit status. None while the process runs."""
        return self._process.poll()

    def endpoint(self, name: str, timeout: float) -> str:
        """Waits for an endpoint and returns its address. StartError when the simulator does not announce it."""
        end = time.monotonic() + timeout
        while name not in self._endpoints:
            if self.status is not None:
                for reader in self._readers:
                    reader.join(timeout=10)
                raise StartError("; ".join(self.complaints) or f"the simulator ended with status {self.status}")
            if time.monotonic() > end:
                raise StartError(f"the simulator did not announce its endpoint {name} in {timeout:g} s")
            time.sleep(0.01)
        return self._endpoints[name]

    def has(self, name: str) -> bool:
        """Returns whether this endpoint has been announced."""
        return name in self._endpoints

    def end(self, timeout: float) -> int:
        """Ends the process as Ctrl-C does, so that it removes its links and keeps its flash file; by force when it
        has not ended within `timeout` seconds. Returns the exit status."""
        if self.status is None:
            self._process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM))
        try:
            status = self._process.wait(timeout=timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        for reader in self._readers:
            reader.join(timeout=10)
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        return status
