"""The frame log, the findings, and a page that stays open."""

import re
import socket

from browser import OnPage
from playwright.sync_api import expect
from simulator import PATIENCE, Simulator, crc


class Frames(OnPage):
    def setUp(self):
        super().setUp()
        self.page.get_by_role("button", name="Clear").click()
        self.rows = self.page.locator("#frames tr")

    def texts(self, column: str) -> list[str]:
        return self.page.locator(f"#frames tr:not([hidden]) td.{column}").all_text_contents()

    def test_frames_have_meaning_gap_turnaround_and_silence(self):
        self.good(self.master.read_coils(0x0010, count=4))
        self.master.read_coils(0x0077, count=1)
        expect(self.rows).to_have_count(4)
        self.assertEqual(self.texts("from"), ["master", "unit"] * 2)
        meaning = self.texts("meaning")
        self.assertIn("read coils 0x0010 x 4", meaning[0])
        self.assertIn("read coils 0x0010 = 0000", meaning[1])
        self.assertIn("exception 02", meaning[3])
        frames = self.simulator.frames()[-4:]
        self.assertEqual([text.replace(" ", "") for text in self.texts("bytes")], [f.bytes.hex() for f in frames])
        gaps = self.texts("gap")
        for text, before, after in zip(gaps[1:], frames[:-1], frames[1:], strict=True):
            # Each instant is in whole microseconds, so their difference may be 1 us off.
            self.assertAlmostEqual(float(text), (after.start_us - before.end_us) / 1000, delta=0.0061)
        self.assertEqual(self.texts("turnaround"), ["", gaps[1], "", gaps[3]])
        # Half a character at 9600 bit/s.
        self.assertEqual([text != "" and float(text) < 573 for text in self.texts("silence")], [False, True] * 2)

    def test_filter_shows_only_frames_with_all_words(self):
        self.good(self.master.read_coils(0x0010, count=4))
        self.master.read_coils(0x0077, count=1)
        expect(self.rows).to_have_count(4)
        box = self.page.get_by_label("Show only frames with")
        for words, wanted in (("exception", 1), ("read master", 2), ("01 81", 1), ("0181", 1), ("EXCEPTION unit", 1),
                              ("nothing of that", 0), ("", 4)):
            box.fill(words)
            expect(self.page.locator("#frames tr:not([hidden])")).to_have_count(wanted)
        box.fill("exception")
        self.good(self.master.read_coils(0x0010, count=4))
        expect(self.rows).to_have_count(6)
        expect(self.page.locator("#frames tr:not([hidden])")).to_have_count(1)
        expect(self.page.locator("#frame-count")).to_have_text("1 of 6 frames")

    def test_bad_frame_is_marked(self):
        self.master.close()
        with self.simulator.wire() as wire:
            wire.write(b"\x01\x02\x03\x04\x05")
        expect(self.page.locator("#frames tr.bad")).to_have_count(1)
        expect(self.page.locator("#frames tr.bad td.meaning")).to_contain_text("bad CRC")

    def test_request_without_a_reply_is_marked(self):
        self.master.close()
        unanswered = self.page.locator("#frames tr.unanswered")
        # Units never answer a broadcast.
        for request in (b"\x09\x07", b"\x01\x07", b"\x00\x06\x00\x10\x00\x00", b"\x08\x07"):
            with self.simulator.wire() as wire:
                wire.write(crc(request))
                self.simulator.wait(100)
        expect(self.rows).to_have_count(5)
        expect(unanswered.locator("td.meaning")).to_contain_text(["unit 9", "unit 8"])

    def test_page_opened_later_shows_earlier_frames(self):
        self.good(self.master.read_coils(0x0010, count=4))
        count = len(self.simulator.frames())
        expect(self.open().locator("#frames tr")).to_have_count(min(count, 500))

    def open_without_earlier_frames(self):
        """Opens another page, whose request for the earlier frames is answered by the function that is returned."""
        page, waiting = self.open(load=False), []
        page.route("**/api/frames", lambda route: waiting.append((route, route.fetch())))
        self.load(page)
        while not waiting:
            page.wait_for_timeout(5)

        def answer():
            route, response = waiting.pop()
            route.fulfill(response=response)
        return page, answer

    def test_frames_on_the_line_while_the_page_fetches_the_earlier_ones_are_kept(self):
        self.good(self.master.read_coils(0x0010, count=4))
        page, answer = self.open_without_earlier_frames()
        for _ in range(2):
            self.good(self.master.read_coils(0x0010, count=4))
        # The other page has them, so this one has them too.
        expect(self.rows).to_have_count(6)
        answer()
        expect(page.locator("#frames tr")).to_have_count(min(len(self.simulator.frames()), 500))

    def test_log_that_is_cleared_while_the_page_fetches_the_earlier_frames_stays_clear(self):
        self.good(self.master.read_coils(0x0010, count=4))
        page, answer = self.open_without_earlier_frames()
        page.get_by_role("button", name="Clear").click()
        self.assertTrue(self.master.read_coils(0x0077, count=4).isError())
        expect(self.rows).to_have_count(4)
        answer()
        expect(page.locator("#frames tr")).to_have_count(2)
        expect(page.locator("#frames tr td.meaning").last).to_contain_text("exception 02")

    def test_findings_of_the_chip_are_shown(self):
        expect(self.page.locator("#findings")).to_have_text("none")
        finding = {"at_us": 1_500_000, "pc": "0x08001234", "what": "an access to nothing", "count": 3}
        self.page.route("**/api/findings", lambda route: route.fulfill(json={"findings": [finding]}))
        expect(self.page.locator("#findings li")).to_have_text(
            "1.500 s, pc 0x08001234an access to nothing (3 times)")


