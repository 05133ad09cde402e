"""Drives the firmware image in simulation with pymodbus, a Modbus master nobody here wrote.

Run by `cargo xtask test`, which makes the virtual environment; by hand:

    python run.py --sim target/debug/modio-sim --elf target/thumbv7m-none-eabi/firmware/modio
"""

import argparse
import logging
import pathlib
import sys
import unittest

import simulator


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sim", required=True, type=pathlib.Path, help="the program modio-sim")
    parser.add_argument("--elf", required=True, type=pathlib.Path, help="the firmware image")
    options = parser.parse_args()
    for file in (options.sim, options.elf):
        if not file.is_file():
            parser.error(f"there is no file {file}")
    simulator.PROGRAM = options.sim.resolve()
    simulator.IMAGE = options.elf.resolve()

    # That a unit stays silent is what many tests want, and nothing to log.
    logging.getLogger("pymodbus").addHandler(logging.NullHandler())

    here = pathlib.Path(__file__).parent
    tests = unittest.defaultTestLoader.discover(str(here), pattern="test_*.py")
    result = unittest.TextTestRunner(verbosity=2).run(tests)
    # No tests at all must not look like success.
    return 0 if result.wasSuccessful() and result.testsRun else 1


if __name__ == "__main__":
    sys.exit(main())
