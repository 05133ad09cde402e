"""A simulator with masters on its RS-485 line."""

import os
import pathlib
import time
import unittest

import modio_sim
import serial
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

# Virtual time falls behind the wall clock on a busy machine. So the tests measure what the unit does in virtual
# time, and use the wall clock only to detect that the simulator has stopped.

# Seconds of the wall clock within which anything expected must happen.
PATIENCE = 60.0
# Virtual milliseconds after which the unit counts as silent: many times t3.5 and the longest response time.
SILENCE_MS = 500
# Seconds after which a master without a reply gives up, in tests that expect no reply.
GIVE_UP = 0.5
# The beginning of the variables that name the images of a board.
IMAGES = "MODIO_IMAGES_"
# The beginning of a warning of the simulator that says nothing about the unit.
TOO_SLOW = "modio-sim: warning: this computer has run the boards at"


def images(board: str = "modio-02") -> pathlib.Path:
    """Returns the directory with the loader and the images of a board. `cargo xtask test` sets the variables."""
    return pathlib.Path(os.environ[IMAGES + board.upper().replace("-", "_")])


def firmware(board: str = "modio-02") -> list[str]:
    """Returns the options with which a simulator runs the loader and the image of a board."""
    return ["--loader", str(images(board) / "loader"), "--image", str(images(board) / "modio-a.image")]


class Simulator(modio_sim.Simulator):
    """A simulator, and the operations of masters on its line."""

    # The framing that masters use from now on.
    framer = FramerType.RTU

    @classmethod
    def of(cls, *, board: str = "modio-02", options=(), **more) -> "Simulator":
        """Starts a simulator with the loader and the image of this board."""
        return cls.start(board=board, options=[*firmware(board), *options], **more)

    def end_well(self):
        """Ends the simulator as Ctrl-C does. It must end without an error, and without any output on stderr but the warning
        that this computer is too slow, which is no fault of the simulator."""
        status = self.close()
        complaints = [line for line in self.complaints if not line.startswith(TOO_SLOW)]
        if status != 0 or complaints:
            raise AssertionError(f"exit status {status}, stderr {complaints}")

    @property
    def gateway(self) -> str:
        """Address of the line for masters with Modbus TCP."""
        return self.endpoint("modbus-tcp")

    def outputs(self) -> list[bool]:
        """States of the four digital outputs."""
        return [channel.on for channel in self.state().channels]

    def last_frame(self) -> int:
        """Waits until the line has been silent for many times t3.5 and returns the number of the last frame."""
        self.wait(60)
        return max((frame.number for frame in self.frames()), default=0)

    def answer_to(self, since: int) -> bytes:
        """Returns the unit's answer to the first frame after number `since`; empty if there is none."""
        requests = lambda: [f for f in self.frames(since) if f.direction == "rx"]
        self.wait_for(requests, what="there is no request")
        request = requests()[0]
        over = lambda: self.state().virtual_ms * 1000 >= request.end_us + SILENCE_MS * 1000
        answers = lambda: [f for f in self.frames(request.number) if f.direction == "tx"]
        self.wait_for(lambda: over() or answers(), what="there is neither an answer nor silence")
        answer = answers()
        return answer[0].bytes if answer else b""

    def master(self, timeout: float = PATIENCE, baudrate: int = 9600,
               stopbits: int = 2) -> ModbusSerialClient:
        """Returns pymodbus on the line, with one attempt per request. Without parity: a pseudo-terminal has none."""
        client = ModbusSerialClient(
            self.pty, framer=self.framer, baudrate=baudrate, stopbits=stopbits, timeout=timeout,
            retries=0)
        assert client.connect()
        return client

    def wire(self) -> serial.Serial:
        """Opens the line for a test that sends its own bytes."""
        return serial.Serial(self.pty, 9600, stopbits=2, timeout=PATIENCE)


class OnSimulator(unittest.TestCase):
    """Tests that share the simulator of their class."""

    MODULE = "4di"

    @classmethod
    def setUpClass(cls):
        cls.simulator = Simulator.of(module=cls.MODULE, options=["--modbus-tcp", "127.0.0.1:0"])
        # Cleanups run in reverse order, so this one is the last.
        cls.addClassCleanup(cls.simulator.end_well)

    def setUp(self):
        self.master = self.simulator.master()
        self.addCleanup(self.master.close)

    def silent(self, ask):
        """Asserts that `ask(master)` gets no answer."""
        # pymodbus must be the only user of the port.
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
        """Waits until `what()` returns `wanted`, which takes time: an input is debounced, an output is scanned."""
        end = self.simulator.state().virtual_ms + within_ms
        while (seen := what()) != wanted and self.simulator.state().virtual_ms < end:
            time.sleep(0.005)
        self.assertEqual(seen, wanted)


def crc(frame: bytes) -> bytes:
    """Returns a frame with its CRC (Modbus over Serial Line V1.02, 6.2.2)."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return frame + value.to_bytes(2, "little")