class LeftOpen(OnPage):
    REQUESTS = 2500

    def test_page_does_not_grow_with_the_frames_on_the_line(self):
        # KEY, BAUD 921600, COMMAND: save, restart.
        for address, value in ((0x0100, 0x5A17), (0x0101, 9216), (0x0108, 1), (0x0108, 2)):
            self.good(self.master.write_register(address, value))
        self.master.close()
        self.simulator.wait(300)
        self.assertEqual(self.simulator.state().line.baud, 921600)
        nodes = lambda: self.page.evaluate("document.querySelectorAll('*').length")
        rows = self.page.locator("#frames tr")
        before = self.simulator.last_frame()
        self.ask(300)
        expect(rows).to_have_count(500)
        half_way = nodes()
        self.ask(self.REQUESTS - 300)
        last = self.simulator.last_frame()
        self.assertGreaterEqual(last - before, 2 * self.REQUESTS)
        shown = f"{self.simulator.frames(last - 1)[0].start_us / 1e6:.3f}"
        expect(rows.last.locator("td.time")).to_have_text(shown)
        expect(rows).to_have_count(500)
        self.assertEqual(self.page.locator("#frames").evaluate("e => e.rows.length"), 500)
        # LEDs blink, but no element is added.
        self.assertLessEqual(abs(nodes() - half_way), 5)

    def ask(self, count: int):
        """Sends `count` requests, each after the reply to the previous one."""
        body = b"\x01\x01\x00\x10\x00\x04"
        request, answer = crc(body), 6
        with self.simulator.wire() as wire:
            wire.baudrate = 921600
            for _ in range(count):
                wire.write(request)
                self.assertEqual(len(wire.read(answer)), answer)


class StartedAgain(OnPage):
    def is_expected(self, message) -> bool:
        # A simulator that stops answers with 503, then not at all.
        return super().is_expected(message) or any(text in message.text for text in ("503", "net::ERR"))

    def test_page_reconnects_to_a_restarted_simulator(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"127.0.0.1:{free.getsockname()[1]}"
        first = Simulator.of(http=address)
        self.addCleanup(first.close)
        own, self.simulator = self.simulator, first
        self.addCleanup(setattr, self, "simulator", own)
        page = self.open()
        master = first.master()
        for _ in range(3):
            self.good(master.read_coils(0x0010, count=4))
        master.close()
        expect(page.locator("#frames tr")).to_have_count(6)
        first.close()
        expect(page.locator("#connection")).to_have_text(re.compile("^OFFLINE: .* does not answer"))
        expect(page.locator("#board")).to_have_attribute("inert", "")
        # Some answers of the new one are lost.
        for path in ("frames", "endpoints"):
            page.route(f"**/api/{path}", lambda route: route.fulfill(status=503), times=1)
        second = Simulator.of(http=address, module="4do")
        self.addCleanup(second.close)
        master = second.master()
        self.addCleanup(master.close)
        expect(page.locator("#connection")).to_have_text("live", timeout=PATIENCE * 1000)
        self.good(master.write_coil(0x0010, True))
        expect(page.get_by_role("switch", name="Digital output p5.1")).to_have_text("conducts")
        expect(page.locator("#frames tr")).to_have_count(2)
        expect(page.locator("#endpoints dd")).to_have_text(list(second.endpoints().values()))
