"""A shell in which the commands of a page run as a reader types them, on simulated boards."""

import os
import pathlib
import re
import shlex
import signal
import subprocess
import sys
import time

import pages
from simulator import IMAGES

# Seconds of the wall clock within which a command must end, or a simulator be ready.
PATIENCE = 120
# What a page says for a path or a port of the reader's computer.
TEMPORARY = "/tmp/"
SERIAL_PORT = "/dev/ttyUSB0"
HTTP = "127.0.0.1:8502"

# A busy machine may not give the simulator the 0.3 s within which function 70 must be answered.
MODIOCTL = """#!/bin/sh
case "$*" in *"scan --fast"* | *events*) set -- --timeout 5s "$@" ;; esac
exec {modioctl} "$@"
"""
CARGO = """#!/bin/sh
case "$*" in
"xtask sim "*)
    shift 2
    case "$*" in *--http*) ;; *) set -- --http 127.0.0.1:0 "$@" ;; esac
    exec {simulator} "$@" ;;
"run --quiet -p modioctl -- "*)
    shift 5
    exec modioctl "$@" ;;
esac
echo "the test runs no cargo $*"
exit 1
"""


class Terminal:
    """A bash in a session of its own, with one directory as its /tmp and as its home."""

    def __init__(self, directory: pathlib.Path):
        self.directory = directory
        self.http = HTTP
        self.background = 0
        programs = directory / "programs"
        programs.mkdir()
        simulator = [os.environ["MODIO_SIM"]]
        # Of the boards whose images the step has built.
        for name in (name for name in os.environ if name.startswith(IMAGES)):
            board = name.removeprefix(IMAGES).lower().replace("_", "-")
            simulator += ["--loader", f"{board}={os.environ[name]}/loader"]
            simulator += ["--image", f"{board}={os.environ[name]}/modio-a.image"]
        texts = {
            "cargo": CARGO.format(simulator=shlex.join(simulator)),
            "modioctl": MODIOCTL.format(modioctl=shlex.quote(os.environ["MODIOCTL"])),
        }
        for name, text in texts.items():
            (programs / name).write_text(text)
            (programs / name).chmod(0o755)
        # The environment of this test, which has pymodbus.
        (directory / "pymodbus").symlink_to(sys.prefix)
        environment = {name: value for name, value in os.environ.items() if not name.startswith("MODIO")}
        environment |= {"HOME": str(directory), "PATH": f"{programs}:{environment['PATH']}"}
        self.bash = subprocess.Popen(
            ["bash"], cwd=directory, stdin=subprocess.PIPE, stdout=(directory / "output").open("wb"),
            stderr=subprocess.STDOUT, start_new_session=True, env=environment)
        # Numbers of jobs as in a shell that somebody uses.
        self.run("set -m")

    def here(self, text: str) -> str:
        """Returns a command of a page with the paths and ports of this test."""
        places = {SERIAL_PORT: f"{self.directory}/serial-port", HTTP: self.http, TEMPORARY: f"{self.directory}/"}
        return re.sub("|".join(places), lambda place: places[place[0]], text)

    def there(self, text: str) -> str:
        """Returns an output with the paths and ports of the pages."""
        text = text.replace(f"{self.directory}/serial-port", SERIAL_PORT)
        text = text.replace(f"{self.directory}/", TEMPORARY)
        return text if self.http == HTTP else text.replace(self.http, HTTP)

    def run(self, command: str) -> tuple[int, str]:
        """Runs a command of a page. Returns its exit status and what it printed."""
        result = self.run_here(self.here(command))
        if job := re.match(r"kill (%\d)", command):
            # The number is free again when the job has ended.
            self.run_here(f"wait {job[1]}")
        return result

    def run_here(self, command: str) -> tuple[int, str]:
        """Runs a command with the paths and ports of this test."""
        output = self.directory / "output"
        begin = output.stat().st_size
        # Nothing to read for the command, and a line that shows its end.
        self.bash.stdin.write(f"{{ {command}\n}} </dev/null\necho \" ended $?\"\n".encode())
        self.bash.stdin.flush()
        limit = time.monotonic() + PATIENCE
        while True:
            printed = output.read_bytes()[begin:].decode(errors="replace")
            if ended := re.search(r" ended (\d+)\n\Z", printed):
                return int(ended[1]), self.there(printed[:ended.start()])
            if self.bash.poll() is not None or time.monotonic() > limit:
                raise AssertionError(f"`{command}` does not end. It has printed:\n{printed}")
            time.sleep(0.02)

    def start(self, command: str, shown: list[str]) -> tuple[int, str]:
        """Runs a command that ends with &, until it has printed what the page shows."""
        self.background += 1
        output = self.directory / f"background-{self.background}"
        output.touch()
        status, _ = self.run_here(re.sub(r"&\s*(#.*)?$", f"> {output} 2>&1 &", self.here(command)))
        limit = time.monotonic() + PATIENCE
        while True:
            printed = output.read_text(errors="replace")
            if "--http" not in command and (address := re.search(r"^http: http://(.*)/$", printed, re.MULTILINE)):
                self.http = address[1]
            printed = self.there(printed)
            if not pages.difference(shown, printed) or time.monotonic() > limit:
                return status, printed
            time.sleep(0.02)

    def connect(self, options: str):
        """Starts a simulator with these options as the hardware of the reader, in place of the one before."""
        self.run_here('[ -z "$hardware" ] || { kill "$hardware"; wait "$hardware"; }')
        ready = ["...", f"http: http://{HTTP}/", "..."]
        _, printed = self.start(f"cargo xtask sim {options} &", ready)
        if wrong := pages.difference(ready, printed):
            raise AssertionError(f"no hardware {options}: {wrong}")
        self.run_here("hardware=$!")

    def close(self):
        """Ends all processes of the session."""
        for directory in pathlib.Path("/proc").iterdir():
            try:
                if directory.name.isdigit() and os.getsid(int(directory.name)) == self.bash.pid:
                    os.kill(int(directory.name), signal.SIGKILL)
            except ProcessLookupError:
                pass
        self.bash.wait()
