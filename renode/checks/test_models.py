"""Tests of the platform's Python models, used like the firmware does."""

import unittest

from renode_fake import Machine, Memory, Peripheral


class Rcc(unittest.TestCase):
    """Follows the firmware's start-up step by step (board-support/src/clock.rs)."""

    CR, CFGR, CSR, NEXT, CRYSTAL = 0x00, 0x04, 0x24, 0x3F0, 0x3F4
    HSIRDY, HSEON, HSERDY, PLLON, PLLRDY = 1 << 1, 1 << 16, 1 << 17, 1 << 24, 1 << 25

    def setUp(self):
        self.rcc = Peripheral("rcc.py")

    def test_it_starts_on_the_internal_oscillator(self):
        self.assertEqual(self.rcc.read(self.CR), 0x83)
        self.assertEqual(self.rcc.read(self.CFGR), 0)

    def test_ready_flags_follow_their_on_bits_and_sws_follows_sw(self):
        rcc = self.rcc
        rcc.modify(self.CR, 1)
        self.assertTrue(rcc.read(self.CR) & self.HSIRDY)
        self.assertFalse(rcc.read(self.CR) & self.HSERDY)
        rcc.modify(self.CR, self.HSEON)
        self.assertTrue(rcc.read(self.CR) & self.HSERDY)
        # HSE as the PLL's source, factor 9; dividers of APB1 and ADC.
        rcc.write(self.CFGR, 1 << 16 | 7 << 18 | 4 << 8 | 2 << 14)
        self.assertFalse(rcc.read(self.CR) & self.PLLRDY)
        rcc.modify(self.CR, self.PLLON)
        self.assertTrue(rcc.read(self.CR) & self.PLLRDY)
        rcc.modify(self.CFGR, 2, 3)
        self.assertEqual(rcc.read(self.CFGR) >> 2 & 3, 2)
        self.assertEqual(rcc.read(self.CFGR) >> 18 & 15, 7)
        rcc.modify(self.CR, 1 << 19)
        self.assertTrue(rcc.read(self.CR) & 1 << 19, "the clock security system stays on")
        rcc.modify(self.CFGR, 0, 3)
        rcc.modify(self.CR, 0, self.PLLON | self.HSEON)
        self.assertFalse(rcc.read(self.CR) & (self.PLLRDY | self.HSERDY))

    def test_without_a_crystal_only_the_internal_oscillator_feeds_the_pll(self):
        rcc = self.rcc
        rcc.write(self.CRYSTAL, 0)
        for _ in range(2):
            rcc.modify(self.CR, self.HSEON)
            self.assertFalse(rcc.read(self.CR) & self.HSERDY)
            rcc.write(self.CFGR, 1 << 16)
            rcc.modify(self.CR, self.PLLON)
            self.assertFalse(rcc.read(self.CR) & self.PLLRDY)
            rcc.write(self.CFGR, 13 << 18)
            self.assertTrue(rcc.read(self.CR) & self.PLLRDY)
            rcc.reset()

    def test_the_reset_flags_are_cleared_and_the_next_reset_is_by_software(self):
        rcc = self.rcc
        self.assertEqual(rcc.read(self.CSR) >> 26, 0b000011, "power-on and pin")
        rcc.modify(self.CSR, 1 << 24)
        self.assertEqual(rcc.read(self.CSR), 0)
        rcc.reset()
        self.assertEqual(rcc.read(self.CSR) >> 26, 0b000101, "software and pin")
        rcc.write(self.NEXT, 0x0C000000)
        rcc.reset()
        self.assertEqual(rcc.read(self.CSR) >> 26, 0b000011)
        rcc.reset()
        self.assertEqual(rcc.read(self.CSR) >> 26, 0b000101, "the flags were set for one reset only")

    def test_oscillators_of_the_rtc_are_ready_when_on(self):
        self.rcc.modify(self.CSR, 1)
        self.assertEqual(self.rcc.read(self.CSR) & 3, 3)
        self.rcc.write(0x20, 1)
        self.assertEqual(self.rcc.read(0x20) & 3, 3)

    def test_clock_enables_are_kept_until_a_reset(self):
        self.rcc.modify(0x18, 1 << 2)
        self.assertEqual(self.rcc.read(0x18), 1 << 2)
        self.rcc.reset()
        self.assertEqual(self.rcc.read(0x18), 0)


