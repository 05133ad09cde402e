"""Analog channels on the page and on the line: 2ai2ao."""

import math
import re

from browser import OnPage
from playwright.sync_api import expect

FIRST = 0x0010


class Analog(OnPage):
    MODULE = "2ai2ao"

    def setUp(self):
        super().setUp()
        for number in (1, 2):
            self.simulator.set_channel(number, millivolts=0)

    def codes(self):
        """Returns the values of the inputs in codes of the 12-bit converter."""
        return self.good(self.master.read_input_registers(FIRST, count=2)).registers

    def reads(self, number: int, millivolts: int):
        """Waits until an input register has the voltage of its pin, within one code, after the filter's time."""
        wanted = millivolts * 4095 / 3300
        self.eventually(lambda: abs(self.codes()[number - 1] - wanted) <= 1.5, True)

    def slider(self, number: int):
        return self.page.get_by_label(f"Slider of analog input p5.{number}", exact=True)

    def field(self, number: int):
        return self.page.get_by_label(f"Analog input p5.{number}", exact=True)

    def at_pin(self, number: int, millivolts: int):
        expect(self.page.get_by_role("group", name=f"AI p5.{number}").locator(".pin")).to_have_text(
            f"pin: {millivolts} mV")

    def test_dragged_slider_changes_the_input_register(self):
        box = self.slider(1).bounding_box()
        middle = box["y"] + box["height"] / 2
        mouse = self.page.mouse
        mouse.move(box["x"] + 8, middle)
        mouse.down()
        mouse.move(box["x"] + box["width"] * 0.75, middle, steps=20)
        mouse.up()
        millivolts = int(self.slider(1).input_value())
        self.assertGreater(millivolts, 2000)
        self.at_pin(1, millivolts)
        self.assertEqual(self.simulator.state().channels[0].millivolts, millivolts)
        self.reads(1, millivolts)
        self.assertLessEqual(self.codes()[1], 1)

    def test_slider_moves_by_keyboard(self):
        self.tab_to(self.slider(2))
        self.page.keyboard.press("End")
        self.at_pin(2, 3300)
        for _ in range(3):
            self.page.keyboard.press("ArrowLeft")
        self.at_pin(2, 3297)
        self.page.keyboard.press("Home")
        self.page.keyboard.press("PageUp")
        self.at_pin(2, 330)
        self.reads(2, 330)

    def test_slider_has_the_value_in_the_chosen_range_and_at_the_pin(self):
        for unit, value in (("V", "5"), ("mA", "10"), ("°C", "25")):
            self.page.get_by_label("Range of analog input p5.1").select_option(label=unit)
            self.field(1).fill(value)
            self.page.keyboard.press("Enter")
            self.at_pin(1, 1650)
            expect(self.slider(1)).to_have_attribute("aria-valuetext", f"{value} {unit}, 1650 mV at the pin")
            expect(self.slider(1)).to_have_value("1650")
        self.reads(1, 1650)

    def test_temperature_sets_the_voltage_of_a_thermistor_at_that_temperature(self):
        self.page.get_by_label("Range of analog input p5.1").select_option(label="°C")
        self.field(1).fill("60")
        self.page.keyboard.press("Enter")
        ohms = 10e3 * math.exp(3950 * (1 / 333.15 - 1 / 298.15))
        self.at_pin(1, round(3300 * ohms / (ohms + 10e3)))

    def test_value_outside_the_range_is_limited_to_its_end(self):
        self.field(1).fill("12")
        self.page.keyboard.press("Enter")
        self.at_pin(1, 3300)
        expect(self.field(1)).to_have_value("10")

    def test_change_by_another_client_moves_the_slider(self):
        self.simulator.set_channel(1, millivolts=990)
        expect(self.slider(1)).to_have_value("990")
        expect(self.field(1)).to_have_value("3")

    def test_written_output_shows_in_volts_and_milliamps(self):
        reading = self.page.get_by_role("group", name="AO p5.3").locator(".reading")
        jumper = self.page.get_by_label("Jumper of analog output p5.3")
        self.good(self.master.write_register(FIRST + 2, 1024))
        expect(reading).to_have_text("2.50")
        jumper.select_option(label="mA")
        expect(reading).to_have_text("5.00")
        self.good(self.master.write_register(FIRST + 2, 4095))
        expect(reading).to_have_text("20.00")
        jumper.select_option(label="V")
        expect(reading).to_have_text("10.00")

    def test_chart_shows_every_analog_point(self):
        self.good(self.master.write_register(FIRST + 3, 2048))
        expect(self.page.locator("#legend span")).to_have_text(
            [re.compile("^p5.1: "), re.compile("^p5.2: "), re.compile("^p5.3: "), re.compile("^p5.4: 5.00 V$")])
        last = lambda n: self.page.locator("#lines polyline").nth(n).get_attribute("points").split()[-1]
        self.eventually(lambda: last(3), "600.0,75.0")
        self.simulator.set_channel(1, millivolts=3300)
        self.eventually(lambda: last(0), "600.0,0.0")
        expect(self.page.locator("#lines polyline")).to_have_count(4)
