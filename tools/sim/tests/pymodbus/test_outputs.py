"""Module 4do: four outputs, written separately and together, and read back."""

import itertools

from simulator import SILENCE_MS, AsciiLine, OnSimulator

FIRST = 0x0010


class Outputs(OnSimulator):
    MODULE = "4do"

    def setUp(self):
        super().setUp()
        self.bits(self.master.write_coils(FIRST, [False] * 4), 0)
        self.eventually(self.simulator.outputs, [False] * 4)

    def read(self):
        coils = self.bits(self.master.read_coils(FIRST, count=4), 4)
        inputs = self.bits(self.master.read_discrete_inputs(FIRST, count=4), 4)
        self.assertEqual(coils, inputs, "FC 01 and 02 read the same points")
        return coils

    def test_outputs_are_written_one_by_one(self):
        wanted = [False] * 4
        for offset, on in itertools.product((2, 0, 3, 1), (True, False, True)):
            answer = self.master.write_coil(FIRST + offset, on)
            self.assertFalse(answer.isError(), answer)
            self.assertEqual((answer.address, answer.bits[0]), (FIRST + offset, on))
            wanted[offset] = on
            self.assertEqual(self.read(), wanted)
            self.eventually(self.simulator.outputs, wanted)

    def test_four_outputs_are_written_together(self):
        for wanted in itertools.product([False, True], repeat=4):
            answer = self.master.write_coils(FIRST, list(wanted))
            self.assertFalse(answer.isError(), answer)
            self.assertEqual(self.read(), list(wanted))
            self.eventually(self.simulator.outputs, list(wanted))

    def test_a_write_partly_beyond_the_slot_changes_nothing(self):
        self.refused(self.master.write_coils(FIRST + 2, [True] * 3), 2)
        self.refused(self.master.write_coils(FIRST - 1, [True] * 2), 2)
        self.refused(self.master.write_coil(FIRST + 4, True), 2)
        self.assertEqual(self.read(), [False] * 4)
        self.assertEqual(self.simulator.outputs(), [False] * 4)

    def test_bit_points_cannot_be_read_as_words(self):
        self.refused(self.master.read_holding_registers(FIRST, count=4), 2)
        self.refused(self.master.read_input_registers(FIRST, count=1), 2)
        self.refused(self.master.write_register(FIRST, 0xFF00), 2)
        self.refused(self.master.write_registers(FIRST, [0xFF00]), 2)
        self.assertEqual(self.simulator.outputs(), [False] * 4)

    def test_broadcast_is_executed_without_an_answer(self):
        sent = self.simulator.state().line.tx_frames
        self.master.write_coils(FIRST, [True, False, True, True], device_id=0, no_response_expected=True)
        self.eventually(self.simulator.outputs, [True, False, True, True])
        self.simulator.wait(SILENCE_MS)
        self.assertEqual(self.simulator.state().line.tx_frames, sent)
        self.assertEqual(self.read(), [True, False, True, True])

    def test_another_units_write_changes_nothing(self):
        self.silent(lambda master: master.write_coils(FIRST, [True] * 4, device_id=2))
        self.assertEqual(self.simulator.outputs(), [False] * 4)

    def test_a_power_cycle_turns_the_outputs_off(self):
        self.bits(self.master.write_coils(FIRST, [True] * 4), 0)
        self.eventually(self.simulator.outputs, [True] * 4)
        self.simulator.power_cycle()
        self.simulator.wait(200)
        self.assertEqual(self.simulator.outputs(), [False] * 4)
        self.assertEqual(self.read(), [False] * 4)


class OutputsInAscii(AsciiLine, Outputs):
    """The same in ASCII mode."""
