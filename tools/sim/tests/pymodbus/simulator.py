"""A simulator with masters on its RS-485 line."""

import os
import time
import unittest

import modio_sim
import serial
from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

# Virtual time stays behind the wall clock where the machine is busy, so what the unit does, or does not
# do, is judged by virtual time, and the wall clock only says when the simulator is taken to be dead.

# Seconds of the wall clock for anything that has to happen.
PATIENCE = 60.0
# Virtual milliseconds after which no answer is taken to mean silence: many times t3.5 and the longest
# response.
SILENCE_MS = 500
# Seconds after which a master that gets no answer gives up, where it gets none.
GIVE_UP = 0.5


class Simulator(modio_sim.Simulator):
    """A simulator, and what masters do with it."""

    # What masters speak from now on.
    framer = FramerType.RTU

    @classmethod
    def of(cls, *, board: str = "modio-02", options=(), **more) -> "Simulator":
        """A simulator with the image for this board, which run.py names."""
        image = {"modio-02": "MODIO_ELF", "modio-08": "MODIO_ELF_08"}[board]
        return cls.start(board=board, elf=os.environ[image], options=options, **more)

    def end_well(self):
        """Ends it as Ctrl-C would. It must end without an error and must not have printed any complaint."""
        status = self.close()
        if status != 0 or self.complaints:
            raise AssertionError(f"exit status {status}, stderr {self.complaints}")

    @property
    def gateway(self) -> str:
        """Where masters with Modbus TCP find the line."""
        return self.endpoint("modbus-tcp")

    def outputs(self) -> list[bool]:
        """The four digital outputs, as they stand."""
        return [channel.on for channel in self.state().channels]

    def last_frame(self) -> int:
        """The number of the last frame, once the line has been silent for many times t3.5."""
        self.wait(60)
        return max((frame.number for frame in self.frames()), default=0)

    def answer_to(self, since: int) -> bytes:
        """What the unit answers to the first frame after number `since`; empty for silence."""
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
        """pymodbus on the line, which asks once. Without parity: a pseudo-terminal has none."""
        client = ModbusSerialClient(
            self.pty, framer=self.framer, baudrate=baudrate, stopbits=stopbits, timeout=timeout,
            retries=0)
        assert client.connect()
        return client

    def wire(self) -> serial.Serial:
        """The line for bytes of one's own."""
        return serial.Serial(self.pty, 9600, stopbits=2, timeout=PATIENCE)


class OnSimulator(unittest.TestCase):
    """Tests that share a simulator of their class."""

    DIP = 1
    MODULE = "4di"

    @classmethod
    def setUpClass(cls):
        cls.simulator = Simulator.of(
            dip=cls.DIP, module=cls.MODULE, options=["--modbus-tcp", "127.0.0.1:0"])
        # Cleanups run in reverse order, so this one is the last.
        cls.addClassCleanup(cls.simulator.end_well)

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
        end = self.simulator.state().virtual_ms + within_ms
        while (seen := what()) != wanted and self.simulator.state().virtual_ms < end:
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
        assert cls.simulator.state().line.baud == 115200
        cls.simulator.framer = FramerType.ASCII


def crc(frame: bytes) -> bytes:
    """A frame with its CRC (Modbus over Serial Line V1.02, 6.2.2)."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return frame + value.to_bytes(2, "little")
