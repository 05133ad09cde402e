"""The links of a board with several slots, on the page and in the unit."""

import struct

from browser import OnPage
from playwright.sync_api import expect

# First links of p2.1 and p2.2.
LINKS = (0x0410, 0x0414)
NONE = [0xFFFF, 0, 0, 0]
# RANGE and SCALE of p3.1.
RANGE, SCALE = 0x0188, 0x01A8


class Links(OnPage):
    BOARD = "modio-08"
    MODULE = None
    OPTIONS = ("--slot", "1=4di", "--slot", "2=4do", "--slot", "3=4ai")

    def setUp(self):
        super().setUp()
        self.write(LINKS[0], NONE + NONE)

    def write(self, first: int, words: list[int]):
        """Writes registers as the page does: the master of the tests also receives the requests of the page."""
        head = struct.pack(">BHHB", 0x10, first, len(words), 2 * len(words))
        for request in (bytes.fromhex("0601005a17"), head + struct.pack(f">{len(words)}H", *words)):
            self.assertLess(self.simulator.request(request)[0], 0x80)

    def unit(self, link: int = 0):
        reply = self.simulator.request(struct.pack(">BHH", 3, LINKS[link], 4))
        return list(struct.unpack(">4H", reply[2:]))

    def read(self):
        self.page.get_by_role("button", name="Read the links").click()
        expect(self.page.get_by_role("button", name="Add")).to_be_visible()

    def add(self, output: str):
        self.page.get_by_label("New link of").select_option(label=output)
        self.page.get_by_role("button", name="Add").click()

    def test_button_of_the_page_acts_on_an_output(self):
        self.read()
        expect(self.page.locator("#links-none")).to_have_text("The unit has no links.")
        self.add("p2.2")
        self.page.get_by_label("Input of link 1 of p2.2").select_option(label="p1.3")
        self.page.get_by_label("Condition of link 1 of p2.2").select_option(label="only without a master")
        self.eventually(lambda: self.unit(1), [2, 0x103, 0, 0])
        self.page.get_by_label("Condition of link 1 of p2.2").select_option(label="always")
        self.eventually(lambda: self.unit(1), [2, 3, 0, 0])
        self.page.get_by_label("Action of link 1 of p2.2").select_option(label="change")
        self.eventually(lambda: self.unit(1), [2, 7, 0, 0])
        # A link acts a second after it was written.
        self.simulator.wait(1100)
        self.switch("Digital input p1.3").click()
        self.is_on("Digital output p2.2", "conducts")
        self.switch("Digital input p1.3").click()
        self.is_on("Digital output p2.2", "off", False)
        self.page.get_by_role("button", name="Remove link 1 of p2.2").click()
        self.eventually(lambda: self.unit(1), NONE)

    def test_pulse_and_thresholds_have_their_units(self):
        self.write(RANGE, [2])
        self.write(SCALE, [1])
        self.read()
        self.add("p2.1")
        self.page.get_by_label("Action of link 1 of p2.1").select_option(label="pulse")
        time = self.page.get_by_label("Time of link 1 of p2.1")
        expect(time).to_have_value("1.0")
        time.fill("90")
        self.page.keyboard.press("Enter")
        self.eventually(self.unit, [0, 4, 900, 0])
        self.page.get_by_label("Input of link 1 of p2.1").select_option(label="p3.1")
        self.page.get_by_label("Action of link 1 of p2.1").select_option(label="invert")
        self.page.get_by_label("Upper threshold of link 1 of p2.1").fill("18")
        self.page.keyboard.press("Enter")
        self.page.get_by_label("Lower threshold of link 1 of p2.1").fill("-5.5")
        self.page.keyboard.press("Enter")
        self.eventually(self.unit, [8, 2, 180, 0xFFC9])
        expect(self.page.locator("#links-rows tr")).to_contain_text("°C")

    def test_value_that_is_typed_while_another_change_is_written_is_kept(self):
        self.write(RANGE, [2])
        self.write(SCALE, [1])
        self.write(LINKS[0], [8, 1, 180, 150])
        self.read()
        held = []
        self.page.route("**/pdu", lambda route: held.append(route))
        self.page.get_by_label("Action of link 1 of p2.1").select_option(label="invert")
        lower = self.page.get_by_label("Lower threshold of link 1 of p2.1")
        lower.fill("-5.5")
        self.eventually(lambda: len(held), 1)
        self.page.unroute("**/pdu")
        held[0].fallback()
        self.eventually(self.unit, [8, 2, 180, 150])
        # The page has the reply.
        self.page.wait_for_timeout(500)
        self.assertEqual(self.unit(), [8, 2, 180, 150], "half a value was written")
        self.page.keyboard.press("Enter")
        self.eventually(self.unit, [8, 2, 180, 0xFFC9])
        expect(self.page.locator("#links-rows tr")).to_contain_text("on below")

    def test_refused_value_is_reported_and_the_link_stays(self):
        self.write(LINKS[0], [0, 4, 20, 0])
        self.read()
        time = self.page.get_by_label("Time of link 1 of p2.1")
        expect(time).to_have_value("2.0")
        time.fill("0")
        self.page.keyboard.press("Enter")
        expect(self.page.get_by_role("alert")).to_have_text(
            "Link 1 of p2.1: the unit does not allow this value (exception 3)")
        expect(time).to_have_value("2.0")
        self.assertEqual(self.unit(), [0, 4, 20, 0])


class OneSlot(OnPage):
    def test_board_with_one_slot_has_no_links(self):
        expect(self.page.locator("#links-section")).to_be_hidden()
