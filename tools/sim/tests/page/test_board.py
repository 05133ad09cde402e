"""Switch, power, modules, LEDs, the boards with slots, and accessibility."""

import pathlib
import re
import tempfile

from axe_playwright_python.sync_playwright import Axe
from browser import DESKTOP, PHONE, OnPage
from playwright.sync_api import expect
from pymodbus.exceptions import ModbusIOException
from simulator import GIVE_UP, Simulator


# The elements that extend beyond the right edge of the window or of the channel that contains them.
WIDER = """() => [...document.querySelectorAll("main *")].filter((each) => {
    const channel = each.parentElement.closest(".channel");
    const right = channel ? channel.getBoundingClientRect().right : innerWidth;
    return !each.closest(".scroll, svg") && each.getBoundingClientRect().right > right + 1;
}).map((each) => each.outerHTML.slice(0, 80))"""


class Switch(OnPage):
    def setUp(self):
        super().setUp()
        self.simulator.set_dip(1)
        self.simulator.power_cycle()
        self.simulator.wait(200)

    def answers(self, unit: int) -> bool:
        """Returns whether the unit with this address answers."""
        self.master.close()
        master = self.simulator.master(timeout=GIVE_UP)
        try:
            before = self.simulator.last_frame()
            try:
                master.read_coils(0x0010, count=4, device_id=unit)
            except ModbusIOException:
                pass
            return self.simulator.answer_to(before) != b""
        finally:
            master.close()

    def rocker(self, position: int):
        return self.switch(f"SW01 position {position}, adds {1 << position - 1}")

    def address(self, value: int):
        expect(self.page.get_by_label("SW01 as a number")).to_have_value(str(value))
        for position in range(1, 9):
            on = value >> position - 1 & 1
            expect(self.rocker(position)).to_have_attribute("aria-checked", "true" if on else "false")

    def test_switch_and_power_cycle_change_the_address(self):
        self.address(1)
        self.rocker(1).click()
        self.address(0)
        self.rocker(2).click()
        self.rocker(5).click()
        self.address(18)
        in_force = self.page.locator("#address")
        expect(in_force).to_have_text("1")
        self.assertEqual((self.answers(1), self.answers(18)), (True, False), "before the power cycle")
        self.page.get_by_role("button", name="Off and on").click()
        expect(self.page.locator("#log")).to_contain_text("unit address 18")
        expect(in_force).to_have_text("18")
        self.assertEqual((self.answers(1), self.answers(18)), (False, True), "after the power cycle")

    def test_clicks_faster_than_the_answers_all_count(self):
        self.address(1)
        rockers = [self.rocker(position).element_handle() for position in (1, 2, 5, 8, 8)]
        self.page.evaluate("rockers => rockers.forEach((rocker) => rocker.click())", rockers)
        self.address(18)

    def test_switch_and_power_work_with_the_keyboard_only(self):
        press = self.page.keyboard.press
        self.tab_to(self.rocker(1))
        press("Space")
        self.address(0)
        press("ArrowRight")
        press("ArrowRight")
        press("ArrowUp")
        self.address(4)
        press("ArrowUp")
        press("ArrowLeft")
        press("Enter")
        self.address(6)
        press("ArrowDown")
        self.address(4)
        self.tab_to(self.page.get_by_label("SW01 as a number"))
        press("ArrowUp")
        self.address(5)
        power = self.page.locator("#power")
        self.page.reload()
        expect(self.page.locator("#connection")).to_have_text("live")
        self.tab_to(power)
        press("Space")
        expect(power).to_have_text("Power is off")
        expect(power).to_have_attribute("aria-checked", "false")
        self.assertFalse(self.simulator.state().powered)
        press("Space")
        expect(power).to_have_text("Power is on")
        expect(self.page.locator("#log")).to_contain_text("unit address 5")
        self.assertEqual((self.answers(1), self.answers(5)), (False, True))

    def test_wrong_number_is_refused_with_the_reason(self):
        self.page.get_by_label("SW01 as a number").fill("300")
        self.page.keyboard.press("Enter")
        expect(self.page.get_by_role("alert")).to_have_text(re.compile("^SW01 as a number: .*0 to 255"))
        expect(self.page.get_by_label("SW01 as a number")).to_have_value("1")
        self.assertEqual(self.simulator.state().dip, 1)

    def is_expected(self, message) -> bool:
        return super().is_expected(message) or (message.location["url"].endswith("/dip") and "400" in message.text)


