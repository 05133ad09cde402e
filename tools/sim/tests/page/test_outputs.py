"""Outputs whose terminals differ from their coils, on the page and in the unit."""

import struct

from browser import OnPage
from playwright.sync_api import expect

# Coils of p2.1 and p2.2, and MIN_OFF of p2.1.
FIRST = 4
MIN_OFF = 0x0564


class Coils(OnPage):
    BOARD = "modio-08"
    MODULE = None
    OPTIONS = ("--slot", "1=4di", "--slot", "2=4do")

    def set_min_off(self, tenths: int):
        for request in (bytes.fromhex("0601005a17"), struct.pack(">BHH", 6, MIN_OFF, tenths)):
            self.assertLess(self.simulator.request(request)[0], 0x80)

    def notes(self):
        return self.page.locator("[data-coil]")

    def requests(self) -> int:
        return int(self.page.locator("#line-requests").inner_text())

    def test_coil_that_waits_is_shown_while_the_user_asks_for_it(self):
        self.set_min_off(0xFFFF)
        self.addCleanup(self.set_min_off, 0)
        self.good(self.master.write_coils(FIRST, [True, True]))
        self.is_on("Digital output p2.1", "off", False)
        self.is_on("Digital output p2.2", "conducts")
        expect(self.notes()).to_have_text(["", "", "", ""])
        before = self.requests()
        self.simulator.wait(2500)
        self.assertEqual(self.requests(), before, "without the box the page sends nothing")
        box = self.page.get_by_label("Show coils where terminals differ")
        box.check()
        expect(self.notes()).to_have_text(["coil on", "", "", ""])
        self.good(self.master.write_coil(FIRST, False))
        expect(self.notes()).to_have_text(["", "", "", ""])
        self.good(self.master.write_coil(FIRST, True))
        expect(self.notes()).to_have_text(["coil on", "", "", ""])
        box.uncheck()
        expect(self.notes()).to_have_text(["", "", "", ""])
