"""The client supports everything in the description of the simulator's HTTP interface."""

import ast
import inspect
import pathlib
import re
import typing
import unittest

import modio_sim
from modio_sim.connection import Http
from simulator import firmware

HERE = pathlib.Path(__file__).resolve().parent
with modio_sim.Simulator.start(options=firmware()) as running:
    DESCRIPTION = running.openapi()

CHANNELS = [{"kind": "none"}] * 4
STATE = {
    "virtual_ms": 1, "board": "modio-08", "powered": True, "dip": 1, "address": 1, "module": "4di", "configured": "4di",
    "leds": {"activity": False, "fault": False, "run": True}, "driver_enable": False,
    "line": {"baud": 9600, "format": "8N2", "rx_frames": 0, "tx_frames": 0},
    "channels": CHANNELS, "log_tail": [], "slots": [{"port": 1, "module": "4di", "configured": "4di", "channels": CHANNELS}],
}

BOARDS = [{"name": name, "board": "modio-02", "dip": 1, "address": 1, "powered": True, "fault": False, "modules": ["4di"]}
          for name in ("one", "left/1")]

# A call of each method that makes a request, at least one per method.
CALLS = {
    "board": [{"name": "one"}], "boards": [{}], "endpoints": [{}], "events": [{}], "faults": [{}], "findings": [{}], "frames": [{"since": 7}],
    "openapi": [{}], "power_cycle": [{}], "power_off": [{}], "power_on": [{}],
    "request": [{"pdu": b"\x07"}],
    "set_channel": [{"channel": 4, "energised": True}, {"channel": 4, "manual": True, "port": 1}],
    "set_dip": [{"value": 5}], "set_faults": [{"faults": {"drop_rate": 0.5}}],
    "set_module": [{"name": "4do"}, {"name": "4do", "port": 1}],
    "set_terminal": [{"name": "X0", "energised": True}], "state": [{}],
}
# Methods that make no request, or make requests only through others.
OTHERS = {"attach", "close", "endpoint", "start", "wait", "wait_for"}


class Recorder(Http):
    """Records the requests, and returns answers of the right form."""

    def __init__(self):
        super().__init__("http://nowhere", 1)
        self.asked = set()

    def open(self, method, path, body=None):
        self.asked.add((method, path.partition("?")[0]))

    def ask(self, method, path, body=None):
        self.open(method, path)
        return {
            "boards": BOARDS, "endpoints": {}, "findings": {"findings": []},
            "frames": {"frames": []}, "faults": {}, "openapi.json": {}, "pdu": {"pdu": "0700"},
        }.get(path.partition("?")[0].rpartition("/")[2], STATE)


def called(simulator, board):
    """Calls all methods of a simulator, those of a board on `board`. Returns the requests."""
    recorder = simulator._http
    recorder.asked.clear()
    for name, calls in CALLS.items():
        for arguments in calls:
            getattr(board if hasattr(board, name) else simulator, name)(**arguments)
    return recorder.asked


def matches(template, path):
    """Returns whether a path matches a template such as `/api/channels/{channel}`."""
    return re.fullmatch(re.sub(r"\\{[^/]+\\}", "[^/]+", re.escape(template)), path)


def members_of(schemas, schema):
    """Returns the names of all members that a schema describes."""
    if "$ref" in schema:
        return members_of(schemas, schemas[schema["$ref"].rpartition("/")[2]])
    parts = schema.get("oneOf", []) + schema.get("allOf", [])
    return set(schema.get("properties", ())).union(*(members_of(schemas, part) for part in parts))