class Flash(unittest.TestCase):
    """The controller, used like in board-support/src/flash.rs."""

    KEYR, SR, CR, AR = 0x04, 0x0C, 0x10, 0x14
    PG, PER, MER, STRT, LOCK, EOP = 1 << 0, 1 << 1, 1 << 2, 1 << 6, 1 << 7, 1 << 5
    PAGE = 0x0800F800

    def setUp(self):
        self.memory = Memory(0x20000)
        self.memory.data[:] = bytes(0x20000)
        self.flash = Peripheral("flash.py", Machine({"sysbus.flash": self.memory}))

    def unlock(self, keys=(0x45670123, 0xCDEF89AB)):
        for key in keys:
            self.flash.write(self.KEYR, key)

    def erased(self):
        return [page for page in range(128) if set(self.memory.data[page * 1024 : page * 1024 + 1024]) == {0xFF}]

    def erase(self, address):
        self.flash.write(self.SR, 0x34)
        self.flash.modify(self.CR, self.PER)
        self.flash.write(self.AR, address)
        self.flash.modify(self.CR, self.STRT)

    def test_it_is_locked_until_both_keys_were_written(self):
        self.assertTrue(self.flash.read(self.CR) & self.LOCK)
        self.erase(self.PAGE)
        self.assertEqual(self.erased(), [])
        self.assertEqual(len(self.flash.warnings), 2)
        self.unlock()
        self.assertFalse(self.flash.read(self.CR) & self.LOCK)

    def test_an_erase_clears_one_page_and_ends_immediately(self):
        self.unlock()
        self.erase(self.PAGE)
        self.assertEqual(self.erased(), [62])
        self.assertEqual(self.flash.read(self.SR), self.EOP, "not busy, no error")
        self.assertEqual(self.flash.read(0x3F0), 1)
        self.flash.write(self.SR, 0x34)
        self.assertEqual(self.flash.read(self.SR), 0)

    def test_programming_ends_with_eop_which_is_cleared_by_writing_one(self):
        self.unlock()
        self.flash.write(self.SR, 0x34)
        self.assertEqual(self.flash.read(self.SR), 0)
        self.flash.modify(self.CR, self.PG)
        self.assertEqual(self.flash.read(self.SR), self.EOP)
        self.flash.write(self.CR, self.LOCK)
        self.flash.write(self.SR, 0x34)
        self.assertEqual(self.flash.read(self.SR), 0)

    def test_the_lock_bit_locks_and_clears_the_mode(self):
        self.unlock()
        self.flash.modify(self.CR, self.PG)
        self.assertEqual(self.flash.read(self.CR), self.PG)
        self.flash.write(self.CR, self.LOCK)
        self.assertEqual(self.flash.read(self.CR), self.LOCK)
        self.unlock()
        self.assertEqual(self.flash.read(self.CR), 0)

    def test_wrong_keys_lock_it_until_the_reset(self):
        for keys in ((0xCDEF89AB,), (0x45670123, 0x45670123), (0x45670123, 0xCDEF89AB, 1)):
            self.flash.reset()
            self.unlock(keys)
            self.unlock()
            self.assertTrue(self.flash.read(self.CR) & self.LOCK, keys)
        self.flash.reset()
        self.unlock()
        self.assertFalse(self.flash.read(self.CR) & self.LOCK)

    def test_no_erase_without_the_mode_and_none_outside_the_flash(self):
        self.unlock()
        self.flash.write(self.AR, self.PAGE)
        self.flash.write(self.CR, self.STRT)
        self.erase(0x08020000)
        self.erase(0x20000000)
        self.assertEqual(self.erased(), [])
        self.assertEqual(self.flash.read(self.SR), 0)

    def test_flash_of_256_kib_has_pages_of_2_kib(self):
        self.memory = Memory(0x40000)
        self.memory.data[:] = bytes(0x40000)
        self.flash = Peripheral("flash.py", Machine({"sysbus.flash": self.memory}))
        self.flash.write(0x3F4, 256)
        self.flash.reset()
        self.unlock()
        self.erase(0x0803F800)
        self.assertEqual([at for at, byte in enumerate(self.memory.data) if byte], list(range(0x3F800, 0x40000)))
        self.erase(0x0803F7FE)
        self.assertEqual(self.memory.data.count(0xFF), 4096)
        self.erase(0x08040000)
        self.assertEqual(len(self.flash.warnings), 1)
        self.flash.write(self.CR, self.MER)
        self.flash.modify(self.CR, self.STRT)
        self.assertEqual(self.memory.data.count(0xFF), 0x40000)

    def test_a_mass_erase_clears_all_pages(self):
        self.unlock()
        self.flash.write(self.CR, self.MER)
        self.flash.modify(self.CR, self.STRT)
        self.assertEqual(len(self.erased()), 128)

    def test_an_erase_finds_the_memory_through_the_monitor_as_well(self):
        machine = Machine({"sysbus.flash": self.memory})
        self.flash = Peripheral("flash.py", machine, has_get_machine=False)
        self.unlock()
        self.erase(self.PAGE)
        self.assertEqual(self.erased(), [62])

    def test_wait_states_are_kept(self):
        self.assertEqual(self.flash.read(0), 0x30)
        self.flash.modify(0, 2 | 1 << 4, 7)
        self.assertEqual(self.flash.read(0), 0x32)


