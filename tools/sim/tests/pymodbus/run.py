"""Tests the firmware image in simulation with pymodbus, an independent Modbus master, and with it the Python client
of the simulator.

`cargo xtask test` creates the virtual environment and runs these tests, and with `--tests` those of the simulator's
page. To run them directly:

    python run.py --sim target/debug/modio-sim --elf target/thumbv7m-none-eabi/firmware/modio
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
    parser.add_argument("--sim", required=True, type=pathlib.Path, help="the program modio-sim")
    parser.add_argument("--elf", required=True, type=pathlib.Path, help="the image of the modio-02")
    parser.add_argument("--elf-08", type=pathlib.Path, help="the image of the modio-08")
    parser.add_argument("--elf-fx3u", type=pathlib.Path, help="the image of the fx3u-24")
    parser.add_argument("--loader", type=pathlib.Path, help="the loader of the modio-02")
    parser.add_argument("--update", type=pathlib.Path, help="the file of an update of the modio-02")
    parser.add_argument("--tests", type=pathlib.Path, help="the tests of this directory instead")
    parser.add_argument("--only", type=pathlib.Path, metavar="FILE", help="the tests of one file")
    options = parser.parse_args()
    # The tests and the client read these variables.
    for variable, file in (
            ("MODIO_SIM", options.sim), ("MODIO_ELF", options.elf), ("MODIO_ELF_08", options.elf_08),
            ("MODIO_ELF_FX3U", options.elf_fx3u),
            ("MODIO_LOADER", options.loader), ("MODIO_UPDATE", options.update)):
        if file is None:
            continue
        if not file.is_file():
            parser.error(f"there is no file {file}")
        os.environ[variable] = str(file.resolve())
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

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() + 1) as pool:
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
