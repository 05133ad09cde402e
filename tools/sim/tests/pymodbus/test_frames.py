"""Frames that a correct master never sends, byte by byte on the line."""

from simulator import OnSimulator, crc

# Reads the four points of the slot of unit 1.
GOOD = crc(bytes([1, 1, 0x00, 0x10, 0, 4]))


class Frames(OnSimulator):
    MODULE = "4di"

    def setUp(self):
        self.line = self.simulator.wire()
        self.addCleanup(self.line.close)

    def ask(self, frame: bytes) -> bytes:
        """Returns the answer to a frame; empty if there is none."""
        since = self.simulator.last_frame()
        self.line.write(frame)
        answer = self.simulator.answer_to(since)
        # The master must receive exactly the bytes that were on the line.
        self.assertEqual(self.line.read(len(answer)), answer)
        self.assertEqual(self.line.in_waiting, 0)
        return answer

    def answers(self):
        """Asserts that a valid request is answered."""
        self.assertEqual(self.ask(GOOD), crc(bytes([1, 1, 1, 0])))

    def ignored(self, frame: bytes):
        """Asserts that a frame gets no answer, and that the unit still answers the next request."""
        self.assertEqual(self.ask(frame), b"", frame.hex(" "))
        self.answers()

    def test_a_good_frame_is_answered(self):
        self.answers()

    def test_a_bad_crc_is_ignored(self):
        self.ignored(GOOD[:-1] + bytes([GOOD[-1] ^ 1]))
        self.ignored(GOOD[:-2] + GOOD[:-3:-1])
        self.ignored(bytes([GOOD[0] ^ 0x80]) + GOOD[1:])
        self.ignored(bytes([1, 0x55, 0, 0, 0, 0]))

    def test_an_unknown_function_is_refused(self):
        for function in (0x09, 0x41, 0x64, 0x7F):
            answer = self.ask(crc(bytes([1, function, 0, 0])))
            self.assertEqual(answer, crc(bytes([1, function | 0x80, 1])), hex(function))
        self.answers()

    def test_quantities_out_of_range_are_refused(self):
        for quantity in (0, 2001, 0xFFFF):
            answer = self.ask(crc(bytes([1, 1, 0x00, 0x10]) + quantity.to_bytes(2, "big")))
            self.assertEqual(answer, crc(bytes([1, 0x81, 3])), quantity)

    def test_noise_is_ignored(self):
        for noise in (b"\x00", b"\xff\xff", b"\x01\x01\x00"):
            self.ignored(noise)

    def test_a_frame_of_300_bytes_is_ignored(self):
        self.ignored(crc(bytes([1, 1]) + bytes(296)))
        self.ignored(bytes([0x55]) * 300)

    def test_a_frame_of_257_bytes_is_ignored(self):
        self.ignored(crc(bytes([1, 0x41]) + bytes(253)))

    def test_a_frame_of_256_bytes_is_still_a_frame(self):
        answer = self.ask(crc(bytes([1, 0x41]) + bytes(252)))
        self.assertEqual(answer, crc(bytes([1, 0xC1, 1])))

    def test_two_requests_without_a_gap_are_both_lost(self):
        self.ignored(GOOD + GOOD)

    def test_a_request_with_a_long_gap_inside_is_lost(self):
        since = self.simulator.last_frame()
        self.line.write(GOOD[:4])
        self.assertEqual(self.simulator.answer_to(since), b"")
        self.ignored(GOOD[4:])

    def test_the_bytes_on_the_line_are_recorded(self):
        since = self.simulator.last_frame()
        self.answers()
        request, response = self.simulator.frames(since)
        self.assertEqual((request.direction, response.direction), ("rx", "tx"))
        self.assertEqual(request.bytes, GOOD)
        self.assertTrue(request.crc_ok and response.crc_ok)
        # t3.5 at 9600 bit/s is 4.01 ms: the answer must not begin before, nor much later.
        gap = response.start_us - request.end_us
        self.assertGreaterEqual(gap, 4010)
        self.assertLess(gap, 6000)
