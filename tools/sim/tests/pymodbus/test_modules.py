"""Every module with every function that pymodbus has for its points."""

from simulator import AsciiLine, OnSimulator

FIRST = 0x0010
POINTS = range(4)
# Kinds of points according to the manual: input or output, of bits or words; None if there is no point.
BIT_IN, BIT_OUT, WORD_IN, WORD_OUT = "bit in", "bit out", "word in", "word out"


class Module:
    """Tests for any module; KINDS has its four points."""

    KINDS = [None] * 4

    def spans(self, *kinds):
        """Returns every span that only has points of these kinds, and some of the other spans."""
        for offset in range(-1, 5):
            for count in (1, 2, 4):
                covered = [self.KINDS[n] if n in POINTS else None for n in range(offset, offset + count)]
                yield FIRST + offset, count, all(kind in kinds for kind in covered)

    def reads(self, good, read):
        """Asserts that FC 01 and 02, or 03 and 04, give the same answer or the same refusal."""
        for function in read:
            for address, count, exists in self.spans(*good):
                with self.subTest(function=function.__name__, address=hex(address), count=count):
                    answer = function(address, count=count)
                    if exists:
                        self.assertFalse(answer.isError(), answer)
                    else:
                        self.refused(answer, 2)

    def test_bits_are_read_only_from_bit_points(self):
        self.reads((BIT_IN, BIT_OUT), (self.master.read_coils, self.master.read_discrete_inputs))

    def test_words_are_read_only_from_word_points(self):
        read = (self.master.read_holding_registers, self.master.read_input_registers)
        self.reads((WORD_IN, WORD_OUT), read)

    def test_only_outputs_of_their_kind_are_written(self):
        before = self.simulator.state().channels
        for address, count, exists in self.spans(BIT_OUT):
            if not exists:
                self.refused(self.master.write_coils(address, [True] * count), 2)
                if count == 1:
                    self.refused(self.master.write_coil(address, True), 2)
        for address, count, exists in self.spans(WORD_OUT):
            if not exists:
                self.refused(self.master.write_registers(address, [1] * count), 2)
                if count == 1:
                    self.refused(self.master.write_register(address, 1), 2)
        self.assertEqual(self.simulator.state().channels, before)

    def words(self, count=4):
        """Returns the points as words, read by both functions."""
        holding = self.master.read_holding_registers(FIRST, count=count)
        inputs = self.master.read_input_registers(FIRST, count=count)
        self.assertFalse(holding.isError() or inputs.isError(), (holding, inputs))
        return holding.registers, inputs.registers

    def assert_words(self, wanted):
        """Asserts that both functions read these words, within one step of the converter."""
        for read in self.words():
            near = all(abs(word - value) <= 1 for word, value in zip(read, wanted, strict=True))
            self.assertTrue(near, f"{read}, not {wanted}")

    def settled(self, wanted):
        """Waits until the filters of the analog inputs have reached these codes."""
        self.eventually(lambda: [round(word / 4) for word in self.words()[0]],
                        [round(code / 4) for code in wanted])

    def codes(self):
        """Returns the codes at the DAC; None where there is no output."""
        return [channel.code for channel in self.simulator.state().channels]


class Empty(Module, OnSimulator):
    MODULE = "none"


class DigitalInputs(Module, OnSimulator):
    MODULE = "4di"
    KINDS = [BIT_IN] * 4


class DigitalOutputs(Module, OnSimulator):
    MODULE = "4do"
    KINDS = [BIT_OUT] * 4


