"""Digital channels on the page and on the line: 4di, 4do, 2relay."""

from browser import OnPage
from playwright.sync_api import expect

FIRST = 0x0010


class Inputs(OnPage):
    MODULE = "4di"

    def read(self):
        return self.good(self.master.read_discrete_inputs(FIRST, count=4)).bits[:4]

    def test_click_on_an_input_is_read_by_a_master(self):
        self.is_on("Digital input p5.1", "open", False)
        self.assertEqual(self.read(), [False] * 4)
        self.switch("Digital input p5.1").click()
        self.is_on("Digital input p5.1", "24 V")
        self.eventually(self.read, [True, False, False, False])
        self.switch("Digital input p5.3").click()
        self.eventually(self.read, [True, False, True, False])
        self.switch("Digital input p5.1").click()
        self.switch("Digital input p5.3").click()
        self.eventually(self.read, [False] * 4)

    def test_space_on_an_input_is_read_by_a_master(self):
        self.tab_to(self.switch("Digital input p5.2"))
        self.page.keyboard.press("Space")
        self.eventually(self.read, [False, True, False, False])
        self.page.keyboard.press("Space")
        self.eventually(self.read, [False] * 4)

    def test_terminals_and_addresses_are_labelled(self):
        terminals = self.page.get_by_label("Screw terminals of Port 5").get_by_role("listitem")
        expect(terminals).to_have_text(["1", "2", "3", "4", "COM"])
        expect(self.page.locator(".channel .name")).to_have_text(
            [f"DI {n}p5.{n}0x{FIRST + n - 1:04x}" for n in range(1, 5)])


class Outputs(OnPage):
    MODULE = "4do"

    def test_written_coil_lights_its_lamp(self):
        self.is_on("Digital output p5.2", "off", False)
        self.good(self.master.write_coil(FIRST + 1, True))
        self.is_on("Digital output p5.2", "conducts")
        self.is_on("Digital output p5.1", "off", False)
        self.good(self.master.write_coils(FIRST, [True, False, False, True]))
        for number, on in enumerate([True, False, False, True], 1):
            self.is_on(f"Digital output p5.{number}", "conducts" if on else "off", on)


class Relays(OnPage):
    MODULE = "2relay"

    def test_written_coil_of_a_relay_shows(self):
        self.is_on("Coil of relay 2, p5.4", "released", False)
        self.good(self.master.write_coil(FIRST + 3, True))
        self.is_on("Coil of relay 2, p5.4", "energised")
        self.is_on("Coil of relay 1, p5.3", "released", False)

    def test_jumper_is_read_by_a_master(self):
        jumpers = lambda: self.good(self.master.read_coils(FIRST, count=2)).bits[:2]
        self.assertEqual(jumpers(), [False, False])
        self.switch("Manual jumper of relay 1, p5.1").click()
        self.is_on("Manual jumper of relay 1, p5.1", "jumper: manual")
        self.eventually(jumpers, [True, False])

    def test_terminals_of_relays_are_labelled(self):
        terminals = self.page.get_by_label("Screw terminals of Port 5").get_by_role("listitem")
        expect(terminals).to_have_text(["1 COM", "1 NO", "2 COM", "2 NO", "2 NC"])