class Adc(unittest.TestCase):
    """ADC1, used like in board-support/src/adc.rs."""

    SR, CR2, SMPR2, SQR3, DR = 0x00, 0x08, 0x10, 0x34, 0x4C
    ADON, CAL, RSTCAL, EXTSEL_SW, EXTTRIG, SWSTART = 1, 1 << 2, 1 << 3, 7 << 17, 1 << 20, 1 << 22

    def setUp(self):
        self.adc = Peripheral("adc.py")
        self.adc.write(self.CR2, self.ADON | self.EXTTRIG | self.EXTSEL_SW)

    def test_the_calibration_ends_immediately(self):
        for bit in (self.RSTCAL, self.CAL):
            self.adc.modify(self.CR2, bit)
            self.assertFalse(self.adc.read(self.CR2) & bit)

    def test_a_conversion_uses_the_selected_channel_and_reading_it_clears_eoc(self):
        for channel in range(4):
            self.adc.write(0x100 + 4 * channel, 0x111 * (channel + 1))
        for channel in (2, 0, 3, 1):
            self.adc.write(self.SQR3, channel)
            self.assertFalse(self.adc.read(self.SR) & 2)
            self.adc.modify(self.CR2, self.SWSTART)
            self.assertTrue(self.adc.read(self.SR) & 2)
            self.assertEqual(self.adc.read(self.DR), 0x111 * (channel + 1))
            self.assertFalse(self.adc.read(self.SR) & 2)
            self.assertFalse(self.adc.read(self.CR2) & self.SWSTART)

    def test_without_power_or_trigger_nothing_is_converted(self):
        for cr2 in (0, self.ADON, self.ADON | self.EXTTRIG):
            self.adc.reset()
            self.adc.write(self.CR2, cr2)
            self.adc.modify(self.CR2, self.SWSTART)
            self.assertEqual(self.adc.read(self.SR), 0, hex(cr2))

    def test_applied_codes_are_kept_over_a_reset_and_have_12_bits(self):
        self.adc.write(0x100, 0xFFFF)
        self.adc.reset()
        self.assertEqual(self.adc.read(0x100), 0xFFF)
        self.assertEqual(self.adc.read(self.CR2), 0)


