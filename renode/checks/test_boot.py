"""Starts the image on the Python models: from the reset vector to the first `wfi`, on Unicorn's
Cortex-M3, with renode/peripherals at the addresses in board.resc, ports that behave like Renode's
(STM32F1GPIOPort.cs), and registers that only keep written values for the timers and the UART.

There are no interrupts, so the test ends where the tasks begin: clocks, switch, flash store, module and
watchdog are set up by then. The variables MODIO_BOARD and MODIO_ELF have the board's name and the image's path.
"""

import os
import struct
import unittest
from pathlib import Path

from renode_fake import RENODE, Machine, Peripheral, commands
from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
from unicorn.arm_const import UC_ARM_REG_PC, UC_ARM_REG_SP, UC_CPU_ARM_CORTEX_M3

FLASH, RAM = 0x08000000, 0x20000000
# Bytes of flash, of a page, of RAM; the first slot's port.
PARTS = {"modio-02": (0x20000, 0x400, 0x5000, 5), "modio-08": (0x40000, 0x800, 0xC000, 1)}
WFI = b"\x30\xbf"
SECONDS = 60


class Port:
    """A port like Renode's: no pull-ups, and setting the output bit of an input has no effect."""

    def __init__(self):
        self.levels = 0
        self.registers = {0x00: 0x44444444, 0x04: 0x44444444}

    def OnGPIO(self, pin, high):
        if not self._is_output(pin):
            self._set(pin, high)

    def _is_output(self, pin):
        return self.registers[pin // 8 * 4] >> pin % 8 * 4 & 3 != 0

    def _set(self, pin, high):
        self.levels = self.levels & ~(1 << pin) | high << pin

    def read(self, offset):
        return self.levels if offset in (0x08, 0x0C) else self.registers.get(offset, 0)

    def write(self, offset, value):
        if offset != 0x10:
            self.registers[offset] = value
            return
        for pin in range(16):
            if value >> pin & 0x10001 and self._is_output(pin):
                self._set(pin, value >> pin & 1)


class Registers(dict):
    """A block that keeps written values."""

    def read(self, offset):
        return self.get(offset, 0)

    def write(self, offset, value):
        self[offset] = value


class Tag:
    """A block that the platform only names: it reads 0, and writes have no effect."""

    def read(self, offset):
        return 0

    def write(self, offset, value):
        pass


class Board:
    """The part with the image in its flash."""

    def __init__(self, board, elf, module, dip):
        self.flash_size, _, self.ram_size, _ = PARTS[board]
        self.core = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.core.ctl_set_cpu_model(UC_CPU_ARM_CORTEX_M3)
        self.core.mem_map(FLASH, self.flash_size)
        self.core.mem_map(RAM, self.ram_size)
        self.core.mem_map(0x1FFFF000, 0x1000)
        self.core.mem_write(FLASH, b"\xff" * self.flash_size)
        self._load(elf)
        self.erased, self.watchdog, self.widths, self.unknown = [], [], {}, set()
        ports = {name: Port() for name in "ABC"}
        machine = Machine({f"sysbus.gpioPort{name}": port for name, port in ports.items()})
        machine.update({"sysbus": self, "sysbus.flash": self, "sysbus.iwdgCounter": self})
        # Addresses as in board.resc.
        self.blocks = {int(address, 16): Peripheral(file, machine) for file, address in models()}
        self.blocks.update({0x40010800: ports["A"], 0x40010C00: ports["B"], 0x40011000: ports["C"]})
        for address in (0x40000000, 0x40000800, 0x40010000, 0x40012C00, 0x40013800):
            self.blocks[address] = Registers()
        # PWR in modio-02.repl: the supply is never too low.
        self.blocks[0x40007000] = Tag()
        self.system = Registers()
        self._map(0x40000000, 0x24000, self._block)
        self._map(0x42000000, 0x2000000, self._bit)
        self._map(0xE0000000, 0x100000, lambda offset, size: (self.system, offset))
        for address, value in writes(board):
            self.blocks[address & ~0x3FF].write(address & 0x3FF, value)
        run = commands(machine)
        run.mc_modio_board(board)
        run.mc_modio_preset(module)
        run.mc_modio_inputs(dip)

    def _load(self, elf):
        image = elf.read_bytes()
        (start,), (count,) = struct.unpack_from("<I", image, 28), struct.unpack_from("<H", image, 44)
        for n in range(count):
            kind, at, _, address, size = struct.unpack_from("<5I", image, start + 32 * n)
            if kind == 1 and size:
                self.core.mem_write(address, image[at : at + size])

    def _map(self, base, size, find):
        def read(_core, offset, size, _data):
            block, at = find(offset, size)
            return block.read(at) & (1 << 8 * size) - 1

        def write(_core, offset, size, value, _data):
            block, at = find(offset, size)
            block.write(at, value)

        self.core.mmio_map(base, size, read, None, write, None)

    def _block(self, offset, size):
        base = 0x40000000 + offset & ~0x3FF
        self.widths.setdefault(base, set()).add(size)
        if base not in self.blocks:
            self.unknown.add(hex(base))
        return self.blocks.setdefault(base, Registers()), offset & 0x3FF

    def _bit(self, offset, _size):
        """Returns one bit of a register, like Renode's BitBanding: the register is read and written as a word."""
        block, at = self._block(offset >> 5 & ~3, 4)
        bit = offset >> 2 & 31

        class Bit:
            read = staticmethod(lambda _: block.read(at) >> bit & 1)
            write = staticmethod(lambda _, value: block.write(at, block.read(at) & ~(1 << bit) | (value & 1) << bit))

        return Bit, at

    # What the models and commands use of the machine.

    def SetRange(self, start, count, value):
        self.erased.append((start, count))
        self.core.mem_write(FLASH + start, bytes([value]) * count)

    def WriteDoubleWord(self, offset, value):
        self.watchdog.append((offset, value))

    def ReadDoubleWord(self, at):
        return 0 if at < 0x400 else struct.unpack("<I", self.core.mem_read(at, 4))[0]

    def WriteByte(self, address, value):
        self.core.mem_write(address, bytes([value]))

    def run(self):
        """Runs to the first `wfi`. Returns whether it was reached."""
        reached = []

        def stop(core, address, _size, _data):
            reached.append(address)
            core.emu_stop()

        flash = bytes(self.core.mem_read(FLASH, self.flash_size))
        for at in range(0, len(flash), 2):
            # A hook of every instruction would take half a minute.
            if flash.startswith(WFI, at):
                self.core.hook_add(UC_HOOK_CODE, stop, begin=FLASH + at, end=FLASH + at)
        stack, entry = struct.unpack("<II", self.core.mem_read(FLASH, 8))
        self.core.reg_write(UC_ARM_REG_SP, stack)
        self.core.emu_start(entry, 0, timeout=SECONDS * 1_000_000)
        return bool(reached)

    def log(self):
        ram = bytes(self.core.mem_read(RAM, self.ram_size))
        block = ram.find(b"SEGGER RTT")
        buffer, _, written = struct.unpack_from("<3I", ram, block + 28)
        return ram[buffer - RAM : buffer - RAM + written].decode()


def models():
    for line in (RENODE / "board.resc").read_text(encoding="utf-8").splitlines():
        if line.startswith("machine PyDevFromFile $ORIGIN/peripherals/"):
            file, address = line.split("peripherals/")[1].split()[:2]
            yield file, address


def writes(board):
    """Yields what the board's script writes into the models."""
    for line in (RENODE / f"{board}-board.resc").read_text(encoding="utf-8").splitlines():
        if line.startswith("sysbus WriteDoubleWord "):
            address, value = line.split()[2:]
            yield int(address, 0), int(value, 0)


class Boot(unittest.TestCase):
    BOARD, ELF = os.environ["MODIO_BOARD"], Path(os.environ["MODIO_ELF"])
    _boards = {}

    def board(self, module="4di", dip=1, crystal=1):
        """Returns a board that has started. The same arguments return the same board."""
        how = module, dip, crystal
        if how not in self._boards:
            self._boards[how] = self._started(*how)
        return self._boards[how]

    def port(self):
        return PARTS[self.BOARD][3]

    def _started(self, module, dip, crystal):
        board = Board(self.BOARD, self.ELF, module, dip)
        board.blocks[0x40021000].write(0x3F4, crystal)
        where = lambda: hex(board.core.reg_read(UC_ARM_REG_PC))
        self.assertTrue(board.run(), f"the image hangs at {where()}")
        for base, block in board.blocks.items():
            self.assertEqual(getattr(block, "warnings", []), [], hex(base))
        self.assertEqual(board.unknown, set(), "accessed blocks without a model")
        return board

    def test_it_runs_on_the_crystal_and_logs_the_reset_cause(self):
        board = self.board()
        rcc = board.blocks[0x40021000]
        self.assertEqual(rcc.read(0x04) >> 2 & 3, 2, "SWS: the PLL")
        self.assertTrue(rcc.read(0x00) & 1 << 17, "HSERDY")
        self.assertEqual(rcc.read(0x24) >> 26, 0, "the reset flags were cleared")
        for line in ("reset: power-on", "reset: pin", "unit address 1", f"slot {self.port()}: 4di"):
            self.assertIn(line, board.log())
        self.assertNotIn("damaged", board.log())

    def test_it_runs_without_a_crystal(self):
        self.assertIn("the crystal did not start", self.board(crystal=0).log())

    def test_it_reads_the_switch(self):
        self.assertIn("unit address 165", self.board(dip=165).log())
        self.assertIn("SW01 shows 0", self.board(dip=0).log())

    def test_every_module_is_set_up(self):
        for module in commands(None).MODIO_MODULES:
            self.assertIn(f"slot {self.port()}: {module}\n", self.board(module).log())

    def test_every_slot_is_set_up(self):
        if self.BOARD != "modio-08":
            self.skipTest("the board has one slot")
        log = self.board("1=4do,2=4ao,3=4ai,4=4di").log()
        for line in ("slot 1: 4do", "slot 2: 4ao", "slot 3: 4ai", "slot 4: 4di"):
            self.assertIn(f"{line}\n", log)

    def test_the_store_makes_its_spare_page_ready(self):
        # The second page has no mark yet; the first holds the preset.
        size, page, _, _ = PARTS[self.BOARD]
        # The modio-02 stores its configuration in the last pages of the smaller part, 64 KiB.
        end = 0x10000 if self.BOARD == "modio-02" else size
        self.assertEqual(self.board().erased, [(end - page, page)])

    def test_the_watchdog_is_started_by_half_word_writes(self):
        board = self.board()
        self.assertEqual(board.widths[0x40003000], {2})
        keys = [value for offset, value in board.watchdog if offset == 0]
        # First started with the period of the start-up, then set to that of the running device.
        self.assertEqual(keys, [0xCCCC, 0x5555, 0xAAAA, 0x5555, 0xAAAA])

    def test_uart_and_timers_are_set_for_the_platforms_clocks(self):
        board = self.board()
        # 9600 bit/s from 72 MHz, and the timer at 1 kHz.
        self.assertEqual(board.blocks[0x40013800][0x08], 7500)
        scan = board.blocks[0x40000800]
        self.assertEqual((scan[0x28] + 1) * (scan[0x2C] + 1), 72_000)


if __name__ == "__main__":
    unittest.main()
