"""Runs the example of docs/simulator-http.md and compares its output with the page."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import modio_sim

ROOT = pathlib.Path(__file__).resolve().parents[4]


class Example(unittest.TestCase):
    def test_the_example_of_the_python_client_prints_what_the_docs_say(self):
        text = (ROOT / "docs/simulator-http.md").read_text()
        [(program, printed)] = re.findall(r"```python\n(.+?)```\n\n```text\n(.+?)```", text, re.DOTALL)
        with tempfile.TemporaryDirectory() as directory:
            # Adds the option for the image, which a released simulator does not need.
            simulator = pathlib.Path(directory, "modio-sim")
            simulator.write_text(f'#!/bin/sh\nexec "{os.environ["MODIO_SIM"]}" --elf "{os.environ["MODIO_ELF"]}" "$@"\n')
            simulator.chmod(0o755)
            client = str(pathlib.Path(modio_sim.__file__).parents[1])
            run = subprocess.run(
                [sys.executable, "-B", "-"], input=program, capture_output=True, text=True, timeout=120,
                env={**os.environ, "MODIO_SIM": str(simulator), "PYTHONPATH": client})
        self.assertEqual((run.stdout, run.stderr), (printed, ""))
