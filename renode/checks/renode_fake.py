"""Fakes of what Renode's IronPython provides for Python peripherals and monitor commands, for Python 3.

Like Renode, this runs the whole script at every access, in a scope that is kept.
"""

import types
from pathlib import Path

RENODE = Path(__file__).resolve().parent.parent


class Request:
    """The current access, with the names of Renode 1.16.1 and later."""

    def __init__(self):
        self.IsInit = self.IsRead = self.IsWrite = self.IsUser = False
        self.Offset = 0
        self._value = 0

    @property
    def Value(self):
        return self._value

    @Value.setter
    def Value(self, value):
        # Renode uses an unsigned number: any other value ends the emulation there.
        assert isinstance(value, int) and 0 <= value < 1 << 64, value
        self._value = value


class Machine(dict):
    """The machine: its peripherals by name."""


class Peripheral:
    """A Python.PythonPeripheral that runs a file of renode/peripherals."""

    def __init__(self, name, machine=None):
        path = RENODE / "peripherals" / name
        self.code = compile(path.read_text(encoding="utf-8"), str(path), "exec")
        self.request = Request()
        self.warnings = []
        peripheral = types.SimpleNamespace(WarningLog=self.warnings.append, GetMachine=lambda: machine)
        monitor = types.SimpleNamespace(Machine=machine)
        self.scope = {"request": self.request, "self": peripheral, "monitor": monitor, "size": 0x400}
        self.inited = False

    def _run(self, kind, offset=0, value=0):
        request = self.request
        request.IsInit, request.IsRead, request.IsWrite = kind == "init", kind == "read", kind == "write"
        request.Offset, request.Value = offset, value
        exec(self.code, self.scope)
        self._check_saved()
        return request.Value

    def _check_saved(self):
        """Checks that Renode can save all variables: it only saves numbers and dictionaries."""
        given = {"request", "self", "monitor", "size", "__builtins__"}
        for name, value in self.scope.items():
            assert name in given or isinstance(value, (int, dict)), f"{name} cannot be saved"

    def reset(self):
        self._run("init")
        self.inited = True

    def read(self, offset):
        if not self.inited:
            self.reset()
        return self._run("read", offset)

    def write(self, offset, value):
        if not self.inited:
            self.reset()
        self._run("write", offset, value)


def commands(machine):
    """Returns the functions and the modules of commands.py for a machine."""
    path = RENODE / "commands.py"
    monitor = types.SimpleNamespace(Machine=machine)
    scope = {"monitor": monitor}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), scope)
    public = {name: value for name, value in scope.items() if name.startswith("mc_") or name == "MODIO_MODULES"}
    return types.SimpleNamespace(**public)
