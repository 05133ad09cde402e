"""Runs the example of docs/simulator-http.md and compares its output with the page, and the one of docs/update.md."""

import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

import modio_sim
from simulator import Simulator, firmware, images

ROOT = pathlib.Path(__file__).resolve().parents[4]


class Example(unittest.TestCase):
    def test_the_example_of_the_python_client_prints_what_the_docs_say(self):
        text = (ROOT / "docs/simulator-http.md").read_text()
        [(program, printed)] = re.findall(r"```python\n(.+?)```\n\n```text\n(.+?)```", text, re.DOTALL)
        with tempfile.TemporaryDirectory() as directory:
            # Adds the options for loader and image, which a released simulator does not need.
            simulator = pathlib.Path(directory, "modio-sim")
            command = shlex.join([os.environ["MODIO_SIM"], *firmware()])
            simulator.write_text(f'#!/bin/sh\nexec {command} "$@"\n')
            simulator.chmod(0o755)
            client = str(pathlib.Path(modio_sim.__file__).parents[1])
            run = subprocess.run(
                [sys.executable, "-B", "-"], input=program, capture_output=True, text=True, timeout=120,
                env={**os.environ, "MODIO_SIM": str(simulator), "PYTHONPATH": client})
        self.assertEqual((run.stdout, run.stderr), (printed, ""))


class Update(unittest.TestCase):
    def test_the_script_of_the_page_about_updates_updates_a_unit(self):
        text = (ROOT / "docs/update.md").read_text()
        [program] = [part for part in re.findall(r"```python\n(.+?)```", text, re.DOTALL) if "pymodbus" in part]
        self.assertLessEqual(program.count("\n"), 40)
        image = images() / "modio-02.modio"
        simulator = Simulator.of()
        self.addCleanup(simulator.end_well)
        # At 9600 bit/s the update takes minutes.
        master = simulator.master()
        for address, value in ((0x0100, 0x5A17), (0x0101, 1152), (0x0108, 1), (0x0108, 2)):
            self.assertFalse(master.write_register(address, value).isError())
        master.close()
        simulator.wait(500)
        self.assertIn("baudrate=9600", program)
        program = program.replace("9600", "115200")
        run = subprocess.run(
            [sys.executable, "-B", "-", simulator.pty, "1", image], input=program, capture_output=True, text=True,
            timeout=300)
        self.assertEqual((run.stdout, run.stderr), ("updated\n", ""))
        self.assertEqual(simulator.state().line.baud, 115200)
