"""The faults that a user can set, several boards on one line, and the radio."""

import pathlib
import re
import tempfile

from browser import OnPage
from playwright.sync_api import expect


class Faults(OnPage):
    def setUp(self):
        super().setUp()
        self.simulator.set_faults({"bit_error_rate": 0, "drop_rate": 0, "noise_hz": 0, "i2c_absent": False,
                                   "hse_failed": False, "hsi_percent": 0, "lsi_khz": 40})
        expect(self.page.get_by_role("heading", name="Faults")).to_be_visible()

    def is_expected(self, message) -> bool:
        return super().is_expected(message) or (message.location["url"].endswith("/faults") and "400" in message.text)

    def in_force(self, name: str):
        return lambda: self.simulator.faults()[name]

    def test_faults_are_chosen_one_by_one(self):
        self.page.get_by_label("Noise on the line, pulses per second").fill("2")
        self.page.keyboard.press("Enter")
        self.page.get_by_label("DAC does not answer on I2C").check()
        self.page.get_by_label("LSI, kHz").fill("30.5")
        self.page.keyboard.press("Tab")
        expect(self.page.get_by_label("LSI, kHz")).to_have_value("30.5")
        expect(self.page.get_by_label("DAC does not answer on I2C")).to_be_checked()
        for name, value in (("noise_hz", 2), ("i2c_absent", True), ("lsi_khz", 30.5)):
            self.eventually(self.in_force(name), value)

    def test_failed_crystal_lights_the_fault_led(self):
        lamp = self.page.locator("#led-fault-text")
        expect(lamp).to_have_text("off")
        self.page.get_by_label("Crystal has failed").check()
        expect(lamp).to_have_text("on")
        self.page.get_by_label("Crystal has failed").uncheck()
        self.eventually(self.in_force("hse_failed"), False)
        self.simulator.power_cycle()

    def test_refused_fault_is_reported_and_reset(self):
        field = self.page.get_by_label("Bit errors, share of bits")
        for key in ("Enter", "Tab"):
            field.fill("7")
            self.page.keyboard.press(key)
            expect(self.page.get_by_role("alert")).to_have_text(re.compile("^Bit errors, share of bits: .*0 to 0.5"))
            expect(field).to_have_value("0")

    def test_faults_set_by_another_client_are_shown(self):
        expect(self.page.get_by_label("DAC does not answer on I2C")).not_to_be_checked()
        self.simulator.set_faults({"i2c_absent": True})
        expect(self.page.get_by_label("DAC does not answer on I2C")).to_be_checked()


class OneBoard(OnPage):
    OPTIONS = ("--tcp", "127.0.0.1:0", "--modbus-tcp", "127.0.0.1:0")

    def test_commands_reach_the_unit(self):
        ends = self.simulator.endpoints()
        host, port = ends["modbus-tcp"].split(":")
        read = "-a 1 -0 -r 16 -c 4 -1 -t 1"
        expect(self.page.get_by_label("Commands for a terminal")).to_have_text("\n".join([
            f"modioctl --port {ends['pty']} --baud 9600 --format 8N2 scan",
            f"modioctl --tcp {ends['tcp']} scan",
            f"modioctl --modbus-tcp {ends['modbus-tcp']} scan",
            f"mbpoll -m rtu -b 9600 -P none -s 2 {read} {ends['pty']}",
            f"mbpoll -m tcp -p {port} {read} {host}"]))
        expect(self.page.locator("#endpoints dd")).to_have_text(list(ends.values()))

    def test_chooser_and_radio_are_hidden(self):
        expect(self.page.locator("#chooser")).to_be_hidden()
        expect(self.page.get_by_role("heading", name="Boards on the line")).to_be_hidden()
        expect(self.page.get_by_role("heading", name="LoRa radio")).to_be_hidden()
        expect(self.page.get_by_label("Lost radio packets, share of packets")).to_have_count(0)


class Radio(OnPage):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.OPTIONS = ("--lora", str(pathlib.Path(directory.name, "radio")))
        super().setUpClass()

    def test_radio_of_the_board_is_shown(self):
        expect(self.page.get_by_role("heading", name="LoRa radio")).to_be_visible()
        radio = self.simulator.state().radio
        expect(self.page.locator("#radio-channel")).to_have_text(f"{radio.channel_mhz} MHz")
        expect(self.page.locator("#radio-rate")).to_have_text(f"{radio.air_rate / 1000:g} kbit/s")
        expect(self.page.locator("#radio-mode")).to_have_text(radio.mode)
        expect(self.page.locator("#radio-aux")).to_have_text("high, idle")
        self.simulator.power_off()
        expect(self.page.locator("#radio-mode")).to_have_text("off or starting")
        self.simulator.power_on()
        expect(self.page.locator("#radio-mode")).to_have_text(radio.mode)

    def test_loss_of_packets_is_a_fault(self):
        self.page.get_by_label("Lost radio packets, share of packets").fill("0.5")
        self.page.keyboard.press("Enter")
        self.eventually(lambda: self.simulator.faults()["radio_loss"], 0.5)


class Boards(OnPage):
    MODULE = None
    OPTIONS = ("--unit", "1:4di", "--unit", "2:4do")

    def test_chosen_board_is_shown_and_operated(self):
        chooser = self.page.get_by_role("combobox", name="Board").first
        expect(chooser.locator("option")).to_have_text(["unit-1 (modio-02)", "unit-2 (modio-02)"])
        address = self.page.get_by_label("SW01 as a number")
        expect(address).to_have_value("1")
        chooser.select_option("unit-2")
        expect(address).to_have_value("2")
        expect(self.page.get_by_role("group", name="DO p5.4")).to_be_visible()
        self.good(self.master.write_coil(0x0010, True, device_id=2))
        expect(self.page.get_by_role("switch", name="Digital output p5.1")).to_have_text("conducts")
        self.page.get_by_role("switch", name="SW01 position 3, adds 4").click()
        expect(address).to_have_value("6")
        self.assertEqual([self.simulator.board(name).state().dip for name in ("unit-1", "unit-2")], [1, 6])
        self.page.get_by_role("button", name="unit-1").click()
        expect(chooser).to_have_value("unit-1")
        expect(address).to_have_value("1")
        expect(self.page.get_by_role("group", name="DI p5.4")).to_be_visible()

    def test_overview_shows_every_board(self):
        rows = self.page.locator("#overview tr")
        expect(rows).to_have_text(["unit-1modio-021onoff4di", "unit-2modio-022onoff4do"])
        self.simulator.board("unit-2").power_off()
        expect(rows.nth(1)).to_have_text("unit-2modio-02noneoffoff4do")
        self.simulator.board("unit-2").power_on()
