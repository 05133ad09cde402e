"""The client with a running simulator."""

import os
import pathlib
import signal
import socket
import tempfile
import time
import unittest

import modio_sim
from simulator import firmware


def started(**options):
    """Starts a simulator with the loader and the image of the tests."""
    return modio_sim.Simulator.start(**options | {"options": [*firmware(), *options.get("options", ())]})


# Reads the four points of the slot of unit 1.
READ = bytes.fromhex("010100100004 3c0c")


def ask(simulator, request=READ):
    """Sends a request to the line over TCP."""
    host, _, port = simulator.endpoint("tcp").rpartition(":")
    line = socket.create_connection((host, int(port)), timeout=60)
    line.sendall(request)
    return line


class Running(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.simulator = started(module="2relay", tcp="127.0.0.1:0")
        cls.addClassCleanup(lambda: cls.assertEqual(cls(), cls.simulator.close(), 0))

    def test_the_state_is_that_of_the_board(self):
        state = self.simulator.state()
        self.assertEqual((state.board, state.module, state.dip, state.powered), ("modio-02", "2relay", 1, True))
        self.assertEqual((state.line.baud, state.line.format), (9600, "8N2"))
        self.assertEqual([channel.kind for channel in state.channels], ["relay", "relay", "none", "none"])
        self.assertEqual(state.slots, ())
        self.assertTrue(state.log_tail)
        self.assertIn(state.log_tail[0], self.simulator.output)
        self.assertEqual(self.simulator.findings(), [])
        self.assertEqual(self.simulator.complaints, [])
        self.assertIn("/api/state", self.simulator.openapi()["paths"])

    def test_a_board_has_a_name(self):
        [board] = self.simulator.boards()
        self.assertEqual((board.board, board.address, board.modules), ("modio-02", 1, ("2relay",)))
        state = self.simulator.board(board.name).set_channel(2, manual=True)
        self.assertTrue(state.channels[1].manual)
        self.assertFalse(self.simulator.set_channel(2, manual=False, port=5).channels[1].manual)
        with self.assertRaises(modio_sim.RefusedError) as refused:
            self.simulator.board("nobody")
        self.assertEqual(refused.exception.status, 404)

    def test_refusal_has_status_and_message_of_the_simulator(self):
        for status, message, what in (
                (404, "numbered 1 to 4", lambda: self.simulator.set_channel(9, manual=True)),
                (409, "", lambda: self.simulator.set_channel(1, millivolts=5)),
                (409, "power", lambda: self.simulator.set_module("4do")),
                (400, "", lambda: self.simulator.set_dip(256)),
                (400, "", lambda: self.simulator.set_channel(1, manual="yes")),
                (400, "", lambda: self.simulator.set_channel(1, manual="off")),
                (400, "", lambda: self.simulator.set_channel(1, manual=1)),
                (400, "", lambda: self.simulator.set_channel(1, millivolts=7.0)),
                (400, "", lambda: self.simulator.set_channel(1, millivolts=float("nan"))),
                (400, "", lambda: self.simulator.set_dip(True)),
                (400, "", lambda: self.simulator.set_faults({"drop_rate": None})),
                (400, "", lambda: self.simulator.set_module(None))):
            with self.assertRaises(modio_sim.RefusedError) as refused:
                what()
            self.assertEqual(refused.exception.status, status)
            self.assertIn(message, str(refused.exception))
            self.assertNotIn("HTTP status", str(refused.exception))
        self.assertEqual(self.simulator.state().module, "2relay")

    def test_frames_are_those_on_the_line_and_events_contain_them(self):
        before = max((frame.number for frame in self.simulator.frames()), default=0)
        with self.simulator.events() as events:
            self.assertIsInstance(next(events), modio_sim.State)
            with ask(self.simulator):
                heard = []
                for event in events:
                    if isinstance(event, modio_sim.Frame):
                        heard.append(event)
                    if len(heard) == 2:
                        break
        request, response = heard
        self.assertEqual((request.direction, request.bytes, request.crc_ok), ("rx", READ, True))
        self.assertEqual((response.direction, response.crc_ok, response.damaged), ("tx", True, False))
        self.assertEqual(self.simulator.frames(before), heard)
        self.assertEqual(self.simulator.frames(response.number), [])

    def test_virtual_time_is_waited_for(self):
        before = self.simulator.state().virtual_ms
        self.simulator.wait(100)
        self.assertGreaterEqual(self.simulator.state().virtual_ms, before + 100)
        with self.assertRaises(TimeoutError) as late:
            self.simulator.wait(10_000_000, timeout=0.05)
        self.assertIn("10000000 ms", str(late.exception))

    def test_attached_simulator_keeps_running_after_close(self):
        with modio_sim.Simulator.attach(self.simulator.url + "/") as other:
            other.set_dip(17)
            self.assertEqual((other.pty, other.output), (None, []))
            self.assertEqual(other.endpoints()["tcp"], self.simulator.endpoint("tcp"))
            with self.assertRaises(modio_sim.StartError):
                other.endpoint("tcp")
        self.assertEqual(self.simulator.set_dip(1).dip, 1)

    def test_faults_are_set(self):
        if "/api/faults" not in self.simulator.openapi()["paths"]:
            self.skipTest("this simulator has no faults to set")
        self.assertEqual(self.simulator.set_faults({"drop_rate": 0.5})["drop_rate"], 0.5)
        self.assertEqual(self.simulator.set_faults({"drop_rate": 0})["drop_rate"], 0)


class Start(unittest.TestCase):
    def test_the_program_ends_with_the_with_statement(self):
        with tempfile.TemporaryDirectory() as directory:
            flash = pathlib.Path(directory, "flash")
            line = pathlib.Path(directory, "line")
            with started(dip=17, flash=flash, pty=line) as simulator:
                self.assertEqual(simulator.state().dip, 17)
                self.assertTrue(os.path.samefile(line, simulator.pty))
                # Power off, another module, power on.
                self.assertFalse(simulator.power_off().powered)
                self.assertEqual(simulator.set_module("4ai").module, "4ai")
                self.assertTrue(simulator.power_on().powered)
                self.assertEqual(simulator.set_channel(3, millivolts=825).channels[2].millivolts, 825)
                simulator.power_cycle()
            self.assertEqual(simulator.close(), 0, "a second close returns the same status")
            self.assertFalse(line.is_symlink())
            self.assertEqual(flash.stat().st_size, 131072)
            with self.assertRaises(modio_sim.UnreachableError):
                simulator.state()

    def test_radio_has_its_terminal_and_its_state(self):
        with tempfile.TemporaryDirectory() as directory:
            link = pathlib.Path(directory, "radio")
            with started(lora=link) as simulator:
                self.assertTrue(os.path.samefile(link, simulator.lora))
                radio = simulator.state().radio
                self.assertIn(radio.channel_mhz, range(410, 442))
                self.assertGreaterEqual(radio.air_rate, 300)
                self.assertEqual(simulator.set_faults({"radio_loss": 0.5})["radio_loss"], 0.5)
            self.assertFalse(link.is_symlink())
        with started() as simulator:
            self.assertEqual((simulator.lora, simulator.state().radio), (None, None))
            self.assertNotIn("radio_loss", simulator.faults())
            with self.assertRaises(modio_sim.RefusedError) as refused:
                simulator.set_faults({"radio_loss": 0.5})
            self.assertIn("no LoRa module", str(refused.exception))

    def test_start_error_has_the_message_of_the_simulator(self):
        with self.assertRaises(modio_sim.StartError) as failed:
            started(module="8di")
        self.assertIn("one of none, 4di", str(failed.exception))
        with self.assertRaises(modio_sim.StartError) as failed:
            modio_sim.Simulator.start(program="no-such-program-here")
        self.assertIn("no-such-program-here", str(failed.exception))

    def test_events_end_when_the_simulator_dies(self):
        simulator = started()
        with simulator.events() as events:
            next(events)
            os.kill(simulator._process._process.pid, signal.SIGKILL)
            end = time.monotonic() + 60
            try:
                for _ in events:
                    self.assertLess(time.monotonic(), end)
            except modio_sim.UnreachableError:
                pass
        self.assertNotEqual(simulator.close(), 0)

    def test_unreachable_error_names_the_address(self):
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        with self.assertRaises(modio_sim.UnreachableError) as missing:
            modio_sim.Simulator.attach(f"http://127.0.0.1:{port}")
        self.assertIn(str(port), str(missing.exception))

    @unittest.skipUnless("MODIO_IMAGES_MODIO_08" in os.environ, "needs the images of the modio-08")
    def test_slots_are_addressed_by_their_ports(self):
        slots = {1: "4di", 3: "4ai"}
        options = firmware("modio-08")
        with modio_sim.Simulator.start(options=options, board="modio-08", slots=slots) as simulator:
            state = simulator.set_channel(2, millivolts=1650, port=3)
            self.assertEqual([slot.port for slot in state.slots], [1, 2, 3, 4])
            self.assertEqual(state.slot(3).channels[1].millivolts, 1650)
            self.assertEqual((state.module, state.slot(2).module), ("4di", "none"))
            simulator.power_off()
            self.assertEqual(simulator.set_module("4do", port=2).slot(2).module, "4do")