class Dac(unittest.TestCase):
    """I2C1, used like in board-support/src/i2c/master.rs, and the MCP4728 on it."""

    CR1, DR, SR1, SR2 = 0x00, 0x10, 0x14, 0x18
    PE, START, STOP, SWRST = 1, 1 << 8, 1 << 9, 1 << 15
    SB, ADDR, BTF, TXE, AF, BUSY = 1, 2, 4, 1 << 7, 1 << 10, 2

    def setUp(self):
        self.bus = Peripheral("i2c1_mcp4728.py")
        self.bus.write(self.CR1, self.SWRST)
        self.bus.write(self.CR1, 0)
        self.bus.write(self.CR1, self.PE)

    def start(self, address):
        self.bus.modify(self.CR1, self.START)
        self.assertTrue(self.bus.read(self.SR1) & self.SB)
        self.bus.write(self.DR, address << 1)
        return self.bus.read(self.SR1)

    def stop(self):
        self.bus.modify(self.CR1, self.STOP)
        self.assertFalse(self.bus.read(self.CR1) & self.STOP, "the stop condition is sent immediately")
        self.assertFalse(self.bus.read(self.SR2) & self.BUSY)

    def transfer(self, data, address=0x60):
        flags = self.start(address)
        self.assertTrue(flags & self.ADDR)
        self.assertFalse(flags & (self.AF | self.SB))
        self.assertTrue(self.bus.read(self.SR2) & self.BUSY)
        self.assertFalse(self.bus.read(self.SR1) & self.ADDR, "SR2 was read")
        for byte in data:
            self.assertTrue(self.bus.read(self.SR1) & self.TXE)
            self.bus.write(self.DR, byte)
        self.assertTrue(self.bus.read(self.SR1) & self.BTF)
        self.stop()

    def outputs(self, dac=0):
        return [self.bus.read(0x100 + 0x20 * dac + 4 * n) for n in range(4)]

    @staticmethod
    def multi_write(codes, hold=False):
        for channel, code in codes:
            yield 0x40 | channel << 1 | hold
            yield code >> 8
            yield code & 0xFF

    def test_a_multi_write_sets_the_addressed_channels(self):
        self.transfer(self.multi_write(enumerate([0xABC, 0, 0xFFF, 0x123])))
        self.assertEqual(self.outputs(), [0xABC, 0, 0xFFF, 0x123])
        self.transfer(self.multi_write([(2, 0x456)]))
        self.assertEqual(self.outputs(), [0xABC, 0, 0x456, 0x123])
        self.assertEqual(self.bus.read(0x114), 2)

    def test_four_dacs_have_their_own_addresses_and_outputs(self):
        for dac in (1, 2, 3):
            self.assertTrue(self.start(0x60 + dac) & self.AF, "not plugged in yet")
            self.bus.modify(self.SR1, 0, self.AF)
            self.stop()
            self.bus.write(0x110 + 0x20 * dac, 1)
        for dac in range(4):
            self.transfer(self.multi_write((n, 100 * dac + n) for n in range(4)), 0x60 + dac)
        self.bus.reset()
        for dac in range(4):
            self.assertEqual(self.outputs(dac), [100 * dac + n for n in range(4)])
        self.bus.write(self.CR1, self.PE)
        self.assertTrue(self.start(0x64) & self.AF)

    def test_with_udac_set_outputs_do_not_change(self):
        self.transfer(self.multi_write([(0, 0xABC)], hold=True))
        self.assertEqual(self.outputs(), [0, 0, 0, 0])

    def test_a_fast_write_sets_all_channels_in_order(self):
        self.transfer([0x01, 0x23, 0x04, 0x56, 0x07, 0x89, 0x0A, 0xBC])
        self.assertEqual(self.outputs(), [0x123, 0x456, 0x789, 0xABC])

    def test_a_write_to_the_eeprom_changes_nothing(self):
        self.transfer([0x50, 0x0F, 0xFF, 0x0F, 0xFF])
        self.transfer([0x58, 0x0F, 0xFF])
        self.assertEqual(self.outputs(), [0, 0, 0, 0])

    def test_an_unused_address_or_a_missing_module_is_not_acknowledged(self):
        flags = self.start(0x61)
        self.assertTrue(flags & self.AF)
        self.assertFalse(flags & (self.ADDR | self.TXE))
        self.bus.modify(self.SR1, 0, self.AF)
        self.assertFalse(self.bus.read(self.SR1) & self.AF)
        self.stop()
        self.bus.write(0x110, 0)
        self.assertTrue(self.start(0x60) & self.AF)
        self.bus.modify(self.SR1, 0, self.AF)
        self.stop()
        self.bus.write(0x110, 1)
        self.transfer(self.multi_write([(0, 1)]))

    def test_the_reset_of_the_part_keeps_the_dac_and_releases_the_bus(self):
        self.transfer(self.multi_write([(1, 0x777)]))
        self.start(0x60)
        self.bus.reset()
        self.assertEqual(self.outputs(), [0, 0x777, 0, 0])
        self.assertEqual(self.bus.read(self.SR2), 0)
        self.bus.write(self.CR1, self.PE)
        self.transfer(self.multi_write([(1, 0x111)]))

    def test_swrst_takes_the_peripheral_off_the_bus(self):
        self.start(0x60)
        self.bus.write(self.CR1, self.SWRST)
        self.assertEqual((self.bus.read(self.SR1), self.bus.read(self.SR2)), (0, 0))


class Watchdog(unittest.TestCase):
    def test_half_words_are_passed_to_the_model_as_words(self):
        written = []

        class Counter:
            def WriteDoubleWord(self, offset, value):
                written.append((offset, value))

            def ReadDoubleWord(self, offset):
                return {12: 0}[offset]

        for has_get_machine in (True, False):
            machine = Machine({"sysbus.iwdgCounter": Counter()})
            iwdg = Peripheral("iwdg.py", machine, has_get_machine)
            for offset, value in ((0, 0xCCCC), (0, 0x5555), (4, 1), (8, 2499)):
                iwdg.write(offset, value)
            self.assertEqual(written, [(0, 0xCCCC), (0, 0x5555), (4, 1), (8, 2499)])
            self.assertEqual(iwdg.read(12), 0)
            written.clear()


if __name__ == "__main__":
    unittest.main()
