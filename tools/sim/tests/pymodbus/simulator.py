"""The simulator as a child process, and masters on its RS-485 line."""

import json
import pathlib
import subprocess
import tempfile
import threading
import time
import unittest
import urllib.error
import urllib.request

import serial
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

# Set by run.py.
PROGRAM: pathlib.Path
IMAGE: pathlib.Path

# Virtual time stays behind the wall clock where the machine is busy, so what the unit does, or does not
# do, is judged by virtual time, and the wall clock only says when the simulator is taken to be dead.

# Seconds of the wall clock for anything that has to happen.
PATIENCE = 60.0
# Virtual milliseconds after which no answer is taken to mean silence: many times t3.5 and the longest
# response.
SILENCE_MS = 500
# Seconds after which a master that gets no answer gives up, where it gets none.
GIVE_UP = 0.5


class Simulator:
    """A running modio-sim, with `--pty` and an HTTP port of its own."""

    def __init__(self, *, dip: int = 1, module: str = "4di"):
        # What masters speak from now on.
        self.framer = FramerType.RTU
        self._directory = tempfile.TemporaryDirectory(prefix="modio-")
        self.port = str(pathlib.Path(self._directory.name, "line"))
        self._process = subprocess.Popen(
            [PROGRAM, "--elf", IMAGE, "--dip", str(dip), "--module", module,
             "--pty", self.port, "--http", "127.0.0.1:0"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines: list[str] = []
        self.complaints: list[str] = []
        self._readers = [
            threading.Thread(target=self._read, args=(pipe, lines), daemon=True)
            for pipe, lines in ((self._process.stdout, self.lines),
                                (self._process.stderr, self.complaints))]
        for reader in self._readers:
            reader.start()
        try:
            self.url = self._endpoint("http: ").rstrip("/")
        except BaseException:
            self.stop()
            raise

    @staticmethod
    def _read(pipe, lines):
        for line in pipe:
            lines.append(line.rstrip("\n"))

    def _endpoint(self, prefix: str) -> str:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and self._process.poll() is None:
            for line in list(self.lines):
                if line.startswith(prefix):
                    return line.removeprefix(prefix)
            time.sleep(0.01)
        raise RuntimeError(f"the simulator did not start: {self.complaints or self.lines}")

    def stop(self) -> int:
        """Ends it as Ctrl-C would; the exit status."""
        if self._process.poll() is None:
            self._process.terminate()
        try:
            status = self._process.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        for reader in self._readers:
            reader.join(timeout=10)
        self._process.stdout.close()
        self._process.stderr.close()
        self._directory.cleanup()
        return status

    def http(self, method: str, path: str, body=None) -> tuple[int, dict]:
        """Status and JSON of a request."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data=data, method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as refusal:
            with refusal:
                return refusal.code, json.load(refusal)

    def state(self) -> dict:
        """GET /api/state."""
        status, state = self.http("GET", "/api/state")
        assert status == 200, state
        return state

    def post(self, path: str, body) -> dict:
        """A POST that is accepted."""
        status, answer = self.http("POST", path, body)
        assert status == 200, answer
        return answer

    def outputs(self) -> list[bool]:
        """The four digital outputs, as they stand."""
        return [channel["on"] for channel in self.state()["channels"]]

    def until(self, is_so, what: str):
        """Waits until something is so."""
        end = time.monotonic() + PATIENCE
        while not is_so():
            if time.monotonic() > end:
                raise AssertionError(f"{what} did not happen in {PATIENCE} s")
            time.sleep(0.005)

    def virtual_ms(self) -> int:
        """The unit's time."""
        return self.state()["virtual_ms"]

    def wait(self, milliseconds: int):
        """Lets so much of the unit's time pass."""
        end = self.virtual_ms() + milliseconds
        self.until(lambda: self.virtual_ms() >= end, f"{milliseconds} ms of virtual time")

    def frames(self, since: int = 0) -> list[dict]:
        """The complete frames on the line with numbers above `since`."""
        status, answer = self.http("GET", f"/api/frames?since={since}")
        assert status == 200, answer
        return answer["frames"]

    def last_frame(self) -> int:
        """The number of the last frame, once the line has been silent for many times t3.5."""
        self.wait(60)
        return max((frame["number"] for frame in self.frames()), default=0)

    def answer_to(self, since: int) -> bytes:
        """What the unit answers to the first frame after number `since`; empty for silence."""
        requests = lambda: [f for f in self.frames(since) if f["direction"] == "rx"]
        self.until(requests, "the request")
        request = requests()[0]
        over = lambda: self.virtual_ms() * 1000 >= request["end_us"] + SILENCE_MS * 1000
        answers = lambda: [f for f in self.frames(request["number"]) if f["direction"] == "tx"]
        self.until(lambda: over() or answers(), "an answer, or silence")
        answer = answers()
        return bytes.fromhex(answer[0]["bytes"]) if answer else b""

    def master(self, timeout: float = PATIENCE, baudrate: int = 9600,
               stopbits: int = 2) -> ModbusSerialClient:
        """pymodbus on the line, which asks once. Without parity: a pseudo-terminal has none."""
        client = ModbusSerialClient(
            self.port, framer=self.framer, baudrate=baudrate, stopbits=stopbits, timeout=timeout,
            retries=0)
        assert client.connect()
        return client

    def wire(self) -> serial.Serial:
        """The line for bytes of one's own."""
        return serial.Serial(self.port, 9600, stopbits=2, timeout=PATIENCE)


class OnSimulator(unittest.TestCase):
    """Tests that share a simulator of their class."""

    DIP = 1
    MODULE = "4di"

    @classmethod
    def setUpClass(cls):
        cls.simulator = Simulator(dip=cls.DIP, module=cls.MODULE)
        # First in, last out: nothing may be complained of, and Ctrl-C must end it well.
        cls.addClassCleanup(cls._end)

    @classmethod
    def _end(cls):
        status = cls.simulator.stop()
        if status != 0 or cls.simulator.complaints:
            raise AssertionError(f"exit status {status}, stderr {cls.simulator.complaints}")

    def setUp(self):
        self.master = self.simulator.master()
        self.addCleanup(self.master.close)

    def bits(self, answer, count: int) -> list[bool]:
        """The bits of a good answer."""
        self.assertFalse(answer.isError(), answer)
        return answer.bits[:count]

    def refused(self, answer, code: int):
        """An exception response with this code."""
        self.assertTrue(answer.isError(), answer)
        self.assertEqual(answer.exception_code, code, answer)

    def silent(self, ask):
        """`ask(master)` gets no answer."""
        # pymodbus wants the port for itself.
        self.master.close()
        master = self.simulator.master(timeout=GIVE_UP)
        try:
            before = self.simulator.last_frame()
            with self.assertRaises(ModbusIOException):
                ask(master)
            self.assertEqual(self.simulator.answer_to(before), b"")
        finally:
            master.close()
            assert self.master.connect()

    def eventually(self, what, wanted, within_ms: int = 1000):
        """`what()` becomes `wanted` within a second: an input is debounced, an output is scanned."""
        end = self.simulator.virtual_ms() + within_ms
        while (seen := what()) != wanted and self.simulator.virtual_ms() < end:
            time.sleep(0.005)
        self.assertEqual(seen, wanted)


class AsciiLine:
    """Put before a class of tests: the same in ASCII mode, at 115200 bit/s."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        master = cls.simulator.master()
        # KEY; BAUD; MODE; COMMAND: save, restart.
        for address, value in ((0x0100, 0x5A17), (0x0101, 1152), (0x0103, 1), (0x0108, 1), (0x0108, 2)):
            answer = master.write_register(address, value)
            assert not answer.isError(), answer
        master.close()
        cls.simulator.wait(300)
        assert cls.simulator.state()["line"]["baud"] == 115200
        cls.simulator.framer = FramerType.ASCII


def crc(frame: bytes) -> bytes:
    """A frame with its CRC (Modbus over Serial Line V1.02, 6.2.2)."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return frame + value.to_bytes(2, "little")