class Modules(OnPage):
    def test_module_changes_with_the_power_off(self):
        module = self.page.get_by_label("Module in Port 5")
        expect(module).to_be_disabled()
        self.page.locator("#power").click()
        module.select_option("4ao")
        expect(self.page.get_by_role("group", name="AO p5.4")).to_be_visible()
        mismatch = self.page.get_by_text("configured 4di, plugged 4ao")
        expect(mismatch).to_be_visible()
        self.assertEqual(self.simulator.state().module, "4ao")
        module.select_option("none")
        expect(self.page.locator(".channel")).to_have_count(0)
        module.select_option("4di")
        expect(self.page.locator(".mismatch")).to_be_hidden()
        self.page.locator("#power").click()
        expect(module).to_be_disabled()
        self.is_on("Digital input p5.1", "open", False)

    def test_running_led_blinks(self):
        run = self.page.locator("#led-run-text")
        for text in ("on", "off", "on"):
            expect(run).to_have_text(text)
        expect(self.page.locator("#led-fault-text")).to_have_text("off")


class LargerBoard(OnPage):
    BOARD = "modio-08"
    OPTIONS = ("--slot", "2=2relay", "--slot", "3=4ai", "--slot", "4=4ao")

    def test_four_slots_are_shown_with_their_modules(self):
        expect(self.page.get_by_role("heading", level=1)).to_have_text("modio-08")
        expect(self.page.locator(".slot h3")).to_have_text(["Port 1", "Port 2", "Port 3", "Port 4"])
        for port, module in enumerate(["4di", "2relay", "4ai", "4ao"], 1):
            expect(self.page.get_by_label(f"Module in Port {port}")).to_have_value(module)

    def test_each_slot_follows_the_line_and_the_mouse(self):
        self.switch("Digital input p1.4").click()
        read = lambda: self.good(self.master.read_coils(0x0000, count=4)).bits[:4]
        self.eventually(read, [False, False, False, True])
        self.good(self.master.write_coil(0x0006, True))
        self.is_on("Coil of relay 1, p2.3", "energised")
        self.page.get_by_label("Slider of analog input p3.2", exact=True).fill("3300")
        level = lambda: self.good(self.master.read_input_registers(0x0009, count=1)).registers[0] > 4090
        self.eventually(level, True)
        self.good(self.master.write_register(0x000F, 4095))
        expect(self.page.get_by_role("group", name="AO p4.4").locator(".reading")).to_have_text("10.00")
        expect(self.page.locator("#legend span")).to_have_count(8)


class ForEverybody(OnPage):
    """axe-core finds no serious violation, and no element is wider than the window."""

    # Every kind of channel, with the power on and off, with and without a radio.
    SIMULATORS = (("modio-02", "4do", ()),
                  ("modio-08", "4di", ("--slot", "2=2relay", "--slot", "3=4ai", "--slot", "4=4ao")))

    def test_axe_finds_no_serious_violation(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        radio = ("--lora", str(pathlib.Path(directory.name, "radio")))
        for board, module, options in self.SIMULATORS:
            options = (*options, *radio) if board == "modio-08" else options
            other = Simulator.of(board=board, module=module, options=options)
            self.addCleanup(other.close)
            master = other.master()
            self.good(master.read_holding_registers(0x0100, count=4))
            # A damaged frame has a different colour.
            master.close()
            with other.wire() as wire:
                wire.write(b"\x01\x02\x03")
            other.wait_for(lambda: len(other.frames()) == 3, what="no bad frame was recorded")
            other.power_off() if module == "4do" else other.power_on()
            for viewport in (DESKTOP, PHONE):
                for scheme in ("light", "dark"):
                    with self.subTest(board=board, module=module, width=viewport["width"], scheme=scheme):
                        self.look(other, viewport, scheme)

    def look(self, other, viewport, scheme):
        own, self.simulator = self.simulator, other
        try:
            page = self.open(viewport=viewport, scheme=scheme)
        finally:
            self.simulator = own
        expect(page.locator("#frames tr.bad")).to_have_count(1)
        found = Axe().run(page).response["violations"]
        serious = [f"{each['id']}: {[node['target'] for node in each['nodes']]}" for each in found
                   if each["impact"] in ("serious", "critical")]
        self.assertEqual(serious, [])
        self.assertEqual(page.evaluate(WIDER), [], "elements wider than the window or their channel")