class Relays(Module, OnSimulator):
    MODULE = "2relay"
    KINDS = [BIT_IN, BIT_IN, BIT_OUT, BIT_OUT]

    def coils(self):
        return [channel.energised for channel in self.simulator.state().channels[:2]]

    def test_coils_are_written_and_jumpers_are_read(self):
        for first, second in ((True, False), (False, True), (True, True), (False, False)):
            self.simulator.set_channel(1, manual=second)
            self.simulator.set_channel(2, manual=first)
            self.bits(self.master.write_coils(FIRST + 2, [first, second]), 0)
            self.eventually(self.coils, [first, second])
            wanted = [second, first, first, second]
            self.eventually(lambda: self.bits(self.master.read_coils(FIRST, count=4), 4), wanted)
            answer = self.master.read_discrete_inputs(FIRST, count=4)
            self.assertEqual(self.bits(answer, 4), wanted)
        for relay in (1, 2):
            self.bits(self.master.write_coil(FIRST + 1 + relay, True), 0)
        self.eventually(self.coils, [True, True])
        # A write that spans a jumper and a coil changes nothing.
        self.refused(self.master.write_coils(FIRST + 1, [False, False]), 2)
        self.assertEqual(self.coils(), [True, True])
        self.bits(self.master.write_coils(FIRST + 2, [False, False]), 0)
        self.eventually(self.coils, [False, False])


class AnalogInputs(Module, OnSimulator):
    MODULE = "4ai"
    KINDS = [WORD_IN] * 4

    def test_voltages_are_read_as_codes(self):
        for millivolts in ((0, 825, 1650, 3300), (3300, 1650, 825, 0)):
            for number, value in enumerate(millivolts, 1):
                self.simulator.set_channel(number, millivolts=value)
            wanted = [round(value * 4095 / 3300) for value in millivolts]
            self.settled(wanted)
            self.eventually(lambda: self.words()[0] == self.words()[1], True)


class AnalogOutputs(Module, OnSimulator):
    MODULE = "4ao"
    KINDS = [WORD_OUT] * 4

    def test_codes_are_written_one_by_one_and_together(self):
        for wanted in ([4095, 0, 2048, 1], [0, 4095, 1, 2048]):
            self.assertFalse(self.master.write_registers(FIRST, wanted).isError())
            self.eventually(self.codes, wanted)
            self.assert_words(wanted)
        for offset in POINTS:
            wanted[offset] = 100 * (offset + 1)
            self.assertFalse(self.master.write_register(FIRST + offset, wanted[offset]).isError())
            self.eventually(self.codes, wanted)

    def test_code_above_twelve_bits_refuses_the_whole_write(self):
        wanted = [7, 8, 9, 10]
        self.assertFalse(self.master.write_registers(FIRST, wanted).isError())
        for offset in POINTS:
            values = [1, 2, 3, 4]
            values[offset] = 4096
            self.refused(self.master.write_registers(FIRST, values), 3)
            self.refused(self.master.write_register(FIRST + offset, 0xFFFF), 3)
        self.refused(self.master.write_registers(FIRST + 1, [4096] * 4), 2)
        self.assert_words(wanted)
        self.eventually(self.codes, wanted)


class AnalogInputsAndOutputs(Module, OnSimulator):
    MODULE = "2ai2ao"
    KINDS = [WORD_IN, WORD_IN, WORD_OUT, WORD_OUT]

    def test_inputs_are_read_and_outputs_written(self):
        for number, millivolts in ((1, 1650), (2, 825)):
            self.simulator.set_channel(number, millivolts=millivolts)
        self.assertFalse(self.master.write_registers(FIRST + 2, [1234, 4095]).isError())
        self.settled([2048, 1024, 1234, 4095])
        self.eventually(self.codes, [None, None, 1234, 4095])
        self.refused(self.master.write_registers(FIRST + 1, [0, 0, 0]), 2)
        self.refused(self.master.write_register(FIRST + 2, 4096), 3)
        self.assertEqual(self.codes(), [None, None, 1234, 4095])


class RelaysInAscii(AsciiLine, Relays):
    """Bits to read and bits to write in ASCII mode."""


class AnalogInputsAndOutputsInAscii(AsciiLine, AnalogInputsAndOutputs):
    """Words to read and words to write in ASCII mode."""