class Paths(unittest.TestCase):
    def setUp(self):
        self.simulator = modio_sim.Simulator("http://nowhere")
        self.simulator._http = Recorder()

    def described(self):
        return [(method.upper(), path) for path, methods in DESCRIPTION["paths"].items()
                for method in methods if method in ("get", "post", "put", "patch", "delete")]

    def test_every_method_is_called_here(self):
        methods = {name for name, _ in inspect.getmembers(modio_sim.Simulator, callable) if name[0] != "_"}
        self.assertEqual(methods, CALLS.keys() | OTHERS)

    def test_every_described_request_is_made(self):
        asked = called(self.simulator, self.simulator)
        for method, template in self.described():
            made = any(method == kind and matches(template, path) for kind, path in asked)
            self.assertTrue(made, f"no method makes the request {method} {template}")

    def test_requests_to_a_board_contain_its_name(self):
        asked = called(self.simulator, self.simulator.board("left/1"))
        of_all = {("GET", f"/api/{name}") for name in ("events", "boards", "endpoints", "openapi.json")}
        for method, path in asked - of_all:
            self.assertTrue(path.startswith("/api/boards/left%2F1/"), path)
        self.assertIn(("POST", "/api/boards/left%2F1/slots/1/channels/4"), asked)

    def test_unknown_board_is_refused_with_the_names_of_the_boards(self):
        with self.assertRaisesRegex(modio_sim.RefusedError, "no board 'two'; the boards are one, left/1") as refused:
            self.simulator.board("two")
        self.assertEqual(refused.exception.status, 404)

    def test_exactly_one_value_is_applied_to_a_channel(self):
        for given in ({}, {"energised": True, "manual": False}):
            with self.assertRaises(ValueError):
                self.simulator.set_channel(1, **given)
        self.assertEqual(self.simulator._http.asked, set())

    def test_number_in_a_path_must_be_a_whole_number(self):
        for wrong in ("1", "1?x", "../dip", True, 1.0, -1, None, float("nan")):
            with self.assertRaisesRegex(ValueError, "channel must be a whole number"):
                self.simulator.set_channel(wrong, energised=True)
            with self.assertRaisesRegex(ValueError, "since must be a whole number"):
                self.simulator.frames(wrong)
            if wrong is not None:
                with self.assertRaisesRegex(ValueError, "port must be a whole number"):
                    self.simulator.set_channel(1, energised=True, port=wrong)
                with self.assertRaisesRegex(ValueError, "port must be a whole number"):
                    self.simulator.set_module("4do", port=wrong)
        self.assertEqual(self.simulator._http.asked, set())


class Types(unittest.TestCase):
    def test_every_described_member_is_a_field(self):
        schemas = DESCRIPTION["components"]["schemas"]
        for schema, of in (("State", modio_sim.State), ("Slot", modio_sim.Slot), ("Channel", modio_sim.Channel),
                           ("Frame", modio_sim.Frame), ("Finding", modio_sim.Finding), ("Board", modio_sim.BoardInfo),
                           ("Faults", modio_sim.Faults), ("Leds", modio_sim.Leds), ("Line", modio_sim.Line),
                           ("Radio", modio_sim.Radio), ("Terminal", modio_sim.Terminal)):
            members = members_of(schemas, schemas[schema])
            fields = typing.get_type_hints(of).keys()
            self.assertEqual(members - fields, set(), f"{of.__name__} does not have these fields")

    def test_additional_members_of_a_newer_simulator_are_ignored(self):
        state = modio_sim.State.from_json({**STATE, "temperature": 300})
        self.assertEqual(state.virtual_ms, 1)
        self.assertEqual(state.slot(1).module, "4di")
        self.assertIsNone(state.radio)
        with self.assertRaises(KeyError):
            state.slot(5)
        terminal = {"name": "AD0", "kind": "voltage", "millivolts": 5000, "colour": "green"}
        state = modio_sim.State.from_json({**STATE, "terminals": [terminal]})
        self.assertEqual(state.terminal("AD0").millivolts, 5000)
        with self.assertRaises(KeyError):
            state.terminal("AD1")


class Package(unittest.TestCase):
    def test_package_compiles_with_its_oldest_python_version(self):
        for file in (HERE.parent / "modio_sim").glob("*.py"):
            ast.parse(file.read_text(), str(file), feature_version=(3, 9))

    def test_version_is_that_of_the_simulator(self):
        versions = {re.search(r'^version = "(.+)"$', file.read_text(), re.MULTILINE)[1]
                    for file in (HERE.parent / "pyproject.toml", HERE.parents[3] / "Cargo.toml")}
        self.assertEqual(len(versions), 1, versions)
