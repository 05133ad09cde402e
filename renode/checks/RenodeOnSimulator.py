"""Implements the keywords of Renode that the suites use on the project's own simulator.

A suite that passes here asks and expects the right things of the image, on a machine without Renode. Tests
with the tag `renode-only` need Renode's models and are left out here. The keywords have the names and arguments of
Renode's sources, and a dry run checks the suites against them. What is received behaves as in Renode: see
terminal_tester.py. Time passes only in RunFor, as in Renode: the line is the simulator's exact line, whose protocol
docs/conformance.md describes.

The variables SIMULATOR and ELF name the simulator's program and the image.
"""

import json
import re
import socket
import subprocess
import threading
import time
import urllib.request

from robot.libraries.BuiltIn import BuiltIn

from terminal_tester import TerminalTester

ROBOT_LIBRARY_SCOPE = "GLOBAL"

# Lines of the slots by port: port and pin of the part.
LINES = {
    "modio-02": {5: ["A0", "A1", "A2", "A3"]},
    "modio-08": {
        1: ["A0", "A1", "A2", "A3"],
        2: ["A4", "A5", "A6", "A7"],
        3: ["C0", "C1", "C2", "C3"],
        4: ["B0", "B1", "C4", "C5"],
    },
}
# ADC channel of pin 0 of each port of the part.
ANALOG = {"A": 0, "B": 8, "C": 10}
# Output data registers.
OUTPUTS = {0x4001080C: "A", 0x40010C0C: "B", 0x4001100C: "C"}

# Addresses at which the suites read the log: a simulated RTT control block with the simulator's output.
_BLOCK = 0x20002000
_BUFFER = 0x20003000


