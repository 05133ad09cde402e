"""Tests exact-line.py for the protocol in docs/conformance.md, with a fake of the Renode calls that it uses."""

import contextlib
import socket
import time
import unittest

from exact_line_fake import STEPS, Machine, Renode
from exact_line_unit import REPLY_US, frame

CHARACTER_US = 11 * 1_000_000 / 9600
READ = frame(1, "03 0000 0001").replace(" ", "")
REPLY = frame(1, "03 02 0000").split()
DELIVERIES = {"at once": True, "10 bits later": False}


class Client:
    """A TCP client of the server."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self.file = self.socket.makefile("rw", encoding="latin-1", newline="\n")

    def put(self, text):
        self.file.write(text)
        self.file.flush()

    def line(self):
        return self.file.readline()

    def ask(self, request, end="\n"):
        self.put(request + end)
        reply = self.line()
        assert reply.endswith("\n"), reply
        return reply[:-1]

    def close(self):
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)
        self.file.close()
        self.socket.close()


def now(reply):
    """Returns the time in a reply, in us."""
    word, at = reply.split(" ")[:2]
    assert word == "ok", reply
    assert len(at.split(".")[1]) == 3, reply
    return float(at)


def events(reply):
    """Returns the events of a reply: the byte in hexadecimal, its start and its end."""
    found = []
    for word in reply.split(" ")[2:]:
        byte, at = word.split("@")
        start, end = at.split("-")
        found.append((byte, float(start), float(end)))
    return found


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Served(unittest.TestCase):
    """A test with a server and its first client."""

    def setUp(self):
        self.clients = []

    def tearDown(self):
        for client in self.clients:
            client.close()
        self.assertEqual(Renode.end(), [], "exceptions that would have ended Renode")

    def connect(self):
        client = Client(self.port)
        self.clients.append(client)
        return client

    def connect_after_another(self):
        """Connects until the server has noticed that the previous client has disconnected."""
        deadline = time.monotonic() + 30
        while True:
            client = self.connect()
            reply = client.ask("hello 1")
            if reply.startswith("ok "):
                return client
            self.assertLess(time.monotonic(), deadline, reply)
            time.sleep(0.01)

    def start(self, **how):
        """Starts a server on a new board, and returns a client."""
        self.renode = Renode(**how)
        self.port = free_port()
        self.renode.exact_line(self.port)
        return self.connect()

    def emulated_us(self):
        return self.renode.machine._time.now / STEPS


class Requests(Served):
    def test_hello_reports_line_abilities_and_name(self):
        reply = self.start().ask("hello 1")
        self.assertEqual(
            reply,
            "ok 500000.000 version=1 line=9600,8N2 abilities=line,power,reset name=modio in Renode",
        )

    def test_hello_of_a_newer_client_reports_version_1(self):
        self.assertIn(" version=1 ", self.start().ask("hello 7"))

    def test_command_prints_the_address(self):
        self.start()
        self.assertEqual(self.renode.printed, [f"exact-line: 127.0.0.1:{self.port}"])

    def test_request_ends_after_its_characters_and_the_reply_follows(self):
        client = self.start()
        self.assertEqual(client.ask(f"send {READ}"), "ok 509166.666")
        reply = client.ask("run 20000")
        self.assertEqual(now(reply), 529166.666)
        self.assertEqual([byte for byte, _, _ in events(reply)], REPLY)
        for _, start, end in events(reply):
            self.assertEqual(start, end)
        self.assertAlmostEqual(events(reply)[0][1], 509166.666 + REPLY_US, delta=1)

    def test_events_are_reported_once_and_in_order_of_time(self):
        client = self.start()
        client.ask(f"send {READ}")
        self.assertEqual(events(client.ask("run 4000")), [])
        # The bytes of the reply follow each other every 3.25 us.
        first = events(client.ask("run 125"))
        self.assertIn(len(first), (2, 3))
        seen = first + events(client.ask("send gap:1000")) + events(client.ask("run 10000"))
        self.assertEqual([byte for byte, _, _ in seen], REPLY)
        self.assertEqual(seen, sorted(seen, key=lambda event: event[1]))

    def test_no_event_is_outside_the_time_of_its_request(self):
        for late in (0, 3):
            client = self.start()
            self.renode.machine._late = late
            before = now(client.ask(f"send {READ}"))
            seen = 0
            while before < 515_000:
                reply = client.ask("run 0.7")
                for _, at, _ in events(reply):
                    self.assertTrue(before <= at <= now(reply), reply)
                    seen += 1
                before = now(reply)
            self.assertEqual(seen, len(REPLY))
            self.clients.pop().close()

    def test_spaces_lower_case_and_carriage_return_are_accepted(self):
        client = self.start()
        self.assertEqual(client.ask(f"  send   {READ.lower()}  "), "ok 509166.666")
        self.assertEqual(len(events(client.ask("run 10000", end="\r\n"))), len(REPLY))

    def test_gap_longer_than_t3_5_splits_a_frame(self):
        client = self.start()
        for gap, answered in ((1000, True), (2800, True), (2900, False), (20000, False)):
            client.ask(f"send {READ[:6]} gap:{gap} {READ[6:]}")
            self.assertEqual(bool(events(client.ask("run 100000"))), answered, gap)

    def test_gaps_take_their_time_to_the_nanosecond(self):
        client = self.start()
        at = 500_000
        for piece, us in (("gap:0", 0), ("gap:0.001", 0.001), ("gap:4010.417", 4010.417), ("gap:7 gap:0.5", 7.5)):
            at += us
            self.assertAlmostEqual(now(client.ask(f"send {piece}")), at, places=6)

    def test_fractions_of_a_microsecond_add_up(self):
        client = self.start()
        for _ in range(10):
            reply = client.ask("run 0.3")
        self.assertEqual(reply, "ok 500003.000")
        self.assertEqual(self.emulated_us(), 500_003)

    def test_longest_times_are_accepted(self):
        client = self.start()
        self.assertEqual(client.ask("run 600000000"), "ok 600500000.000")
        self.assertEqual(client.ask("send gap:300000000 gap:300000000"), "ok 1200500000.000")

    def test_line_changes_rate_and_format(self):
        client = self.start()
        self.assertEqual(client.ask("line 19200 8N1"), "ok 500000.000")
        self.assertIn(" line=19200,8N1 ", client.ask("hello 1"))
        self.assertEqual(client.ask("send FFFF"), "ok 501041.666")
        self.assertEqual(client.ask("line 300 8N2"), "ok 501041.666")
        self.assertEqual(client.ask("line 4000000 8N2"), "ok 501041.666")

    def test_time_that_the_monitor_let_pass_is_in_the_next_reply(self):
        client = self.start()
        client.ask("hello 1")
        self.renode.machine._time.run_for(1000)
        self.assertEqual(client.ask("run 1"), "ok 501001.000")


class Power(Served):
    def ask_register(self, client, pdu):
        client.ask("send " + frame(1, pdu).replace(" ", ""))
        return [byte for byte, _, _ in events(client.ask("run 20000"))]

    def read(self, client, register):
        reply = self.ask_register(client, f"03 {register:04X} 0001")
        self.assertEqual(len(reply), 7, reply)
        return int(reply[3] + reply[4], 16)

    def write(self, client, register, value):
        self.assertTrue(self.ask_register(client, f"06 {register:04X} {value:04X}"))

    def test_power_on_clears_the_ram_and_is_the_cause_of_the_reset(self):
        client = self.start()
        self.write(client, 0, 5)
        self.write(client, 1, 6)
        before = now(client.ask("hello 1"))
        self.assertEqual(now(client.ask("power off")), before)
        self.assertEqual(now(client.ask("power on")), before)
        client.ask("run 500000")
        self.assertEqual([self.read(client, register) for register in (0, 1, 2)], [0, 0, 0x0C00])

    def test_reset_keeps_the_ram_and_is_reported_as_a_pin_reset(self):
        client = self.start()
        self.write(client, 0, 5)
        self.write(client, 1, 6)
        before = now(client.ask("hello 1"))
        self.assertEqual(now(client.ask("reset")), before)
        client.ask("run 500000")
        self.assertEqual([self.read(client, register) for register in (0, 1, 2)], [0, 6, 0x0400])

    def test_unit_starts_while_time_passes(self):
        for request in ("reset", "power off", "power on"):
            client = self.start()
            client.ask("power off" if request == "power on" else "hello 1")
            client.ask(request)
            self.assertEqual(self.ask_register(client, "03 0000 0001"), [], request)
            self.clients.pop().close()

    def test_time_passes_only_for_the_line_while_the_power_is_off(self):
        client = self.start()
        client.ask("power off")
        self.assertEqual(client.ask("run 1000.5"), "ok 501000.500")
        self.assertEqual(client.ask(f"send {READ}"), "ok 510167.166")
        self.assertEqual(self.emulated_us(), 500_000)
        self.assertEqual(self.renode.machine._written, [])
        self.assertEqual(client.ask("power on"), "ok 510167.166")
        self.assertEqual(client.ask("run 500000"), "ok 1010167.166")
        self.assertEqual(self.emulated_us(), 1_000_000)
        self.assertEqual(self.ask_register(client, "03 0000 0001"), REPLY)

    def test_power_on_of_a_powered_unit_changes_nothing(self):
        client = self.start()
        self.write(client, 1, 6)
        client.ask("power on")
        self.assertEqual(self.read(client, 1), 6)

    def test_reset_without_power_changes_nothing(self):
        client = self.start()
        client.ask("power off")
        client.ask("power off")
        client.ask("reset")
        client.ask("power on")
        client.ask("run 500000")
        self.assertEqual(self.read(client, 2), 0x0C00)

    def test_time_continues_when_a_reset_sets_the_emulation_s_time_back(self):
        client = self.start(resets_time=True)
        client.ask(f"send {READ}")
        before = now(client.ask("run 20000.4"))
        emulated = self.emulated_us()
        self.assertEqual(now(client.ask("reset")), before)
        self.assertEqual(now(client.ask("run 500000")), before + 500_000)
        self.assertEqual(self.emulated_us(), emulated + 500_000)
        start = now(client.ask(f"send {READ}"))
        reply = client.ask("run 20000")
        self.assertAlmostEqual(events(reply)[0][1], start + REPLY_US, delta=1)
        client.ask("power off")
        client.ask("run 1000")
        client.ask("power on")
        self.assertAlmostEqual(now(client.ask("run 1000")), now(reply) + 2000, places=3)


class Deliveries(Served):
    """Renode 1.16.1 delivers a byte immediately, and later versions 10 bits later."""

    def test_first_byte_of_every_reply_has_the_same_delay_after_the_request(self):
        for name, at_once in DELIVERIES.items():
            for line in ("9600 8N2", "9600 8N1"):
                client = self.start(at_once=at_once)
                client.ask(f"line {line}")
                for wait in ("20000", "20000.3", "33333.333"):
                    end = now(client.ask(f"send {READ}"))
                    reply = events(client.ask(f"run {wait}"))
                    self.assertEqual([byte for byte, _, _ in reply], REPLY)
                    self.assertAlmostEqual(reply[0][1] - end, REPLY_US, delta=1, msg=f"{name}, {line}")
                self.clients.pop().close()

    def test_bytes_reach_the_unit_at_their_ends(self):
        for name, at_once in DELIVERIES.items():
            client = self.start(at_once=at_once)
            # The first byte shows the delivery. If it is a later one, this takes 10 bits once.
            first = now(client.ask("send 00"))
            self.assertAlmostEqual(first, 500_000 + CHARACTER_US * (1 if at_once else 21 / 11), delta=0.01)
            start = now(client.ask("run 20000.1"))
            self.renode.machine._unit.delivered.clear()
            end = now(client.ask("send " + "55" * 256 + " gap:10.5 " + "AA" * 256))
            self.assertAlmostEqual(end, start + 512 * CHARACTER_US + 10.5, delta=0.002)
            if not at_once:
                client.ask("run 1")
            delivered = self.renode.machine._unit.delivered
            self.assertEqual(len(delivered), 512)
            for count, (at, _) in enumerate(delivered, 1):
                expected = start + count * CHARACTER_US + (10.5 if count > 256 else 0)
                self.assertAlmostEqual(at / STEPS, expected, delta=1.1, msg=f"{name}, byte {count}")
            self.clients.pop().close()

    def test_bytes_for_a_receiver_that_is_off_do_not_show_the_delivery(self):
        for at_once in DELIVERIES.values():
            client = self.start(at_once=at_once)
            client.ask("reset")
            self.assertEqual(client.ask("send 00"), "ok 501145.833")
            client.ask("run 498854.167")
            end = now(client.ask("send 00"))
            self.assertAlmostEqual(end, 1_000_000 + CHARACTER_US * (1 if at_once else 21 / 11), delta=0.01)
            self.clients.pop().close()


class Dialogue(Served):
    REQUESTS = [
        "hello 1", f"send {READ}", "run 20000", "run 0.4", "nonsense", f"send {READ[:6]} gap:900.25 {READ[6:]}",
        "run 3000", "line 19200 8N1", f"send {READ}", "run 123456.789", "line 9600 8N2", "reset", "run 500000",
        f"send {READ} gap:6000 {READ}", "power off", f"send {READ}", "run 1000", "power on", "run 500000",
        f"send {READ}", "run 20000", "findings", "hello 2",
    ]

    def test_same_dialogue_gives_the_same_bytes(self):
        for at_once in DELIVERIES.values():
            runs = []
            for _ in range(2):
                client = self.start(at_once=at_once)
                runs.append([client.ask(request) for request in self.REQUESTS])
                self.clients.pop().close()
            self.assertEqual(runs[0], runs[1])
            self.assertGreater(sum(reply.count("@") for reply in runs[0]), 20)


class BadLines(Served):
    BAD = {
        "": "empty",
        "   ": "empty",
        "go": '"go" is not a request',
        "HELLO 1": "not a request",
        "hello": "newest version",
        "hello 1 2": "newest version",
        "hello 0": "version",
        "hello -1": "version",
        "hello x": "version",
        "hello 1\t": "ASCII",
        "hello\xe91": "ASCII",
        "send": "at least one piece",
        "send 010": "even number",
        "send 01 1": "even number",
        "send 0x01": "even number",
        "send 01 zz": "even number",
        "send +1": "even number",
        "send gap:": "not a time",
        "send gap:-1": "not a time",
        "send gap:+1": "not a time",
        "send gap:1.0001": "not a time",
        "send gap:1.": "not a time",
        "send gap:.5": "not a time",
        "send gap:1e3": "not a time",
        "send gap:1,5": "not a time",
        "send gap:1.2.3": "not a time",
        "send gap:600000000.001": "more than",
        "send gap:300000000 gap:300000000.001": "more than",
        "send 01 gap:600000000": "more than",
        "send 01 parity:02": "faults",
        "send 01 stop:02": "faults",
        "send break:12": "faults",
        "send glitch:3": "faults",
        "send wait:3": "not a piece",
        "send :": "not a piece",
        "run": "a time",
        "run 1 2": "a time",
        "run -1": "not a time",
        "run x": "not a time",
        "run 1.2345": "not a time",
        "run 600000001": "more than",
        "run " + "9" * 5000: "more than",
        "run 1." + "0" * 5000: "not a time",
        "line": "a rate and a format",
        "line 9600": "a rate and a format",
        "line 9600 8N2 8N2": "a rate and a format",
        "line 299 8N2": "not a rate",
        "line 4000001 8N2": "not a rate",
        "line -9600 8N2": "not a rate",
        "line " + "9" * 5000 + " 8N2": "not a rate",
        "line 9600 8E1": "no parity",
        "line 9600 8O1": "no parity",
        "line 9600 8n1": "not supported",
        "power": "on or off",
        "power ON": "on or off",
        "power on off": "on or off",
        "reset now": "no arguments",
        "echo on": "the ability echo",
        "echo": "the ability echo",
        "findings": "the ability findings",
    }

    def test_bad_line_gets_one_error_and_no_time_passes(self):
        client = self.start()
        client.ask(f"send {READ}")
        hello = client.ask("hello 1")
        emulated = self.emulated_us()
        written = list(self.renode.machine._written)
        for line, reason in self.BAD.items():
            reply = client.ask(line)
            self.assertTrue(reply.startswith("error "), f"{line:.30}: {reply}")
            self.assertIn(reason, reply)
            self.assertTrue(reply.isascii() and len(reply) < 220, reply)
            # Exactly one line: the next reply answers this request.
            self.assertEqual(client.ask("hello 1"), hello, f"{line:.30}")
        self.assertEqual(self.emulated_us(), emulated)
        self.assertEqual(self.renode.machine._written, written)
        self.assertEqual(len(events(client.ask("run 20000"))), len(REPLY), "pending events are kept")

    def test_longest_line_is_accepted(self):
        client = self.start()
        self.assertEqual(client.ask("hello 1" + " " * (1_048_576 - 7)), client.ask("hello 1"))

    def test_line_over_the_limit_gets_an_error_and_ends_the_connection(self):
        client = self.start()
        before = client.ask("hello 1")
        reply = client.ask("hello 1" + " " * (1_048_577 - 7))
        self.assertTrue(reply.startswith("error ") and "1048576" in reply, reply)
        self.assertEqual(client.line(), "")
        client.close()
        self.assertEqual(self.connect_after_another().ask("hello 1"), before)

    def test_error_of_renode_is_reported_and_the_server_continues(self):
        client = self.start()
        before = client.ask("hello 1")
        self.renode.machine._refusal = "the emulation\nis already started"
        self.assertEqual(client.ask("run 10"), "error the emulation is already started")
        self.assertEqual(client.ask("hello 1"), before)
        self.renode.machine._refusal = None
        self.assertEqual(client.ask("run 10"), "ok 500010.000")

    def test_emulation_that_cannot_start_is_reported(self):
        self.renode = Renode()
        self.renode.machine._refusal = "no"
        self.port = free_port()
        self.renode.exact_line(self.port)
        client = self.connect()
        self.assertTrue(client.ask("hello 1").startswith("ok 0.000 "))
        self.assertEqual(client.ask("run 1"), "error no")


class Clients(Served):
    def test_second_client_gets_an_error_and_the_first_continues(self):
        first = self.start()
        first.ask(f"send {READ}")
        for _ in range(3):
            second = self.connect()
            self.assertEqual(second.line(), "error the line is in use by another client\n")
            self.assertEqual(second.line(), "")
        self.assertEqual(len(events(first.ask("run 20000"))), len(REPLY))

    def test_client_that_disconnects_between_send_and_run_leaves_the_reply_to_the_next(self):
        first = self.start()
        first.ask(f"send {READ}")
        first.close()
        second = self.connect_after_another()
        self.assertEqual([byte for byte, _, _ in events(second.ask("run 20000"))], REPLY)

    def test_client_that_does_not_wait_for_its_reply_is_replaced(self):
        first = self.start()
        first.ask("hello 1")
        first.put(f"send {READ}\n")
        first.close()
        second = self.connect_after_another()
        self.assertEqual([byte for byte, _, _ in events(second.ask("run 20000"))], REPLY)

    def test_client_that_disconnects_in_the_middle_of_a_line_is_replaced(self):
        first = self.start()
        first.ask(f"send {READ}")
        first.put("send 0102030")
        first.close()
        second = self.connect_after_another()
        self.assertEqual([byte for byte, _, _ in events(second.ask("run 20000"))], REPLY)

    def test_settings_are_kept_for_the_next_client(self):
        first = self.start()
        first.ask("line 19200 8N1")
        first.ask("power off")
        first.close()
        second = self.connect_after_another()
        self.assertIn(" line=19200,8N1 ", second.ask("hello 1"))
        second.ask("run 100")
        self.assertEqual(self.emulated_us(), 500_000)

    def test_requests_that_are_sent_together_are_answered_in_order(self):
        client = self.start()
        client.put("run 1\nrun 2\nhello\nrun 3\n")
        replies = [client.line() for _ in range(4)]
        self.assertEqual(replies[:2], ["ok 500001.000\n", "ok 500003.000\n"])
        self.assertTrue(replies[2].startswith("error "))
        self.assertEqual(replies[3], "ok 500006.000\n")


class Command(Served):
    def test_port_in_use_is_an_error_of_the_command(self):
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            port = other.getsockname()[1]
            renode = Renode()
            with self.assertRaisesRegex(ValueError, f"cannot listen on 127.0.0.1:{port}: .*in use"):
                renode.exact_line(port)
        self.assertEqual(renode.printed, [])
        # The command works afterwards.
        renode.exact_line(free_port())

    def test_port_that_does_not_exist_is_an_error(self):
        for port in (0, -1, 65536):
            with self.assertRaisesRegex(ValueError, "1 to 65535"):
                Renode().exact_line(port)

    def test_second_server_for_the_same_machine_is_an_error(self):
        self.start()
        with self.assertRaisesRegex(ValueError, "serves this machine already"):
            self.renode.exact_line(free_port())

    def test_command_without_a_machine_is_an_error(self):
        renode = Renode()
        renode.monitor.Machine = None
        with self.assertRaisesRegex(ValueError, "include board.resc"):
            renode.exact_line(free_port())


class Fake(unittest.TestCase):
    def test_unknown_names_are_errors(self):
        machine = Machine(True, False)
        for get in (lambda: machine.Pause, lambda: machine["sysbus"].ReadByte, lambda: machine["sysbus.usart2"]):
            with self.assertRaises((AttributeError, KeyError)):
                get()
        with self.assertRaises(AttributeError):
            machine.Started = True


if __name__ == "__main__":
    unittest.main()
