"""pymodbus and mbpoll at the gateway radio: the unit over the air, while it is also served on its line."""

import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from pymodbus.client import ModbusSerialClient
from simulator import PATIENCE, Simulator

MBPOLL = shutil.which("mbpoll")
# Virtual milliseconds for the module's set-up.
SET_UP_MS = 2500


class OverTheAir(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.simulator = Simulator.of(module="4do", lora=Path(directory.name) / "gateway")
        cls.addClassCleanup(cls.simulator.end_well)
        cls.simulator.wait(SET_UP_MS)

    def setUp(self):
        self.line = self.simulator.master()
        self.addCleanup(self.line.close)
        self.radio = ModbusSerialClient(self.simulator.lora, baudrate=9600, timeout=PATIENCE, retries=0)
        self.assertTrue(self.radio.connect())
        self.addCleanup(self.radio.close)

    def good(self, answer):
        self.assertFalse(answer.isError(), answer)
        return answer

    def test_output_that_is_written_over_the_air_is_read_on_the_line(self):
        for on in (True, False):
            self.good(self.radio.write_coil(0x0011, on))
            self.assertEqual(self.good(self.line.read_coils(0x0011, count=1)).bits[0], on)
            self.simulator.wait(20)
            self.assertEqual(self.simulator.outputs()[1], on)

    def test_reply_of_several_packets_is_read(self):
        registers = self.good(self.radio.read_holding_registers(0x01C0, count=64)).registers
        self.assertEqual(len(registers), 64)
        self.assertEqual(registers, self.good(self.line.read_holding_registers(0x01C0, count=64)).registers)

    def test_exception_passes_the_air(self):
        self.assertEqual(self.radio.read_coils(0x0777, count=1).exception_code, 2)

    @unittest.skipUnless(MBPOLL, "mbpoll is not installed (Debian has it as a package)")
    def test_mbpoll_reads_over_the_air(self):
        self.radio.close()
        command = [MBPOLL, "-m", "rtu", "-b", "9600", "-P", "none", "-s", "1", "-0", "-1", "-a", "1", "-o", "10.00",
                   "-t", "0", "-r", "16", "-c", "4", self.simulator.lora]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=True)
        self.assertEqual(len(re.findall(r"^\[\d+\]:\s+[01]$", done.stdout, re.MULTILINE)), 4, done.stdout)
