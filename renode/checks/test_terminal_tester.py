"""Tests that the replacement for Renode's terminal tester behaves like Renode's, and that the suites handle this."""

import re
import unittest

from renode_fake import RENODE
from terminal_tester import TerminalTester

REPLY = "01 03 02 00 01 79 84"


def wait_in(keyword):
    """Returns the content and the options of the wait in a keyword of modio.resource."""
    text = (RENODE / "tests" / "modio.resource").read_text(encoding="utf-8")
    body = text.split(f"\n{keyword}\n")[1].split("\n\n")[0]
    words = re.split(r"\s{2,}", body[body.index("Wait For Bytes On Uart") :].strip())[1:]
    # Robot Framework reads two backslashes as one.
    content = words[0].replace("\\\\", "\\")
    options = dict(word.split("=") for word in words[1:])
    assert options.pop("timeout") == "0"
    return {
        "content": content,
        "treat_as_regex": options.pop("treatAsRegex", "false") == "true",
        "match_start": options.pop("matchStart", "false") == "true",
        **options,
    }


class Waits(unittest.TestCase):
    def setUp(self):
        self.tester = TerminalTester()

    def receive(self, text):
        for byte in bytes.fromhex(text):
            self.tester.receive(byte)

    def test_failed_wait_for_any_byte_takes_the_first_byte_of_the_next_reply(self):
        with self.assertRaises(AssertionError):
            self.tester.wait_for_bytes(".", treat_as_regex=True)
        self.receive(REPLY)
        with self.assertRaises(AssertionError):
            self.tester.wait_for_bytes(REPLY, match_start=True)
        self.assertEqual(self.tester.buffer.hex(" "), REPLY[3:])

    def test_nothing_was_received_keeps_the_next_reply_complete(self):
        wait = wait_in("Nothing Was Received")
        self.assertEqual(self.tester.wait_for_bytes(**wait), b"")
        self.receive(REPLY)
        self.assertEqual(self.tester.wait_for_bytes(REPLY, match_start=True).hex(" "), REPLY)
        self.assertEqual(self.tester.wait_for_bytes(**wait), b"")

    def test_nothing_was_received_fails_when_a_byte_was_received(self):
        self.receive("00")
        with self.assertRaises(AssertionError):
            self.tester.wait_for_bytes(**wait_in("Nothing Was Received"))

    def test_match_removes_the_bytes_in_front_of_it(self):
        self.receive("AA BB 01 02 CC")
        self.assertEqual(self.tester.wait_for_bytes("01 02"), b"\x01\x02")
        self.assertEqual(self.tester.buffer, b"\xcc")

    def test_match_at_the_start_refuses_bytes_in_front_of_it(self):
        self.receive("AA 01 02")
        with self.assertRaises(AssertionError):
            self.tester.wait_for_bytes("01 02", match_start=True)
        self.assertEqual(self.tester.buffer, b"\xaa\x01\x02")

    def test_new_wait_replaces_the_armed_pattern(self):
        for pattern in (".", "FF"):
            with self.assertRaises(AssertionError):
                self.tester.wait_for_bytes(pattern, treat_as_regex=True)
        self.receive(REPLY)
        self.assertEqual(self.tester.buffer.hex(" "), REPLY)

    def test_armed_pattern_takes_one_match_only(self):
        with self.assertRaises(AssertionError):
            self.tester.wait_for_bytes("01")
        self.receive("01 01")
        self.assertEqual(self.tester.buffer, b"\x01")

    def test_second_failure_repeats_the_first_report(self):
        messages = []
        for received in ("AA", "BB"):
            self.receive(received)
            with self.assertRaises(AssertionError) as failure:
                self.tester.wait_for_bytes("01")
            messages.append(str(failure.exception))
        self.assertIn("AA", messages[0])
        self.assertNotIn("BB", messages[1])
        self.assertEqual(messages[0], messages[1])

    def test_dot_in_a_pattern_matches_every_byte_value(self):
        for value in range(256):
            self.tester.receive(value)
            self.assertEqual(self.tester.wait_for_bytes(".", treat_as_regex=True), bytes([value]))


class Suites(unittest.TestCase):
    def test_no_suite_expects_a_keyword_to_fail(self):
        # A failed wait stays armed, so a test that continues after one loses bytes.
        expects = re.compile(r"Run Keyword And (Expect|Ignore|Return Status|Warn|Continue)|^\s*(TRY|EXCEPT)\b", re.M)
        files = [*(RENODE / "tests").glob("*.robot"), *(RENODE / "tests").glob("*.resource")]
        self.assertGreater(len(files), 5)
        for file in files:
            self.assertIsNone(expects.search(file.read_text(encoding="utf-8")), file)


if __name__ == "__main__":
    unittest.main()
