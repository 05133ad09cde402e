"""Tests loader and image in simulation with pymodbus, an independent Modbus master, and with it the Python client of the
simulator.

`cargo xtask test` creates the virtual environment, sets the variables with the program and the images, and runs these
tests, and with `--tests` those of the simulator's page and of the commands in the documents. To run them directly:

    MODIO_SIM=target/debug/modio-sim MODIO_IMAGES_MODIO_02=target/thumbv7m-none-eabi/firmware python run.py
"""

import argparse
import concurrent.futures
import logging
import os
import pathlib
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
CLIENT = HERE.parents[1] / "python"
# mbpoll times out by the wall clock, so its tests run alone on the machine.
ALONE = "test_mbpoll.py"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tests", type=pathlib.Path, help="the tests of this directory instead")
    parser.add_argument("--only", type=pathlib.Path, metavar="FILE", help="the tests of one file")
    options = parser.parse_args()
    if options.only is not None:
        return tests_of(options.only)
    return all_files([options.tests] if options.tests else [HERE, CLIENT / "tests"])


def all_files(directories: list[pathlib.Path]) -> int:
    """Runs the files in parallel, each in a separate process: the simulators follow the wall clock, so the tests mostly
       wait."""
    files = [file for directory in directories for file in directory.glob("test_*.py")]
    # Start the largest first, so that none runs alone at the end.
    files.sort(key=lambda file: -file.stat().st_size)
    side_by_side = [file for file in files if file.name != ALONE]

    def run(file):
        command = [sys.executable, "-B", *sys.argv, "--only", str(file)]
        return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    failed = []

    def report(file, ended):
        print(f"{file.name}:\n{ended.stdout}", file=sys.stderr, flush=True)
        if ended.returncode != 0:
            failed.append(file.name)

    with concurrent.futures.ThreadPoolExecutor(2 * (os.cpu_count() or 1)) as pool:
        for file, ended in zip(side_by_side, pool.map(run, side_by_side)):
            report(file, ended)
    for file in files:
        if file not in side_by_side:
            report(file, run(file))
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    # A run without any tests must fail.
    return 0 if files and not failed else 1


def tests_of(file: pathlib.Path) -> int:
    """Runs the tests of one file, which can import the modules of this directory and the client."""
    sys.path[:0] = [str(CLIENT), str(HERE)]
    # Many tests expect that a unit does not answer, so do not log that.
    logging.getLogger("pymodbus").addHandler(logging.NullHandler())
    tests = unittest.defaultTestLoader.discover(str(file.parent), pattern=file.name)
    result = unittest.TextTestRunner(verbosity=2).run(tests)
    # A run without any tests must fail.
    return 0 if result.wasSuccessful() and result.testsRun else 1


if __name__ == "__main__":
    sys.exit(main())
