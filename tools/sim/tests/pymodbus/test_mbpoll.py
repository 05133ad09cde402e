"""mbpoll, a second independent master, on libmodbus: each function that mbpoll has, on the line and over Modbus TCP."""

import re
import shutil
import subprocess
import unittest

from simulator import PATIENCE, OnSimulator

MBPOLL = shutil.which("mbpoll")
FIRST, KEY, LORA_ADDRESS = 0x0010, 0x0100, 0x0141
# mbpoll's codes for the tables: functions 01, 02, 04 and 03; 05 and 0F write coils, 06 and 10 registers.
COILS, DISCRETE_INPUTS, INPUT_REGISTERS, HOLDING_REGISTERS = "0", "1", "3", "4"
# Time in seconds that mbpoll waits for an answer: its maximum, and a time for several units, one of which answers.
ANSWER, SEVERAL = "10.00", "3.00"


@unittest.skipUnless(MBPOLL, "mbpoll is not installed (Debian has it as a package)")
class Mbpoll(OnSimulator):
    MODULE = "4do"

    def setUp(self):
        # mbpoll is the master on the line.
        pass

    def call(self, *arguments, unit="1", wait=ANSWER):
        """Sends a request once. Returns the output, and the reason if it failed."""
        command = [MBPOLL, "-m", "rtu", "-b", "9600", "-P", "none", "-s", "2", "-0", "-1", "-a", unit, "-o", wait]
        done = subprocess.run(
            [*command, *arguments], capture_output=True, text=True, timeout=PATIENCE, check=False)
        complaint = done.stderr.strip()
        self.assertEqual(done.returncode != 0, bool(complaint), done)
        return done.stdout, complaint.rpartition(": ")[2]

    def read(self, table, address, count=1):
        output, refusal = self.call("-t", table, "-r", str(address), "-c", str(count), self.simulator.pty)
        self.assertEqual(refusal, "")
        return [int(value) for value in re.findall(r"^\[\d+\]:\s+(-?\d+)", output, re.MULTILINE)]

    def write(self, table, address, *values):
        """Returns None, or the reason of a refusal."""
        output, refusal = self.call("-t", table, "-r", str(address), self.simulator.pty, *map(str, values))
        self.assertEqual(f"Written {len(values)} references." in output, not refusal, output)
        return refusal or None

    def test_outputs_are_written_together_and_one_by_one(self):
        self.assertIsNone(self.write(COILS, FIRST, 1, 0, 1, 1))
        self.assertIsNone(self.write(COILS, FIRST + 2, 0))
        for table in (COILS, DISCRETE_INPUTS):
            self.assertEqual(self.read(table, FIRST, 4), [1, 0, 0, 1])
        self.eventually(self.simulator.outputs, [True, False, False, True])

    def test_registers_are_written_and_exceptions_are_named(self):
        self.assertEqual(self.write(HOLDING_REGISTERS, LORA_ADDRESS, 1), "Slave device or server is busy")
        self.assertIsNone(self.write(HOLDING_REGISTERS, KEY, "0x5A17"))
        self.assertIsNone(self.write(HOLDING_REGISTERS, LORA_ADDRESS, 0x1234, 31))
        for table in (INPUT_REGISTERS, HOLDING_REGISTERS):
            self.assertEqual(self.read(table, LORA_ADDRESS, 2), [0x1234, 31])
        self.assertEqual(self.write(HOLDING_REGISTERS, LORA_ADDRESS + 1, 32), "Illegal data value")
        self.assertEqual(self.write(HOLDING_REGISTERS, 0x0400, 1), "Illegal data address")
        self.assertEqual(len(self.read(HOLDING_REGISTERS, 0x0160, 125)), 125)
        # A pair of registers as one number, high word first.
        output, _ = self.call("-B", "-t", "4:int", "-r", str(LORA_ADDRESS), self.simulator.pty)
        self.assertRegex(output, rf"\[{LORA_ADDRESS}\]:\s+{0x1234_001F}\n")

    def test_11_returns_identity_and_run_indicator(self):
        output, refusal = self.call("-u", self.simulator.pty)
        self.assertEqual(refusal, "")
        self.assertRegex(output, r"Length: 2\nId    : 0x01\nStatus: On\n")

    def test_polling_several_units_continues_after_a_missing_one(self):
        output, refusal = self.call(
            "-t", HOLDING_REGISTERS, "-r", "518", self.simulator.pty, unit="2,1,3", wait=SEVERAL)
        self.assertEqual(refusal, "Connection timed out")
        self.assertRegex(output, r"slave 2\.\.\.\n-- Polling slave 1\.\.\.\n\[518\]:\s+1\n")

    def test_modbus_tcp_reads_through_the_gateway(self):
        host, _, port = self.simulator.gateway.rpartition(":")
        done = subprocess.run(
            [MBPOLL, "-m", "tcp", "-p", port, "-a", "1", "-0", "-r", "0x200", "-c", "2", "-t", "4:hex",
             "-1", "-o", ANSWER, host], capture_output=True, text=True, timeout=PATIENCE, check=True)
        self.assertRegex(done.stdout, r"\[512\]:\s+0x2383\n\[513\]:\s+0x5860\n")
