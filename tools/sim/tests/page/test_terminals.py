"""The terminals of a board with fixed inputs and outputs, on the page and on the line."""

import struct

from browser import OnPage
from playwright.sync_api import expect

# Points of X0, RUN, Y0 and AD0 of an fx3u-24.
X0, RUN, Y0, AD0 = 0, 14, 16, 28


class Terminals(OnPage):
    BOARD = "fx3u-24"
    MODULE = None

    def labels(self, terminal: str):
        return self.page.get_by_label(f"Terminal {terminal}", exact=True).locator(".name > *")

    def test_each_terminal_has_its_point_if_the_board_has_one(self):
        for terminal, labels in (
                ("X0", ["X0", "p1.1", "0x0000"]), ("X15", ["X15", "p4.2", "0x000d"]), ("RUN", ["RUN", "p4.3", "0x000e"]),
                ("Y11", ["Y11", "p7.2", "0x0019"]), ("AD3", ["AD3", "p8.4", "0x001f"]), ("DA0", ["DA0"])):
            expect(self.labels(terminal)).to_have_text(labels)

    def test_inputs_and_switch_are_read_by_a_master(self):
        read = lambda point: self.good(self.master.read_discrete_inputs(point, count=1)).bits[0]
        for terminal, point, before in (("X0", X0, False), ("RUN", RUN, True)):
            self.assertEqual(read(point), before)
            self.switch(terminal).click()
            self.eventually(lambda: read(point), not before)

    def test_slider_of_an_analog_input_is_read_by_a_master(self):
        slider = self.page.get_by_label("Slider of AD0")
        slider.fill("5000")
        code = lambda: self.good(self.master.read_input_registers(AD0, count=1)).registers[0]
        self.eventually(lambda: abs(code() - 2048) <= 6, True)

    def test_written_coil_energises_its_relay(self):
        self.is_on("Relay Y0", "released", False)
        self.good(self.master.write_coil(Y0, True))
        self.is_on("Relay Y0", "energised")

    def test_link_is_added_between_terminals(self):
        self.page.get_by_role("button", name="Read the links").click()
        self.page.get_by_label("New link of").select_option(label="p5.2 (Y1)")
        self.page.get_by_role("button", name="Add").click()
        self.page.get_by_label("Input of link 1 of p5.2 (Y1)").select_option(label="p1.4 (X3)")
        # As the page does: the master of the tests also receives the requests of the page.
        read = struct.pack(">BHH", 3, 0x0400 + 4 * (Y0 + 1), 2)
        self.eventually(lambda: struct.unpack(">HH", self.simulator.request(read)[2:]), (3, 3))
        # A link acts a second after it was written.
        self.simulator.wait(1100)
        self.switch("X3").click()
        self.is_on("Relay Y1", "energised")
