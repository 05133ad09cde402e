"""Checks that what the scripts and suites for Renode name is there: files, commands and devices."""

import re
import unittest
from pathlib import Path

RENODE = Path(__file__).resolve().parent.parent
SCRIPTS = sorted(RENODE.glob("*.resc"))
SUITES = sorted([*RENODE.glob("tests/**/*.robot"), *RENODE.glob("tests/*.resource")])

# Devices of Renode's stock platform that the scripts and suites name; a port's letter may be added by a program.
STOCK = {"cpu", "sram", "flash", "usart1", "gpioPort", "gpioPortA", "gpioPortB", "gpioPortC", "dma1"}


def found(pattern, files):
    return {name for file in files for name in re.findall(pattern, file.read_text(encoding="utf-8"))}


class Names(unittest.TestCase):
    def test_every_included_file_exists_and_every_model_is_used(self):
        files = found(r"\$ORIGIN/((?!\.\.)[\w./-]+)", SCRIPTS)
        self.assertGreater(len(files), 10)
        for file in files:
            self.assertTrue((RENODE / file).exists(), file)
        models = {f"peripherals/{file.name}" for file in RENODE.glob("peripherals/*.py")}
        self.assertEqual({file for file in files if file.startswith("peripherals/")}, models)

    def test_every_command_is_defined(self):
        used = found(r"(?m)^(modio_\w+)", SCRIPTS)
        used |= found(r"Execute Command +(modio_\w+)", SUITES)
        defined = found(r"def mc_(\w+)\(", [RENODE / "commands.py", RENODE / "exact-line.py"])
        self.assertTrue(used)
        self.assertLessEqual(used, defined)

    def test_every_board_has_its_differences(self):
        boards = {file.name.replace("-board.resc", "") for file in RENODE.glob("*-board.resc")}
        for file in ("commands.py", "tests/boards.py"):
            self.assertEqual(found(r'(?m)^    "([\w-]+)": [({]', [RENODE / file]), boards, file)

    def test_every_device_is_on_the_platform(self):
        own = found(r"(?m)^(\w+):", sorted(RENODE.glob("*.repl")))
        own |= found(r'(?m)"(\w+)"$', [RENODE / "board.resc"])
        for file in [*SCRIPTS, *SUITES, RENODE / "commands.py", RENODE / "exact-line.py"]:
            for name in found(r"sysbus\.([a-z]\w*)", [file]):
                self.assertIn(name, STOCK | own, file)


if __name__ == "__main__":
    unittest.main()
