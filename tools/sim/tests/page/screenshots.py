"""Takes the pictures of the simulator's page for the documentation: `cargo xtask screenshots`.

The board's time and the page's stand still between steps, so a picture hardly changes unless the page or the firmware does.
"""

import argparse
import math
import pathlib
import socket
import sys

from PIL import Image
from playwright.sync_api import expect, sync_playwright

# The tests with pymodbus have the class of the simulator, based on its Python client.
sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "pymodbus"),
                str(pathlib.Path(__file__).resolve().parents[2] / "python")]
import simulator  # noqa: E402
from browser import DESKTOP, PHONE, launch  # noqa: E402

SECONDS = 60
EXACT = ["--exact-line", "127.0.0.1:0"]
ENDPOINTS = {"pty": "/dev/pts/3", "tcp": "127.0.0.1:5020", "http": "http://127.0.0.1:8502/"}


# Function 70 of unit 2: switches on the events of p1.1 to p1.4 and p2.3, and switches off the event of its start.
EVENTS_ON = "02461812 020000 04 01010101 010006 01 01 0f0000 01 00"
# The second of each fetch of events, the level of p1.2 from then on, and unit and flag of the packet that is confirmed.
FETCHES = {6: (False, "0000"), 15: (True, "0200"), 31: (False, "0201"), 48: (True, "0200")}


class Line:
    """The board's line through the exact-line protocol of docs/conformance.md."""

    def __init__(self, address: str):
        host, port = address.rsplit(":", 1)
        with socket.create_connection((host, int(port)), timeout=simulator.PATIENCE) as connection:
            # The file keeps the connection until it is closed itself.
            self.file = connection.makefile("rw")
        self.ask("hello 1")

    def ask(self, request: str):
        self.file.write(request + "\n")
        self.file.flush()
        answer = self.file.readline()
        assert answer.startswith("ok "), (request, answer)

    def request(self, body: str, run_ms: int):
        """Sends a request and runs the board."""
        self.ask(f"send {simulator.crc(bytes.fromhex(body)).hex()}")
        self.ask(f"run {run_ms * 1000}")


def value(second: int, channel: int) -> int:
    """Returns the voltage at an input in mV: a slow wave, with a different level for each channel."""
    return round(1650 + (900 - 150 * channel) * math.sin(second / (6 + 2 * channel) + channel))


def larger_board(browser, board, line, scheme, file):
    """The modio-08 with four modules, after a minute of a master's requests."""
    page = opened(browser, board, DESKTOP, scheme, 1.25)
    for number in (1, 4):
        board.set_channel(number, energised=True)
    line.request("02050006ff00", 100)
    line.request(EVENTS_ON, 100)
    for second in range(SECONDS):
        if second in FETCHES:
            energised, confirmed = FETCHES[second]
            board.set_channel(2, energised=energised)
            expect(page.locator("#c0-2")).to_have_attribute("aria-checked", str(energised).lower())
            line.ask("run 50000")
            line.request(f"fd46100040{confirmed}", 100)
        for channel in range(4):
            board.set_channel(channel + 1, port=3, millivolts=value(second, channel))
        level = value(second, 0)
        if second == SECONDS - 1:
            while not board.state().leds.run:
                line.ask("run 20000")
        requests = ["020400080004", "020100000004", f"0206000c{level:04x}", f"0206000e{4095 - level:04x}"]
        line.request(requests[second % 4], 1000 if second < SECONDS - 1 else 40)
        shows(page, "c2-1", value(second, 0))
        page.clock.run_for(1000)
    shoot(page, board, file, page.locator("#frame-scroll"))


def smaller_board(browser, board, line, scheme, file):
    """The modio-02 with an analog module, on a phone."""
    page = opened(browser, board, PHONE, scheme, 2)
    board.set_channel(1, millivolts=1815)
    board.set_channel(2, millivolts=1000)
    page.get_by_label("Range of analog input p5.2").select_option(label="°C")
    line.request("020600120800", 100)
    line.request("020400100002", 40)
    shows(page, "c0-1", 1815)
    page.clock.run_for(1000)
    shoot(page, board, file, page.locator(".board"))


def opened(browser, board, viewport, scheme, scale):
    page = browser.new_page(viewport=viewport, color_scheme=scheme, device_scale_factor=scale)
    page.clock.install(time=0)
    # Addresses that differ from run to run would change the picture.
    page.route("**/api/endpoints", lambda route: route.fulfill(json=ENDPOINTS))
    page.goto(board.url)
    expect(page.locator("#connection")).to_have_text("live")
    page.clock.pause_at(SECONDS * 1000)
    return page


def shows(page, slider: str, millivolts: int):
    """Waits until the page shows this value at a slider."""
    expect(page.locator(f"#{slider}")).to_have_value(str(millivolts))


def shoot(page, board, file: pathlib.Path, last):
    """Takes a picture of the page down to the element `last`, in 256 colours."""
    # Wait for the last frame and the state after it.
    page.wait_for_load_state()
    line = board.state().line
    expect(page.locator("#line-requests")).to_have_text(str(line.rx_frames))
    expect(page.locator("#line-replies")).to_have_text(str(line.tx_frames))
    page.clock.run_for(500)
    box = last.bounding_box()
    width = page.viewport_size["width"]
    page.screenshot(path=file, full_page=True,
                    clip={"x": 0, "y": 0, "width": width, "height": box["y"] + box["height"] + 12})
    reduced(Image.open(file).convert("RGB")).save(file, optimize=True)
    print(f"wrote {file}, {file.stat().st_size // 1024} KiB")
    page.close()


def reduced(picture: Image.Image) -> Image.Image:
    """Returns the picture in 256 colours: the most frequent ones, so that backgrounds keep their colour, and others
    that differ most from these, so that an LED keeps its colour."""
    counted = sorted(picture.getcolors(picture.width * picture.height), reverse=True)
    frequent = [colour for _, colour in counted[:128]]
    far = picture.quantize(128, Image.Quantize.MAXCOVERAGE).getpalette()[:3 * 128]
    palette = frequent + list(zip(far[::3], far[1::3], far[2::3]))
    distance = lambda one, other: sum((a - b) ** 2 for a, b in zip(one, other))
    nearest = {colour: min(range(len(palette)), key=lambda n: distance(palette[n], colour)) for _, colour in counted}
    pixels = bytes(nearest[colour] for colour in picture.get_flattened_data())
    made = Image.frombytes("P", picture.size, pixels)
    made.putpalette([part for colour in palette for part in colour])
    return made


def take_all(to: pathlib.Path, schemes=("light", "dark")):
    """Takes all pictures in these colour schemes, into the directory `to`."""
    slots = ["--slot", "1=4di", "--slot", "2=2relay", "--slot", "3=4ai", "--slot", "4=4ao"]
    pictures = [("desktop", larger_board, {"board": "modio-08", "options": slots}),
                ("phone", smaller_board, {"module": "2ai2ao"})]
    with sync_playwright() as playwright:
        browser = launch(playwright)
        for name, take, board in pictures:
            for scheme in schemes:
                running = simulator.Simulator.of(dip=2, **board | {"options": [*EXACT, *board.get("options", ())]})
                try:
                    line = Line(running.endpoint("exact-line"))
                    take(browser, running, line, scheme, to / f"panel-{name}-{scheme}.png")
                    line.file.close()
                finally:
                    running.close()
        browser.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--to", required=True, type=pathlib.Path, help="the directory of the pictures")
    options = parser.parse_args()
    options.to.mkdir(parents=True, exist_ok=True)
    take_all(options.to)


if __name__ == "__main__":
    main()
