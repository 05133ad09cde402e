"""Configuration over the line: lock, refusals, save, restart, another rate, the watchdog."""

from simulator import OnSimulator

FIRST = 0x0010
KEY, BAUD, FORMAT, COMM_TIMEOUT, COMMAND, COMM_SOURCE = 0x0100, 0x0101, 0x0102, 0x0104, 0x0108, 0x0109
MODULE, FILTER, SAFE, START = 0x0114, 0x0130, 0x01D0, 0x01F0
STATUS, RESET_CAUSE, MODULE_IN_FORCE = 0x020A, 0x0207, 0x0214
SAVE, RESTART, DROP, CLEAR_FLAG = 1, 2, 4, 5
TRIPPED, UNSAVED, WAITING, UNLOCKED = 1, 8, 16, 32


class Configuration(OnSimulator):
    """Settings by a master. Settings remain, so each test begins with the default settings."""

    MODULE = "4do"

    def setUp(self):
        type(self).setUpDevice()
        super().setUp()

    @classmethod
    def setUpDevice(cls):
        """Sets default settings except for the module."""
        master = cls.simulator.master()
        for address, value in ((KEY, 0x5A17), (COMMAND, 3), (MODULE, 2), (COMMAND, SAVE)):
            answer = master.write_register(address, value)
            assert not answer.isError(), answer
        cls.simulator.wait(200)
        master.close()
        cls.simulator.power_cycle()
        cls.simulator.wait(200)

    def written(self, address, *values):
        answer = self.master.write_registers(address, list(values))
        self.assertFalse(answer.isError(), answer)

    def register(self, address, count=1):
        answer = self.master.read_holding_registers(address, count=count)
        self.assertFalse(answer.isError(), answer)
        return answer.registers[0] if count == 1 else answer.registers

    def unlock(self):
        self.assertFalse(self.master.write_register(KEY, 0x5A17).isError())

    def save(self):
        self.written(COMMAND, SAVE)
        self.eventually(lambda: self.register(STATUS) & UNSAVED, 0)

    def reconnect(self, **settings):
        self.master.close()
        self.simulator.wait(300)
        self.master = self.simulator.master(**settings)
        self.addCleanup(self.master.close)

    def test_closed_lock_refuses_writes_to_settings(self):
        self.assertEqual(self.register(KEY), 0)
        for address in (BAUD, COMM_TIMEOUT, FILTER, MODULE):
            value = self.register(address)
            self.refused(self.master.write_register(address, value), 6)
            self.refused(self.master.write_registers(address, [value]), 6)
        self.refused(self.master.write_register(COMMAND, RESTART), 6)
        self.refused(self.master.write_register(KEY, 0x1234), 3)
        self.unlock()
        self.assertEqual(self.register(KEY), 1)
        self.assertTrue(self.register(STATUS) & UNLOCKED)

    def test_values_out_of_range_are_refused_and_a_refused_write_changes_nothing(self):
        self.unlock()
        for address, value in ((BAUD, 97), (FORMAT, 4), (COMM_TIMEOUT, 36001), (MODULE, 7),
                               (FILTER, 1001), (SAFE, 2), (START, 0xFFFF), (COMMAND, 0)):
            self.refused(self.master.write_register(address, value), 3)
        self.refused(self.master.write_registers(BAUD, [192, 1, 0, 36001]), 3)
        self.refused(self.master.write_registers(COMM_SOURCE, [1, 1]), 2)
        self.refused(self.master.write_register(STATUS, 0), 2)
        self.assertEqual(self.register(BAUD, 4), [96, 0, 0, 0])
        self.assertFalse(self.register(STATUS) & UNSAVED)

    def test_new_rate_is_saved_and_in_force_after_the_restart(self):
        self.unlock()
        self.written(BAUD, 1152, 3)
        self.assertTrue(self.register(STATUS) & UNSAVED)
        self.save()
        self.assertTrue(self.register(STATUS) & WAITING)
        self.assertEqual(self.simulator.state().line.baud, 9600, "not before the restart")
        self.written(COMMAND, RESTART)
        self.reconnect(baudrate=115200, stopbits=1)
        line = self.simulator.state().line
        self.assertEqual((line.baud, line.format), (115200, "8N1"))
        self.assertEqual(self.register(BAUD, 2), [1152, 3])
        self.assertTrue(self.register(RESET_CAUSE) & 8, "the reset cause is software")
        self.assertEqual(self.register(STATUS), 0)
        self.bits(self.master.write_coils(FIRST, [True] * 4), 0)
        self.eventually(self.simulator.outputs, [True] * 4)
        # The rate is the same after a power cycle; then the test sets it back.
        self.simulator.power_cycle()
        self.reconnect(baudrate=115200, stopbits=1)
        self.unlock()
        self.written(BAUD, 96, 0)
        self.save()
        self.written(COMMAND, RESTART)
        self.reconnect()
        self.assertEqual(self.simulator.state().line.baud, 9600)
        self.assertEqual(self.register(BAUD, 2), [96, 0])

    def test_unsaved_settings_are_lost_or_discarded(self):
        self.unlock()
        self.written(FILTER, 50)
        self.save()
        self.written(FILTER, 60)
        self.written(COMMAND, DROP)
        self.assertEqual(self.register(FILTER), 50)
        self.written(FILTER, 70)
        self.simulator.power_cycle()
        self.reconnect()
        self.assertEqual(self.register(FILTER), 50)

    def test_outputs_have_start_values_after_a_power_cycle(self):
        self.unlock()
        self.written(START, 1, 0, 0, 1)
        self.save()
        self.assertEqual(self.simulator.outputs(), [False] * 4)
        self.simulator.power_cycle()
        self.eventually(self.simulator.outputs, [True, False, False, True])

    def test_another_module_works_with_the_same_firmware(self):
        self.unlock()
        self.written(MODULE, 5)
        self.save()
        self.simulator.power_off()
        self.simulator.set_module("4ao")
        self.simulator.power_on()
        self.reconnect()
        self.assertEqual(self.register(MODULE_IN_FORCE), 5)
        self.written(FIRST, 1, 2, 3, 4095)
        self.refused(self.master.read_coils(FIRST, count=1), 2)
        codes = lambda: [channel.code for channel in self.simulator.state().channels]
        self.eventually(codes, [1, 2, 3, 4095])
        self.simulator.power_off()
        self.simulator.set_module("4do")
        self.simulator.power_on()
        self.reconnect()

    def test_a_silent_line_sends_outputs_to_safe_until_they_are_written(self):
        self.unlock()
        self.written(SAFE, 0, 1, 0xFFFF, 0)
        self.written(COMM_TIMEOUT, 30)
        self.bits(self.master.write_coils(FIRST, [True, False, True, True]), 0)
        # The outputs do not change as long as requests arrive.
        for _ in range(20):
            self.simulator.wait(200)
            coils = self.bits(self.master.read_coils(FIRST, count=4), 4)
            self.assertEqual(coils, [True, False, True, True])
        self.eventually(self.simulator.outputs, [False, True, True, False], within_ms=3500)
        self.assertTrue(self.register(STATUS) & TRIPPED)
        self.written(COMM_TIMEOUT, 0)
        self.assertEqual(self.simulator.outputs(), [False, True, True, False])
        self.bits(self.master.write_coil(FIRST + 3, True), 0)
        self.eventually(self.simulator.outputs, [False, True, True, True])
        self.assertTrue(self.register(STATUS) & TRIPPED, "the flag stays set")
        self.written(COMMAND, CLEAR_FLAG)
        self.assertFalse(self.register(STATUS) & TRIPPED)
