"""Tests of the commands that the platform adds to the monitor."""

import json
import os
import unittest

from renode_fake import Machine, Memory, commands


SWITCH = {
    "modio-02": ["PA4", "PA5", "PA6", "PA7", "PB12", "PB13", "PB14", "PB15"],
    "modio-08": ["PC6", "PC7", "PC8", "PC9", "PB12", "PB13", "PB14", "PB15"],
}
PULLED_UP = {
    "modio-02": ["PA0", "PA1", "PA2", "PA3", "PA10", "PB5"],
    "modio-08": ["PA0", "PA1", "PA2", "PA3", "PA4", "PA5", "PA6", "PA7", "PC0", "PC1", "PC2", "PC3", "PB0", "PB1", "PC4",
                 "PC5", "PA10", "PC12"],
}


class Commands(unittest.TestCase):
    def levels(self, act):
        """Returns the levels that `act`, called with the commands, drives onto pins."""
        levels = {}

        class Port:
            def __init__(self, name):
                self.name = name

            def OnGPIO(self, pin, high):
                levels[f"P{self.name}{pin}"] = high

        act(commands(Machine({f"sysbus.gpioPort{name}": Port(name) for name in "ABC"}), []))
        return levels

    def test_inputs_drive_the_switch_and_the_pulled_up_pins(self):
        for board in SWITCH:

            def act(run):
                run.mc_modio_board(board)
                run.mc_modio_inputs(0b1001_0110)

            levels = self.levels(act)
            # ON is low.
            on = [True, False, False, True, False, True, True, False]
            self.assertEqual([levels[pin] for pin in SWITCH[board]], on)
            for pin in PULLED_UP[board]:
                self.assertIs(levels[pin], True, pin)
            self.assertEqual(len(levels), 8 + len(PULLED_UP[board]))

    def test_lines_are_driven_by_port_and_channel(self):
        def act(run):
            run.mc_modio_board("modio-08")
            run.mc_modio_input(4, 3, "false")
            run.mc_modio_input(2, 1, True)
            for port, channel in ((5, 1), (1, 0), (1, 5)):
                with self.assertRaisesRegex(ValueError, "no channel"):
                    run.mc_modio_input(port, channel, True)

        self.assertEqual(self.levels(act), {"PC4": False, "PA4": True})
        self.assertEqual(self.levels(lambda run: run.mc_modio_input(5, 2, False)), {"PA1": False})

    def test_unknown_board_is_rejected(self):
        with self.assertRaisesRegex(ValueError, "modio-02, modio-08"):
            commands(Machine(), []).mc_modio_board("modio-04")

    class Bus(dict):
        """Memory by address; 0xFF where nothing was written."""

        def ReadByte(self, address):
            return self.get(address, 0xFF)

        def ReadDoubleWord(self, address):
            return sum(self.ReadByte(address + n) << 8 * n for n in range(4))

        def WriteByte(self, address, value):
            self[address] = value

        def GetSymbolAddress(self, name):
            return {"_SEGGER_RTT": 0x20002000}[name]

    def test_a_preset_is_stored_only_in_an_erased_store(self):
        bus = self.Bus()
        run = commands(Machine({"sysbus": bus}), [])
        run.mc_modio_preset("4do")
        stored = dict(bus)
        self.assertEqual(min(stored), 0x0800F800)
        self.assertEqual(len(stored), 24)
        run.mc_modio_preset("4di")
        self.assertEqual(bus, stored)
        bus.clear()
        bus[0x0800FC00 + 1023] = 0
        run.mc_modio_preset("4di")
        self.assertEqual(len(bus), 1)
        with self.assertRaisesRegex(ValueError, "4di, 4do"):
            run.mc_modio_preset("5di")
        with self.assertRaisesRegex(ValueError, "no slot at port 1"):
            run.mc_modio_preset("1=4di")

    def test_the_log_is_printed(self):
        bus, printed = self.Bus(), []
        run = commands(Machine({"sysbus": bus}), printed)
        run.mc_modio_log()
        self.assertEqual(printed, ["the firmware has not opened its log"])
        for at, word in ((28, 0x20003000), (32, 512), (36, 5)):
            for n in range(4):
                bus[0x20002000 + at + n] = word >> 8 * n & 0xFF
        for n, byte in enumerate(b"modio"):
            bus[0x20003000 + n] = byte
        run.mc_modio_log()
        self.assertEqual(printed[1:], ["modio"])

    def test_warnings_of_an_unused_dma_controller_are_disabled(self):
        parsed = []
        self.assertIsNone(commands(Machine({"sysbus.dma1": object()}), [], parsed).mc_modio_quiet())
        self.assertEqual(parsed, ["logLevel 3 sysbus.dma1"])

    def test_machine_without_dma_controller_gets_no_command(self):
        parsed = []
        self.assertIsNone(commands(Machine(), [], parsed).mc_modio_quiet())
        self.assertEqual(parsed, [])

    def test_monitor_that_rejects_the_command_is_ignored(self):
        self.assertIsNone(commands(Machine({"sysbus.dma1": object()}), []).mc_modio_quiet())


class Presets(unittest.TestCase):
    def test_presets_match_those_of_the_register_map(self):
        """MODIO_PRESETS has presets from the crate register-map, as JSON: board, modules, address, bytes."""
        if "MODIO_PRESETS" not in os.environ:
            self.skipTest("`cargo xtask test` provides the presets")
        presets = json.loads(os.environ["MODIO_PRESETS"])
        self.assertGreater(len(presets), 8)
        for board, modules, address, wanted in presets:
            bus = Commands.Bus()
            run = commands(Machine({"sysbus": bus}), [])
            run.mc_modio_board(board)
            run.mc_modio_preset(modules)
            stored = [bus.ReadByte(address + n) for n in range(len(wanted))]
            self.assertEqual(stored, wanted, (board, modules))
            self.assertEqual(len(bus), len(stored))


if __name__ == "__main__":
    unittest.main()