class _Board:
    """The simulator with a board."""

    def __init__(self, program, board, elf, dip, modules):
        command = [program, "--board", board, "--elf", elf, "--dip", str(dip)]
        if "=" in modules:
            command += ["--module", "none"]
            command += [option for slot in modules.split(",") for option in ("--slot", slot)]
        else:
            command += ["--module", modules]
        self.lines = LINES[board]
        command += ["--exact-line", "127.0.0.1:0", "--http", "127.0.0.1:0"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        # Renode's keyword attaches the tester later; bytes received before that are lost there, too.
        self.tester = None
        self._endpoints = {}
        threading.Thread(target=self._read_output, daemon=True).start()
        self.api = self._endpoint("http").rstrip("/") + "/api/"
        host, port = self._endpoint("exact-line").rsplit(":", 1)
        self._line = socket.create_connection((host, int(port))).makefile("rw", newline="\n")
        self._now, _ = self._request("hello 1")

    def _read_output(self):
        for line in self.process.stdout:
            if endpoint := re.match(r"(exact-line|http): (.*)", line):
                self._endpoints[endpoint[1]] = endpoint[2]

    def _endpoint(self, name):
        """Returns the address at which the simulator listens, which it prints."""
        deadline = time.monotonic() + 60
        while name not in self._endpoints:
            if self.process.poll() is not None:
                raise AssertionError(f"the simulator has ended: {self.process.stderr.read()}")
            if time.monotonic() > deadline:
                raise AssertionError(f"the simulator opened no {name} in a minute")
            time.sleep(0.02)
        return self._endpoints[name]

    def _request(self, request):
        """Sends a request of the exact-line protocol. Returns the virtual time in microseconds, and the events."""
        self._line.write(request + "\n")
        self._line.flush()
        reply = self._line.readline().split()
        if not reply or reply[0] != "ok":
            raise AssertionError(f"{request}: {' '.join(reply) or 'the simulator has ended'}")
        return float(reply[1]), reply[2:]

    def get(self, path):
        return json.load(urllib.request.urlopen(self.api + path))

    def state(self):
        return self.get("state")

    def log(self):
        """Returns the last 50 lines of the firmware's log."""
        return "".join(line + "\n" for line in self.state()["log_tail"]).encode()

    def channels(self):
        """Returns the channels of every slot, by port."""
        state = self.state()
        if "slots" in state:
            return {slot["port"]: slot["channels"] for slot in state["slots"]}
        return {port: state["channels"] for port in self.lines}

    def post(self, path, **what):
        request = urllib.request.Request(self.api + path, json.dumps(what).encode(), method="POST")
        urllib.request.urlopen(request).read()

    def run_for(self, seconds, keys, delay):
        """Lets this time pass. The bytes `keys` are sent from its beginning; with a delay, each begins this many
        seconds after the one before."""
        end = self._now + seconds * 1e6
        if keys and not delay:
            self._pass("send " + keys.hex())
        for at, key in enumerate(keys if delay else b""):
            begin = end - seconds * 1e6 + at * delay * 1e6
            self._run_until(begin)
            self._pass(f"send {key:02x}")
        self._run_until(end)

    def _run_until(self, end):
        if end > self._now:
            self._pass(f"run {end - self._now:.3f}")

    def _pass(self, request):
        """Makes a request in which time passes, and hands the bytes that the unit sent to the tester."""
        self._now, events = self._request(request)
        for event in events:
            # The driver's events begin with other letters than a byte.
            if byte := re.match(r"([0-9A-F]{2})@", event):
                if self.tester:
                    self.tester.receive(int(byte[1], 16))

    def end(self):
        self._line.close()
        self.process.terminate()
        self.process.wait()


class RenodeOnSimulator:
    """The library. Arguments have the same types as in Renode's server."""

    ROBOT_LIBRARY_SCOPE = "GLOBAL"

    def __init__(self):
        self._board = None
        self._variables = {}
        self._delay = 0.0
        self._keys = bytearray()

    # Fixtures of renode-keywords.robot.

    def setup(self):
        """The suite's default setup."""

    def teardown(self):
        """The suite's default teardown."""
        self.reset_emulation()

    def test_teardown(self):
        """The tests' default teardown."""
        self.reset_emulation()

    def reset_emulation(self):
        if self._board:
            self._board.end()
        self._board = None
        self._variables = {}
        self._delay = 0.0
        self._keys.clear()

    # Keywords of Renode's server.

    def create_terminal_tester(self, uart, timeout: float = None, machine=None, endLineOption=None,
                               defaultPauseEmulation: bool = None, defaultWaitForEcho: bool = None,
                               defaultMatchNextLine: bool = None, binaryMode: bool = False):
        assert uart == "sysbus.usart1" and binaryMode
        self._board.tester = TerminalTester()

    def send_key_to_uart(self, c, testerId: int = None):
        self._keys.append(int(c, 0))

    def write_char_delay(self, delay: float, testerId: int = None):
        self._delay = delay

    def wait_for_bytes_on_uart(self, content, timeout: float = None, testerId: int = None,
                               treatAsRegex: bool = False, pauseEmulation: bool = None,
                               matchStart: bool = False):
        assert timeout == 0, "the suites advance the time with RunFor"
        self._board.tester.wait_for_bytes(content, treatAsRegex, matchStart)

    def execute_command(self, command, machine=None):
        for pattern, act in self._commands():
            if match := re.fullmatch(pattern, command):
                return act(*match.groups())
        raise AssertionError(f"unknown command: {command}")

    def _commands(self):
        number = r"(0x[0-9A-Fa-f]+|\d+)"
        return [
            (r'\$(\w+)="?([^"]*)"?', self._set),
            (r"include @.*/(modio-\d\d)-board\.resc", self._start),
            (r"emulation SetGlobalAdvanceImmediately true", lambda: ""),
            (r'emulation RunFor "([\d.]+)"', self._run_for),
            (r'sysbus GetSymbolAddress "_SEGGER_RTT"', lambda: f"{_BLOCK:#010X}\n"),
            (rf"sysbus ReadDoubleWord {number}", lambda at: f"{self._read(int(at, 0)):#010X}\n"),
            (rf"sysbus WriteDoubleWord {number} {number}", lambda at, to: self._write(int(at, 0), int(to, 0))),
            (r"sysbus\.gpioPort(A) OnGPIO ([0-3]) (true|false)", self._drive),
            (r"modio_input (\d) ([1-4]) (true|false)", self._drive_channel),
            (r"modio_inputs (\d+)", self._inputs),
            (r"sysbus\.sram ZeroAll", lambda: ""),
            (r"machine Reset", self._reset),
        ]

    def _set(self, name, value):
        self._variables[name] = value
        return ""

    def _start(self, board):
        program = BuiltIn().get_variable_value("${SIMULATOR}")
        elf = BuiltIn().get_variable_value("${ELF}")
        self._board = _Board(program, board, elf, self._variables["dip"], self._variables["module"])
        return ""

    def _run_for(self, seconds):
        # Bytes wait while the emulation does not run, and are then sent without gaps, as in Renode.
        keys = bytes(self._keys)
        self._keys.clear()
        self._board.run_for(float(seconds), keys, self._delay)
        return ""

    def _drive(self, port, pin, level):
        [(slot, channel)] = [place for place, line in self._lines() if line == port + pin]
        return self._drive_channel(slot, channel, level)

    def _drive_channel(self, slot, channel, level):
        kind = self._board.channels()[int(slot)][int(channel) - 1]["kind"]
        what = {"di": "energised", "relay": "manual"}[kind]
        self._board.post(f"slots/{slot}/channels/{channel}", **{what: level == "false"})
        return ""

    def _lines(self):
        """Yields every line: the slot's port and the channel, and the pin."""
        for slot, pins in self._board.lines.items():
            for channel, pin in enumerate(pins, start=1):
                yield (slot, channel), pin

    def _inputs(self, dip):
        self._board.post("dip", value=int(dip))
        return ""

    def _reset(self):
        # The macro `reset` of board.resc also drives the switch's position onto the pins again.
        self._inputs(self._variables["dip"])
        self._board.post("power", cycle=True)
        return ""

    def _read(self, address):
        if _BLOCK <= address < _BLOCK + 0x100:
            return {28: _BUFFER, 36: len(self._board.log())}[address - _BLOCK]
        if _BUFFER <= address < _BUFFER + 0x1000:
            at = address - _BUFFER
            return int.from_bytes(self._board.log()[at : at + 4].ljust(4, b"\0"), "little")
        if address in OUTPUTS:
            return self._outputs(OUTPUTS[address])
        slot, output = divmod(address - 0x40005500, 0x20)
        return self._board.channels()[min(self._board.lines) + slot][output // 4]["code"]

    def _outputs(self, port):
        leds = self._board.state()["leds"]
        levels = {"B8": leds["activity"], "B9": leds["fault"]}
        for slot, channels in self._board.channels().items():
            on = [channel.get("on", False) for channel in channels]
            # The coils of relays 1 and 2 are on lines 3 and 4.
            coils = [channel.get("energised", False) and channel["kind"] == "relay" for channel in channels[:2]]
            for pin, level in zip(self._board.lines[slot], [on[0], on[1], on[2] or coils[0], on[3] or coils[1]]):
                levels[pin] = level
        return sum(level << int(pin[1:]) for pin, level in levels.items() if pin[0] == port)

    def _write(self, address, value):
        if 0x40012500 <= address < 0x40012548:
            number = (address - 0x40012500) // 4
            [(slot, channel)] = [place for place, pin in self._lines() if ANALOG[pin[0]] + int(pin[1:]) == number]
            self._board.post(f"slots/{slot}/channels/{channel}", millivolts=round(value * 3300 / 4095))
        else:
            assert address == 0x400213F0, "only the flags of the next reset can be written"
        return ""
