"""Lanes of digital inputs and marks of reported events in the chart."""

import re

from browser import OnPage
from playwright.sync_api import expect
from simulator import crc

# Function 70 switches on the events of p1.1 and p2.1, and switches off the event of its start.
SWITCH_ON = "46180f 020000 01 01 010004 01 01 0f0000 01 00"


class Lanes(OnPage):
    def corners(self, lane: int) -> list[str]:
        return self.page.locator("#lanes polyline").nth(lane).get_attribute("points").split()

    def test_lane_has_the_levels_of_its_input_at_their_times(self):
        expect(self.page.locator("#lane-names span")).to_have_text(["p5.1", "p5.2", "p5.3", "p5.4"])
        changes_ms = []
        for energised in (True, False):
            changes_ms.append(self.simulator.set_channel(2, energised=energised).virtual_ms)
            self.simulator.wait(3000)
        levels = lambda lane: [corner.split(",")[1] for corner in self.corners(lane)]
        self.eventually(lambda: levels(1), ["36.0", "36.0", "24.0", "24.0", "36.0", "36.0"])
        up, down, end = (float(self.corners(1)[n].split(",")[0]) for n in (1, 3, 5))
        # 600 units are 60 s. A change is sent with the next state, after 100 ms or, on a busy computer, some more.
        self.assertAlmostEqual(down - up, (changes_ms[1] - changes_ms[0]) / 100, delta=10)
        self.assertEqual(end, 600)
        self.assertEqual(levels(0), ["16.0", "16.0"])
        expect(self.page.locator("#lanes")).to_have_attribute("aria-label", re.compile("p5.1 off, p5.2 off"))


class FixedLanes(OnPage):
    BOARD = "fx3u-24"
    MODULE = None

    def test_lanes_of_terminals_have_the_names_on_the_board(self):
        names = self.page.locator("#lane-names span")
        expect(names).to_contain_text(["p1.1 (X0)", "p4.2 (X15)", "p4.3 (RUN)"])
        self.switch("X0").click()
        expect(self.page.locator("#lanes")).to_have_attribute("aria-label", re.compile(r"p1.1 \(X0\) on, p1.2 \(X1\) off"))


class Events(OnPage):
    BOARD = "modio-08"
    OPTIONS = ("--slot", "2=4do")

    def fetch(self, wire, confirmed=(0, 0)):
        """Fetches events, and returns the reply of the unit."""
        before = self.simulator.last_frame()
        wire.write(crc(bytes([0xFD, 0x46, 0x10, 0, 64, *confirmed])))
        replies = lambda: [each for each in self.simulator.frames(before) if each.direction == "tx"]
        self.simulator.wait_for(replies, what="no unit has replied")
        return replies()[0]

    def test_reported_events_are_marked_and_listed_with_the_time_of_their_frame(self):
        self.master.close()
        self.simulator.request(bytes.fromhex(SWITCH_ON))
        with self.simulator.wire() as wire:
            first = self.fetch(wire)
            edge_ms = self.simulator.set_channel(1, energised=True).virtual_ms
            self.simulator.wait(50)
            packet = self.fetch(wire, confirmed=(1, first.bytes[3]))
            self.assertEqual(self.fetch(wire).bytes, packet.bytes, "it is not confirmed, so the unit repeats it")
            self.simulator.request(bytes.fromhex("050004ff00"))
            last = self.fetch(wire, confirmed=(1, packet.bytes[3]))
        words = [(last, "p2.1 on"), (packet, "p1.1 on"), (first, "p1.1 off"), (first, "p2.1 off")]
        rows = self.page.locator("#events li")
        expect(rows).to_contain_text([word for _, word in words[:2]])
        texts = rows.all_text_contents()
        self.assertEqual(sorted(text.split(" s ")[1] for text in texts), sorted(word for _, word in words))
        for (frame, word), text in zip(words[:2], texts):
            self.assertAlmostEqual(float(text.split(" s ")[0]), frame.end_us / 1e6, delta=0.0006)
        self.assertLess(edge_ms / 1000, float(texts[1].split(" s ")[0]))
        marks = self.page.locator("#lanes .mark title")
        expect(marks).to_have_text([re.compile(r"^\d+\.\d{3} s p1.1 off$"), texts[1]])
        expect(self.page.get_by_role("list", name="Last events that the unit has reported")).to_be_visible()

    def test_only_good_packets_of_the_unit_are_events(self):
        # Flag, number and length, which the page does not need, and a CRC.
        packet = lambda unit, event: f"{unit:02x}4611000000{event}0000"
        frame = lambda text, **more: {"direction": "tx", "crc_ok": True, "damaged": False, "bytes": text, "end_us": 0, **more}
        edge = packet(1, "0102000201")
        frames = [frame(edge), frame(edge), frame(packet(2, "0102000201")), frame(edge, direction="rx"),
                  frame(packet(1, "0102000301"), crc_ok=False), frame(packet(1, "0102000301"), damaged=True),
                  frame("01030200000000"), frame(packet(1, "000f0000" "020400083412" "0203000cff00" "01010004" "00")),
                  frame(packet(1, "00800000")), frame(packet(1, "0107000501"))]
        words = self.page.evaluate("""async (frames) => {
            const events = await import("/events.js");
            events.reset();
            for (const frame of frames) events.add(frame, 1);
            return events.recent().map(({ words }) => words);
        }""", frames)
        self.assertEqual(words, ["p1.3 on", "started", "p3.1 4660", "p4.1 255", "p2.1 off", "edges lost", "event 5 1"])
