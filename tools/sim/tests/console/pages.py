"""The commands of a page with the output that it shows, and the comparison of an output with it."""

import dataclasses
import re

# Patterns of texts that change from run to run, each with the text that takes their place.
CHANGES = (
    (r"(?<![\d.])\d+\.\d+\.\d+(-dev)?(?=\s|$)", "VERSION"),
    (r"/dev/pts/\d+", "/dev/pts/N"),
    (r"\b\d\d:\d\d:\d\d\.\d{3}\b", "TIME"),
    # Columns are as wide as their longest text.
    (r"(?<=\S)\s{2,}", "  "),
    (r"\s+$", ""),
)
# Messages of bash about its jobs.
OF_BASH = re.compile(r"\[\d+\][+-]? .*")


@dataclasses.dataclass
class Command:
    """A command, the number of its line, and the lines that the page shows as its output."""

    line: int
    text: str
    shown: list[str]

    @property
    def status(self) -> int:
        """The exit status, which the page names in a comment when it is not 0."""
        named = re.search(r"# exit status (\d+)$", self.text)
        return int(named[1]) if named else 0


@dataclasses.dataclass
class Block:
    """A block of commands. `board` has the simulator's options in `console run OPTIONS`."""

    run: bool
    board: str
    commands: list[Command]


def blocks(page: str) -> list[Block]:
    """Returns the blocks of a page that are marked `console`."""
    found = []
    lines = enumerate(page.splitlines(), 1)
    for _, line in lines:
        fence = re.fullmatch(r"( *)```console( run(?: (.*))?)?", line)
        if fence is None:
            continue
        block = Block(fence[2] is not None, fence[3] or "", [])
        end_of_text = None
        for number, line in lines:
            line = line.removeprefix(fence[1])
            if line == "```":
                break
            if end_of_text is not None:
                block.commands[-1].text += f"\n{line}"
                end_of_text = None if line == end_of_text else end_of_text
            elif line.startswith("$ "):
                block.commands.append(Command(number, line[2:], []))
                here = re.search(r"<<'(\w+)'", line)
                end_of_text = here and here[1]
            else:
                assert block.commands, f"line {number}: an output without a command: {line}"
                block.commands[-1].shown.append(line)
        found.append(block)
    return found


def plain(line: str) -> str:
    """Returns a line without what changes."""
    for pattern, instead in CHANGES:
        line = re.sub(pattern, instead, line)
    return line


def difference(shown: list[str], printed: str) -> str:
    """Compares an output with the lines of a page, in which `...` stands for any lines. Returns the fault, or ''."""
    lines = [line for line in printed.splitlines() if not OF_BASH.fullmatch(line)]
    # Some programs end with an empty line.
    while lines and not lines[-1]:
        lines.pop()
    pattern = "".join(r"(.*\n)*" if line == "..." else re.escape(plain(line)) + r"\n" for line in shown)
    text = "".join(plain(line) + "\n" for line in lines)
    if re.fullmatch(pattern, text):
        return ""
    return "\n".join(["the page shows:", *shown, "printed was:", *lines])
