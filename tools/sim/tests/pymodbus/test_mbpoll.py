"""mbpoll, a second independent master, on libmodbus: a module of each kind with every function that mbpoll has."""

import re
import shutil
import subprocess
import unittest

from simulator import PATIENCE, OnSimulator

MBPOLL = shutil.which("mbpoll")
FIRST = 0x0010
# mbpoll's codes for the tables: functions 01, 02, 04 and 03; 05 and 0F write coils, 06 and 10 registers.
COILS, DISCRETE_INPUTS, INPUT_REGISTERS, HOLDING_REGISTERS = "0", "1", "3", "4"
BITS, WORDS = (COILS, DISCRETE_INPUTS), (INPUT_REGISTERS, HOLDING_REGISTERS)
ADDRESS, VALUE, FAILURE, BUSY = (
    "Illegal data address", "Illegal data value", "Slave device or server failure",
    "Slave device or server is busy")
# Time in seconds that mbpoll waits for an answer: its maximum, and the time in tests that expect none.
ANSWER, SILENCE = "10.00", "0.50"


@unittest.skipUnless(MBPOLL, "mbpoll is not installed (Debian has it as a package)")
class Mbpoll(OnSimulator):
    MODULE = "none"

    def setUp(self):
        # mbpoll is the master on the line.
        pass

    def call(self, *arguments, unit=1, baudrate=9600, wait=ANSWER):
        """Sends a request once. Returns the output, and the reason if it failed."""
        command = [MBPOLL, "-m", "rtu", "-b", str(baudrate), "-P", "none", "-s", "2", "-0", "-1",
                   "-a", str(unit), "-o", wait, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        complaint = done.stderr.strip()
        self.assertEqual(done.returncode != 0, bool(complaint), done)
        return done.stdout, complaint.rpartition(": ")[2]

    def read(self, table, address, count=1, **settings):
        """Returns the values, or the reason why there are none."""
        output, refusal = self.call(
            "-t", table, "-r", str(address), "-c", str(count), self.simulator.pty, **settings)
        values = [int(value) for value in re.findall(r"^\[\d+\]:\s+(-?\d+)", output, re.MULTILINE)]
        self.assertEqual(len(values), 0 if refusal else count, output)
        return refusal or values

    def write(self, table, address, *values, **settings):
        """Returns None, or the reason of a refusal."""
        output, refusal = self.call(
            "-t", table, "-r", str(address), self.simulator.pty, *map(str, values), **settings)
        self.assertEqual(f"Written {len(values)} references." in output, not refusal, output)
        return refusal or None

    def assert_nothing_is_written(self, table, first=FIRST, count=4):
        """Asserts that neither single nor multiple writes succeed."""
        before = self.simulator.state().channels
        for address in range(first, first + count):
            self.assertEqual(self.write(table, address, 1), ADDRESS)
        self.assertEqual(self.write(table, first, *[1] * count), ADDRESS)
        self.assertEqual(self.simulator.state().channels, before)


class Empty(Mbpoll):
    def test_reads_and_writes_of_points_are_refused(self):
        for table in (*BITS, *WORDS):
            self.assertEqual(self.read(table, FIRST), ADDRESS)
        self.assert_nothing_is_written(COILS)
        self.assert_nothing_is_written(HOLDING_REGISTERS)

    def test_another_unit_does_not_answer(self):
        # A reply to the test before counts only after t3.5 of silence.
        self.simulator.wait(60)
        sent = self.simulator.state().line.tx_frames
        self.assertEqual(self.read(COILS, FIRST, unit=2, wait=SILENCE), "Connection timed out")
        self.simulator.wait(500)
        self.assertEqual(self.simulator.state().line.tx_frames, sent)

    def test_11_returns_identity_and_run_indicator(self):
        """Function 11 as libmodbus reads it: an identity of one byte, and the run indicator."""
        output, refusal = self.call("-u", self.simulator.pty)
        self.assertEqual(refusal, "")
        self.assertRegex(output, r"Length: 2\nId    : 0x01\nStatus: On\n")

    def test_polling_several_units_continues_after_a_missing_one(self):
        # Long enough for the unit that answers, even on a busy machine.
        output, refusal = self.call(
            "-t", HOLDING_REGISTERS, "-r", "518", self.simulator.pty, unit="2,1,3", wait="3.00")
        self.assertEqual(refusal, "Connection timed out")
        self.assertRegex(output, r"slave 2\.\.\.\n-- Polling slave 1\.\.\.\n\[518\]:\s+1\n")

    def test_words_of_state_and_a_long_read(self):
        words = self.read(HOLDING_REGISTERS, 0x0200, 7)
        self.assertEqual((words[0], words[1], words[4:]), (0x2383, 0x5860, [2, 1, 1]))
        self.assertEqual(len(self.read(HOLDING_REGISTERS, 0x0160, 125)), 125)
        self.assertEqual(self.read(INPUT_REGISTERS, 0x0160, 64), self.read(HOLDING_REGISTERS, 0x0160, 64))


class Numbers(Mbpoll):
    def test_pairs_of_registers_are_read_and_written_as_numbers(self):
        """Integers and floating-point numbers of 32 bits, either word first: LORA_ADDRESS accepts any
        word, LORA_CHANNEL after it 0 to 31."""
        first = ("-r", str(0x0141))

        def pair(kind, value, *options):
            output, refusal = self.call(
                *options, "-t", f"4:{kind}", *first, self.simulator.pty, "--", value)
            self.assertEqual("Written 1 references." in output, not refusal, output)
            if refusal:
                return refusal
            outputs = [self.call(*options, "-t", f"{table}:{kind}", *first, self.simulator.pty)[0]
                       for table in WORDS]
            values = [re.search(r"^\[321\]:\s+(\S+)$", text, re.MULTILINE)[1] for text in outputs]
            self.assertEqual(values[0], values[1], "functions 03 and 04 read the same")
            return values[0], self.read(HOLDING_REGISTERS, 0x0141, 2)

        self.assertEqual(pair("int", "65536", "-B"), BUSY)
        self.assertIsNone(self.write(HOLDING_REGISTERS, 0x0100, "0x5A17"))
        self.assertEqual(pair("int", str(0x1234_001F), "-B"), (str(0x1234_001F), [0x1234, 0x1F]))
        self.assertEqual(pair("int", str(0x001E_4321)), (str(0x001E_4321), [0x4321, 0x1E]))
        self.assertEqual(pair("float", "100", "-B"), ("100", [0x42C8, 0]))
        self.assertEqual(pair("float", "-2.5", "-B"), ("-2.5", [0xC020, 0]))
        self.assertEqual(pair("int", "32", "-B"), VALUE)
        self.assertEqual(self.read(HOLDING_REGISTERS, 0x0141, 2), [0xC020, 0], "a refused write changes nothing")
        for table in WORDS:
            output, _ = self.call("-t", f"{table}:hex", *first, "-c", "2", self.simulator.pty)
            self.assertRegex(output, r"\[321\]:\s+0xC020\n\[322\]:\s+0x0000\n")


class DigitalInputs(Mbpoll):
    MODULE = "4di"

    def test_inputs_are_read_and_counted(self):
        for number, pattern in enumerate(([1, 0, 0, 1], [0, 0, 0, 0], [1, 1, 0, 0])):
            for channel, energised in enumerate(pattern, 1):
                self.simulator.set_channel(channel, energised=bool(energised))
            self.simulator.wait(20)
            for table in BITS:
                self.assertEqual(self.read(table, FIRST, 4), pattern, number)
        # Pairs of registers, high word first.
        self.assertEqual(self.counters(), [2, 1, 0, 1])
        self.assert_nothing_is_written(COILS)
        self.assertEqual(self.read(HOLDING_REGISTERS, FIRST), ADDRESS)

    def counters(self):
        output, refusal = self.call(
            "-B", "-t", "3:int", "-r", str(0x0320), "-c", "4", self.simulator.pty)
        self.assertEqual(refusal, "")
        return [int(value) for value in re.findall(r"^\[\d+\]:\s+(\d+)", output, re.MULTILINE)]


class DigitalOutputs(Mbpoll):
    MODULE = "4do"

    def test_outputs_are_written_one_by_one_and_together(self):
        for pattern in ([1, 0, 1, 1], [0, 1, 0, 0]):
            self.assertIsNone(self.write(COILS, FIRST, *pattern))
            self.eventually(self.simulator.outputs, [bool(on) for on in pattern])
            for table in BITS:
                self.assertEqual(self.read(table, FIRST, 4), pattern)
        for offset in range(4):
            pattern[offset] ^= 1
            self.assertIsNone(self.write(COILS, FIRST + offset, pattern[offset]))
            self.eventually(self.simulator.outputs, [bool(on) for on in pattern])
        self.assertEqual(self.write(COILS, FIRST + 2, 0, 0, 0), ADDRESS)
        self.assertEqual(self.read(COILS, FIRST, 4), pattern)
        self.assertEqual(self.write(HOLDING_REGISTERS, FIRST, 1), ADDRESS)

    def test_the_rate_is_changed(self):
        self.assertEqual(self.write(HOLDING_REGISTERS, 0x0101, 192), BUSY)
        self.assertIsNone(self.write(HOLDING_REGISTERS, 0x0100, "0x5A17"))
        self.assertEqual(self.write(HOLDING_REGISTERS, 0x0101, 97), VALUE)
        self.assertIsNone(self.write(HOLDING_REGISTERS, 0x0101, 1152, 0))
        self.assertIsNone(self.write(HOLDING_REGISTERS, 0x0108, 1))
        self.assertIsNone(self.write(HOLDING_REGISTERS, 0x0108, 2))
        self.simulator.wait(300)
        self.assertEqual(self.simulator.state().line.baud, 115200)
        self.assertEqual(self.read(HOLDING_REGISTERS, 0x0101, 2, baudrate=115200), [1152, 0])


class Relays(Mbpoll):
    MODULE = "2relay"

    def test_coils_are_written_and_jumpers_read(self):
        coils = lambda: [channel.energised for channel in self.simulator.state().channels[:2]]
        self.simulator.set_channel(2, manual=True)
        self.assertIsNone(self.write(COILS, FIRST + 2, 1, 0))
        self.eventually(coils, [True, False])
        self.assertIsNone(self.write(COILS, FIRST + 3, 1))
        self.eventually(coils, [True, True])
        for table in BITS:
            self.assertEqual(self.read(table, FIRST, 4), [0, 1, 1, 1])
        self.assert_nothing_is_written(COILS, FIRST, 2)
        self.assertEqual(self.write(COILS, FIRST + 1, 0, 0), ADDRESS)


class AnalogInputs(Mbpoll):
    MODULE = "4ai"

    def test_inputs_are_read(self):
        for channel, millivolts in enumerate((3300, 0, 1650, 825), 1):
            self.simulator.set_channel(channel, millivolts=millivolts)
        self.simulator.wait(500)
        for table in WORDS:
            for value, wanted in zip(self.read(table, FIRST, 4), (4095, 0, 2048, 1024), strict=True):
                self.assertLessEqual(abs(value - wanted), 1)
        self.assert_nothing_is_written(HOLDING_REGISTERS)
        self.assertEqual(self.read(COILS, FIRST), ADDRESS)


class AnalogOutputs(Mbpoll):
    MODULE = "4ao"
    FIRST_OUTPUT, OUTPUTS = FIRST, 4

    def codes(self):
        return [channel.code for channel in self.simulator.state().channels if channel.code is not None]

    def test_outputs_are_written_one_by_one_and_together(self):
        values = [4095, 0, 2048, 1][:self.OUTPUTS]
        self.assertIsNone(self.write(HOLDING_REGISTERS, self.FIRST_OUTPUT, *values))
        self.eventually(self.codes, values)
        for offset in range(self.OUTPUTS):
            values[offset] = 100 * (offset + 1)
            self.assertIsNone(self.write(HOLDING_REGISTERS, self.FIRST_OUTPUT + offset, values[offset]))
            self.eventually(self.codes, values)
        for table in WORDS:
            self.assertEqual(self.read(table, self.FIRST_OUTPUT, self.OUTPUTS), values)
        self.assertEqual(self.write(HOLDING_REGISTERS, self.FIRST_OUTPUT, 4096), VALUE)
        self.assertEqual(self.write(HOLDING_REGISTERS, self.FIRST_OUTPUT, 1, 4096), VALUE)
        self.assertEqual(self.write(HOLDING_REGISTERS, FIRST + 3, 1, 1), ADDRESS)
        self.assertEqual(self.codes(), values)
        self.assertEqual(self.write(COILS, FIRST + 3, 1), ADDRESS)


class AnalogInputsAndOutputs(AnalogOutputs):
    MODULE = "2ai2ao"
    FIRST_OUTPUT, OUTPUTS = FIRST + 2, 2

    def test_inputs_are_only_read(self):
        self.simulator.set_channel(1, millivolts=3300)
        self.simulator.wait(500)
        self.assertEqual(self.read(INPUT_REGISTERS, FIRST, 2), [4095, 0])
        self.assert_nothing_is_written(HOLDING_REGISTERS, FIRST, 2)


class NoModule(Mbpoll):
    """The setting is 4ao, but no module is plugged."""

    MODULE = "4ao"

    def test_outputs_read_the_commanded_values_and_refuse_writes(self):
        self.simulator.power_off()
        self.simulator.set_module("none")
        self.simulator.power_on()
        self.simulator.wait(500)
        for table in WORDS:
            self.assertEqual(self.read(table, FIRST, 4), [0, 0, 0, 0])
        self.assertEqual(self.write(HOLDING_REGISTERS, FIRST, 1), FAILURE)
        self.assertEqual(self.write(HOLDING_REGISTERS, FIRST, 1, 2, 3, 4), FAILURE)
