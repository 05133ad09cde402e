"""Module 4di: four inputs that follow the outside voltages and refuse writes."""

import itertools

from simulator import OnSimulator

FIRST = 0x0010


class Inputs(OnSimulator):
    MODULE = "4di"

    def read(self):
        coils = self.bits(self.master.read_coils(FIRST, count=4), 4)
        inputs = self.bits(self.master.read_discrete_inputs(FIRST, count=4), 4)
        self.assertEqual(coils, inputs, "FC 01 and 02 read the same points")
        return inputs

    def energise(self, inputs):
        for number, energised in enumerate(inputs, 1):
            self.simulator.set_channel(number, energised=energised)

    def tearDown(self):
        self.energise([False] * 4)

    def test_inputs_follow_their_channels_in_every_combination(self):
        for inputs in itertools.product([False, True], repeat=4):
            self.energise(inputs)
            self.eventually(self.read, list(inputs))

    def test_each_input_is_read_alone(self):
        self.energise([False, True, False, True])
        self.eventually(self.read, [False, True, False, True])
        for offset, energised in enumerate([False, True, False, True]):
            answer = self.master.read_discrete_inputs(FIRST + offset, count=1)
            self.assertEqual(self.bits(answer, 1), [energised])

    def test_writes_to_inputs_are_refused(self):
        self.refused(self.master.write_coil(FIRST, True), 2)
        self.refused(self.master.write_coils(FIRST, [True] * 4), 2)
        self.assertEqual(self.read(), [False] * 4)

    def test_addresses_beyond_the_slot_are_refused(self):
        for first, count in ((0x0000, 1), (0x000F, 1), (0x000F, 2), (0x0014, 1), (0x0013, 2), (0x0010, 5)):
            with self.subTest(first=hex(first), count=count):
                self.refused(self.master.read_coils(first, count=count), 2)
                self.refused(self.master.read_discrete_inputs(first, count=count), 2)

    def test_bit_points_cannot_be_read_as_words(self):
        self.refused(self.master.read_holding_registers(FIRST, count=1), 2)
        self.refused(self.master.read_input_registers(FIRST, count=4), 2)
        self.refused(self.master.write_register(FIRST, 1), 2)
        self.refused(self.master.write_registers(FIRST, [1, 2]), 2)
