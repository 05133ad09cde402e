"""Runs the blocks `console run` of the pages, and compares what they print with the pages: docs/testing.md says how."""

import concurrent.futures
import os
import pathlib
import re
import tempfile
import unittest

import pages
from terminal import Terminal

ROOT = pathlib.Path(__file__).resolve().parents[4]
# The slowest first.
PAGES = ("docs/commissioning.md", "README.md", "docs/boards.md", "docs/exports.md", "docs/time-and-links.md",
         "docs/outputs.md")
# Commands that are not run, by page and beginning, each with the reason. A block in which a command is neither here nor
# marked to be run is an error.
NOT_RUN = {
    ("README.md", "python3 -m venv"): "needs the network; the environment of this test stands for it",
    ("README.md", "cargo install"): "compiles for minutes; the step has built the program",
    ("README.md", "cargo xtask flash"): "needs a probe",
    ("README.md", "cargo xtask attach"): "needs a probe",
    ("README.md", "cargo xtask keygen"): "belongs to cargo xtask flash; xtask tests it",
    ("README.md", "cargo xtask build"): "is the step image",
    ("README.md", "st-flash"): "needs a probe",
    ("README.md", "cargo xtask test"): "contains this test",
    ("docs/commissioning.md", "modioctl --unit 1 watch p5.1 p5.2 --csv"): "does not end",
}

# Right and wrong commands.
PAGE = """```console run
$ echo version 0.3.0-dev
version 0.3.0
$ echo one
two
$ false
$ (exit 3)                      # exit status 3
$ seq 5
1
...
5
$ sleep 0.1 &
```
```console
$ true
```
"""


def reason(page: str, command: pages.Command) -> tuple[str, str] | None:
    """Returns the entry of a command that is not run."""
    return next((entry for entry in NOT_RUN if entry[0] == page and command.text.startswith(entry[1])), None)


def faults(page: str, text: str) -> list[str]:
    """Runs the blocks of a page in one shell, in their order, and returns what is wrong."""
    wrong = []
    with tempfile.TemporaryDirectory(prefix="modio-") as directory:
        terminal = Terminal(pathlib.Path(directory))
        try:
            for block in pages.blocks(text):
                wrong += faults_of(page, block, terminal)
        except AssertionError as error:
            wrong.append(f"{page}: {error}")
        finally:
            terminal.close()
    return wrong


def faults_of(page: str, block: pages.Block, terminal: Terminal) -> list[str]:
    wrong = []
    if block.board:
        terminal.connect(block.board)
    for command in block.commands:
        if reason(page, command):
            continue
        where = f"{page}:{command.line}: `{command.text}`"
        if not block.run:
            wrong.append(f"{where}: the block is not marked `console run`, and the test has no reason for it")
            continue
        if command.text.split(" #")[0].rstrip().endswith("&"):
            if not command.shown:
                wrong.append(f"{where}: shows no line for which to wait")
            status, printed = terminal.start(command.text, command.shown)
        else:
            # A scan waits 25 ms for each address, which a busy machine may exceed.
            for _ in range(3 if " scan" in command.text else 1):
                status, printed = terminal.run(command.text)
                if not pages.difference(command.shown, printed):
                    break
        if status != command.status:
            wrong.append(f"{where}: exit status {status}, expected {command.status}")
        if difference := pages.difference(command.shown, printed):
            wrong.append(f"{where}\n{difference}")
    return wrong


class Console(unittest.TestCase):
    def test_the_commands_of_the_pages_print_what_the_pages_show(self):
        chosen = os.environ.get("MODIO_PAGES", " ".join(PAGES)).split()
        texts = [(ROOT / page).read_text() for page in chosen]
        # The simulators follow the wall clock, so the commands mostly wait.
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            wrong = [fault for of_page in pool.map(faults, chosen, texts) for fault in of_page]
        if wrong:
            self.fail("\n\n" + "\n\n".join(wrong))

    def test_every_block_of_commands_in_any_page_is_one_that_the_test_knows(self):
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
            page, text = str(path.relative_to(ROOT)), path.read_text()
            fences = re.findall(r"^ *```(console\b.*)$", text, re.MULTILINE)
            run = [fence for fence in fences if fence != "console"]
            with self.subTest(page):
                self.assertTrue(page in PAGES or not run, "its blocks are marked, and no test runs them")
                self.assertEqual(len(pages.blocks(text)), len(fences), "a mark is none of `console` and `console run`")

    def test_every_reason_is_that_of_a_command(self):
        commands = [(page, command) for page in PAGES for block in pages.blocks((ROOT / page).read_text())
                    for command in block.commands]
        used = {reason(page, command) for page, command in commands}
        self.assertEqual(set(NOT_RUN) - used, set())

    def test_a_wrong_output_a_failure_and_an_unmarked_block_are_faults(self):
        self.assertEqual(faults("page.md", PAGE), [
            "page.md:4: `echo one`\nthe page shows:\ntwo\nprinted was:\none",
            "page.md:6: `false`: exit status 1, expected 0",
            "page.md:12: `sleep 0.1 &`: shows no line for which to wait",
            "page.md:15: `true`: the block is not marked `console run`, and the test has no reason for it",
        ])
