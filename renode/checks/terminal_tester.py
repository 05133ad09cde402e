"""The matcher of Renode's terminal tester in binary mode, for waits with `timeout=0`.

The behaviour was read in TerminalTester.cs of renode-infrastructure (commit edb7c2ab) and in UartKeywords.cs of
renode (commit 4ab6f235), and was observed in Renode 1.16.1. It has these properties, which the tests must handle:

- A wait without a match fails, but its pattern stays armed. The byte that completes the pattern later
  removes the match from the buffer, and no keyword reports it.
- A match removes every byte up to its end from the buffer, including the bytes in front of the match.
- A new wait replaces the armed pattern.
- The report of a failure is made once. Every later failure repeats the first report.
"""

import re


class TerminalTester:
    """Bytes that the unit has sent, and the pattern that a test waits for."""

    def __init__(self):
        self.buffer = bytearray()
        self._armed = None
        self._events = []
        self._report = None

    def receive(self, byte):
        """Takes a byte that the unit has sent."""
        self.buffer.append(byte)
        if self._armed and self._take(*self._armed) is not None:
            self._armed = None

    def wait_for_bytes(self, content, treat_as_regex=False, match_start=False):
        """Returns the bytes that match, or raises AssertionError when the buffer holds none."""
        self._armed = (content, self._pattern(content, treat_as_regex), match_start)
        matched = self._take(*self._armed)
        if matched is None:
            self._note(content, "failure")
            raise AssertionError(f"Terminal tester failed!\n\nFull report:\n{self.report()}")
        self._armed = None
        return matched

    def report(self):
        """Returns the report, which is made at the first call."""
        if self._report is None:
            self._report = "\n".join(self._events)
        return self._report

    @staticmethod
    def _pattern(content, treat_as_regex):
        if not treat_as_regex:
            return re.compile(re.escape(bytes.fromhex(content)), re.DOTALL)
        # .NET uses \z for the very end; Python before 3.14 has no \z and uses \Z.
        return re.compile(content.replace(r"\z", r"\Z").encode("latin-1"), re.DOTALL)

    def _take(self, content, pattern, match_start):
        """Removes the first match and the bytes in front of it. Returns the match, or None."""
        match = pattern.search(self.buffer)
        # Only the first match counts, even when a later one would begin at the start.
        if match is None or (match_start and match.start() != 0):
            return None
        self._note(content, "success")
        taken = match.group()
        del self.buffer[: match.end()]
        return bytes(taken)

    def _note(self, content, result):
        self._events.append(f"{self.buffer.hex(' ').upper()}\n(wait for {content}: {result})")
