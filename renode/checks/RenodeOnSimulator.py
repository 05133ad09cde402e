"""Implements the keywords of Renode that the suites use on the project's own simulator.

A suite that passes here asks and expects the right things of the image, on a machine without Renode. Tests
with the tag `renode-only` need Renode's models, and tests with the tag `exact-time` need gaps that are exact
to a millisecond; both are left out here. The keywords have the names and arguments of Renode's sources, and
a dry run checks the suites against them. What is received behaves as in Renode: see terminal_tester.py.

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
        command += ["--tcp", "127.0.0.1:0", "--http", "127.0.0.1:0"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.log = []
        # Renode's keyword attaches the tester later; bytes received before that are lost there, too.
        self.tester = None
        self.lock = threading.Lock()
        self.received = self.sent = self.last_frame = 0
        self._endpoints = {}
        threading.Thread(target=self._read_log, daemon=True).start()
        self.api = self._endpoint("http").rstrip("/") + "/api/"
        host, port = self._endpoint("tcp").rsplit(":", 1)
        self.line = socket.create_connection((host, int(port)))
        self.line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=self._read_line, daemon=True).start()

    def _read_log(self):
        for line in self.process.stdout:
            endpoint = re.match(r"(pty|http|tcp|gdb): (.*)", line)
            if endpoint:
                self._endpoints[endpoint[1]] = endpoint[2]
            else:
                self.log.append(line)

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

    def _read_line(self):
        try:
            while data := self.line.recv(4096):
                with self.lock:
                    self.received += len(data)
                    for byte in data if self.tester else b"":
                        self.tester.receive(byte)
        except OSError:
            pass

    def get(self, path):
        return json.load(urllib.request.urlopen(self.api + path))

    def state(self):
        return self.get("state")

    def channels(self):
        """Returns the channels of every slot, by port."""
        state = self.state()
        if "slots" in state:
            return {slot["port"]: slot["channels"] for slot in state["slots"]}
        return {port: state["channels"] for port in self.lines}

    def post(self, path, **what):
        request = urllib.request.Request(self.api + path, json.dumps(what).encode(), method="POST")
        urllib.request.urlopen(request).read()

    def run_for(self, seconds):
        end = self.state()["virtual_ms"] + seconds * 1000
        while (left := end - self.state()["virtual_ms"]) > 0:
            time.sleep(max(left / 1000, 0.001))
        self._wait_for_sent_frames()

    def _wait_for_sent_frames(self):
        """Waits until the frames that the unit has sent were received over the socket. This takes long on a busy
        machine."""
        for frame in self.get(f"frames?since={self.last_frame}")["frames"]:
            self.last_frame = frame["number"]
            self.sent += len(frame["bytes"]) // 2 if frame["direction"] == "tx" else 0
        deadline = time.monotonic() + 10
        while self.received < self.sent and time.monotonic() < deadline:
            time.sleep(0.001)

    def end(self):
        self.line.close()
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
        with self._board.lock:
            self._board.tester = TerminalTester()

    def send_key_to_uart(self, c, testerId: int = None):
        self._keys.append(int(c, 0))

    def write_char_delay(self, delay: float, testerId: int = None):
        self._delay = delay

    def wait_for_bytes_on_uart(self, content, timeout: float = None, testerId: int = None,
                               treatAsRegex: bool = False, pauseEmulation: bool = None,
                               matchStart: bool = False):
        assert timeout == 0, "the suites advance the time with RunFor"
        with self._board.lock:
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
        # All bytes are sent together without gaps, as in Renode while the emulation does not run.
        step = 1 if self._delay else len(self._keys) or 1
        for at in range(0, len(self._keys), step):
            time.sleep(self._delay)
            self._board.line.sendall(self._keys[at : at + step])
        self._keys.clear()
        self._board.run_for(float(seconds))
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
            length = len("".join(self._board.log).encode())
            return {28: _BUFFER, 36: length}[address - _BLOCK]
        if _BUFFER <= address < _BUFFER + 0x1000:
            at = address - _BUFFER
            text = "".join(self._board.log).encode()[at : at + 4]
            return int.from_bytes(text.ljust(4, b"\0"), "little")
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
