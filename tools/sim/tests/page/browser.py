"""The simulator's page in headless Chromium."""

import re
import shutil
import time
import unittest
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page, Playwright, expect, sync_playwright
from simulator import PATIENCE, Simulator

# Debian's package. The browsers that playwright brings are not needed.
CHROMIUM = "chromium"
# For a container: runs as root, without graphics, and without requests of the browser's own.
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync"]

DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}

expect.set_options(timeout=PATIENCE * 1000)


def launch(playwright: Playwright) -> Browser:
    """Starts Chromium."""
    path = shutil.which(CHROMIUM)
    assert path, f"{CHROMIUM} is not installed"
    return playwright.chromium.launch(executable_path=path, args=FLAGS)


class OnPage(unittest.TestCase):
    """Tests with a board, a master on its line, and the page. Each test opens a new page."""

    BOARD = "modio-02"
    MODULE = "4di"
    OPTIONS = ()
    VIEWPORT = DESKTOP

    @classmethod
    def setUpClass(cls):
        cls.simulator = Simulator.of(board=cls.BOARD, module=cls.MODULE, options=cls.OPTIONS)
        cls.addClassCleanup(cls.simulator.end_well)
        playwright = sync_playwright().start()
        cls.addClassCleanup(playwright.stop)
        cls.browser = launch(playwright)
        cls.addClassCleanup(cls.browser.close)

    def setUp(self):
        self.master = self.simulator.master()
        self.addCleanup(self.master.close)
        self.page = self.open()

    def open(self, *, viewport=None, scheme="light", load=True, **more) -> Page:
        """Opens the page in a new window. At the end of the test, the page must have reported no error and
        sent requests only to the simulator."""
        context = self.browser.new_context(viewport=viewport or self.VIEWPORT, color_scheme=scheme, **more)
        self.addCleanup(context.close)
        foreign, errors = [], []
        own = urlsplit(self.simulator.url).netloc

        def guard(route):
            if urlsplit(route.request.url).netloc == own:
                route.fallback()
            else:
                foreign.append(route.request.url)
                route.abort()

        context.route(re.compile("^(?!data:)"), guard)
        page = context.new_page()
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda message: errors.append(f"{message.text} {message.location}")
                if message.type == "error" and not self.is_expected(message) else None)
        self.addCleanup(lambda: self.assertEqual((foreign, errors), ([], []), "requests elsewhere, errors"))
        if load:
            self.load(page)
        return page

    def is_expected(self, message) -> bool:
        """Returns whether the console may have this error."""
        return False

    def load(self, page: Page):
        """Loads the page and waits until it shows the board."""
        page.goto(self.simulator.url)
        expect(page.locator("#connection")).to_have_text("live")
        expect(page.locator(".slot")).not_to_have_count(0)

    def switch(self, name: str):
        """Returns a switch or lamp of the page by its name."""
        return self.page.get_by_role("switch", name=name, exact=True)

    def is_on(self, name: str, text: str, on: bool = True):
        """Asserts the text of a switch or lamp, and its state for a screen reader."""
        expect(self.switch(name)).to_have_text(text)
        expect(self.switch(name)).to_have_attribute("aria-checked", "true" if on else "false")

    def good(self, answer):
        """Returns the answer, which must not be an exception."""
        self.assertFalse(answer.isError(), answer)
        return answer

    def eventually(self, what, wanted):
        """Waits until `what()` returns `wanted`. The limit is one of real time: requests of the test let the board's time
        run ahead of the browser."""
        end = time.monotonic() + PATIENCE
        while (seen := what()) != wanted and time.monotonic() < end:
            # This also lets the page's requests pass, which run through this process.
            self.page.wait_for_timeout(5)
        self.assertEqual(seen, wanted)

    def tab_to(self, locator):
        """Presses Tab until an element has the focus."""
        for _ in range(60):
            if locator.evaluate("e => e === document.activeElement"):
                return
            self.page.keyboard.press("Tab")
        self.fail(f"Tab does not reach {locator}")
