"""Fakes of what exact-line.py uses of .NET and Renode, for Python 3 and with real sockets. Except TcpClient.Close,
all calls were tested in Renode. Any other name raises AttributeError or ImportError.

A name that begins with an underscore belongs to the fake.
"""

import contextlib
import socket
import sys
import threading
import types
from unittest import mock

from exact_line_unit import STEPS, Unit, VirtualTime

from renode_fake import RENODE

UART_SR, UART_CR1, RESET_FLAGS = 0x40013800, 0x4001380C, 0x400213F0
RXNE, ENABLED_RECEIVER = 1 << 5, 1 << 13 | 1 << 2
# Versions after 1.16.1 deliver a byte 10 bits after WriteChar: at 9600 bit/s, the unit's rate.
DELIVERY_US = 10 * 1_000_000 / 9600


class Exact:
    """Allows only the attributes in `__slots__` and its methods; every other name is an error."""

    __slots__ = ()


class Byte(Exact):
    """System.Byte."""

    __slots__ = ("_value",)

    def __init__(self, value):
        assert type(value) is int and 0 <= value <= 255, value
        self._value = value

    def __int__(self):
        return self._value


class Event(Exact):
    """A .NET event: only += is allowed."""

    __slots__ = ("_handlers",)

    def __init__(self):
        self._handlers = []

    def __iadd__(self, handler):
        self._handlers.append(handler)
        return self


class Uart(Exact):
    """UART.STM32_UART."""

    __slots__ = ("_board", "_busy_until", "CharReceived")

    def __init__(self, board):
        self._board = board
        self._busy_until = 0
        self.CharReceived = Event()

    def WriteChar(self, value):
        assert type(value) is Byte, value
        board, byte = self._board, int(value)
        assert not board._running, "the emulation runs"
        board._written.append((board._time.now, byte))
        if board._at_once:
            board._unit.deliver(byte)
        elif board._unit.receiving:
            start = max(self._busy_until, board._time.now)
            self._busy_until = start + round(DELIVERY_US * STEPS)
            board._time.after((self._busy_until - board._time.now) / STEPS, lambda: board._unit.deliver(byte))


class Sysbus(Exact):
    """The system bus, with the registers that exact-line.py may use."""

    __slots__ = ("_board",)

    def __init__(self, board):
        self._board = board

    def ReadDoubleWord(self, address):
        unit = self._board._unit
        # The remaining bits are as in a running unit.
        registers = {UART_SR: 0xC0 | unit.unread * RXNE, UART_CR1: 0x0128 | unit.receiving * ENABLED_RECEIVER}
        return registers[address]

    def WriteDoubleWord(self, address, value):
        assert address == RESET_FLAGS
        self._board._unit.next_flags = value


class Memory(Exact):
    """Memory.MappedMemory."""

    __slots__ = ("_board",)

    def __init__(self, board):
        self._board = board

    def ZeroAll(self):
        self._board._unit.zero_ram()


class TimeInterval(Exact):
    """Antmicro.Renode.Time.TimeInterval."""

    __slots__ = ("_us",)

    def __init__(self, us):
        self._us = us

    @staticmethod
    def FromMicroseconds(us):
        assert type(us) is int and 0 < us < 1 << 31, us
        return TimeInterval(us)

    @property
    def TotalMicroseconds(self):
        return float(self._us)


class TimeStamp(Exact):
    """Antmicro.Renode.Time.TimeStamp."""

    __slots__ = ("TimeElapsed",)

    def __init__(self, interval):
        self.TimeElapsed = interval


class Machine(Exact):
    """The machine and its state."""

    __slots__ = ("_at_once", "_time", "_unit", "_parts", "_running", "_started", "_set_back", "_zero",
                 "_resets_time", "_written", "_refusal", "_late")

    def __init__(self, at_once, resets_time):
        self._at_once = at_once
        self._resets_time = resets_time
        self._running = self._started = False
        # Time at which the emulation's own time was reset to 0.
        self._zero = 0
        self._time = VirtualTime()
        self._written = []
        # Text of the error that RunFor raises, if it is to fail.
        self._refusal = None
        # Number of steps by which RunFor stops too late.
        self._late = 0
        uart = Uart(self)
        self._unit = Unit(self._time, lambda byte: [handler(Byte(byte)) for handler in uart.CharReceived._handlers])
        self._parts = {"sysbus": Sysbus(self), "sysbus.usart1": uart, "sysbus.sram": Memory(self)}

    def __getitem__(self, name):
        return self._parts[name]

    @property
    def ElapsedVirtualTime(self):
        return TimeStamp(TimeInterval((self._time.now - self._zero) / STEPS))

    def Reset(self):
        assert not self._running
        # Renode ignores a reset when the machine has not run yet.
        if self._started:
            self._unit.reset()
            self._parts["sysbus.usart1"]._busy_until = 0
            if self._resets_time:
                self._zero = self._time.now


class Emulation(Exact):
    """The emulation with its one machine."""

    __slots__ = ("_machine",)

    def __init__(self, machine):
        self._machine = machine

    def RunFor(self, interval):
        machine = self._machine
        assert not machine._running, "RunFor in two threads"
        if machine._refusal:
            raise RuntimeError(machine._refusal)
        machine._running = machine._started = True
        machine._time.run_for(interval._us + machine._late / STEPS)
        machine._running = False


class IPAddress(Exact):
    """System.Net.IPAddress."""

    Loopback = "127.0.0.1"


class TcpListener(Exact):
    """System.Net.Sockets.TcpListener."""

    __slots__ = ("_address", "_socket")
    _opened = []

    def __init__(self, address, port):
        self._address = (address, port)

    def Start(self):
        self._socket = socket.socket()
        self._opened.append(self._socket)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind(self._address)
        self._socket.listen()

    def AcceptTcpClient(self):
        return TcpClient(self._socket.accept()[0])


class TcpClient(Exact):
    """System.Net.Sockets.TcpClient. Only Close was not tested in Renode."""

    __slots__ = ("_socket",)

    def __init__(self, connection):
        self._socket = connection
        TcpListener._opened.append(connection)

    def GetStream(self):
        return self._socket

    def Close(self):
        # The files made from the socket would keep it open.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


class StreamReader(Exact):
    """System.IO.StreamReader."""

    __slots__ = ("_file",)

    def __init__(self, stream):
        # Like .NET: UTF-8, and a carriage return alone also ends a line.
        self._file = stream.makefile("r", encoding="utf-8", errors="replace", newline=None)

    def ReadLine(self):
        """Returns a line without its end, also the last one without an end, or None after that."""
        line = self._file.readline()
        if not line:
            return None
        return line[:-1] if line.endswith("\n") else line


class StreamWriter(Exact):
    """System.IO.StreamWriter."""

    __slots__ = ("_file", "AutoFlush")

    def __init__(self, stream):
        self._file = stream.makefile("w", encoding="utf-8", newline="\n")
        self.AutoFlush = False

    def WriteLine(self, text):
        assert type(text) is str
        self._file.write(text + "\n")
        if self.AutoFlush:
            self._file.flush()


class Thread(Exact):
    """System.Threading.Thread. An exception that leaves a thread ends Renode, so it is kept for the test."""

    __slots__ = ("_work", "IsBackground")
    _died = []

    def __init__(self, start):
        assert isinstance(start, ThreadStart)
        self._work = start._work
        self.IsBackground = False

    def Start(self):
        assert self.IsBackground
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        try:
            self._work()
        except BaseException as error:
            self._died.append(error)


class ThreadStart(Exact):
    """System.Threading.ThreadStart."""

    __slots__ = ("_work",)

    def __init__(self, work):
        self._work = work


def _modules(manager):
    """Returns the modules that exact-line.py imports."""

    def module(name, **members):
        made = types.ModuleType(name)
        vars(made).update(members)
        return name, made

    return dict([
        module("clr", AddReference=lambda name: None),
        module("System", Byte=Byte),
        module("System.IO", StreamReader=StreamReader, StreamWriter=StreamWriter),
        module("System.Net", IPAddress=IPAddress),
        module("System.Net.Sockets", TcpListener=TcpListener),
        module("System.Threading", Thread=Thread, ThreadStart=ThreadStart),
        module("Antmicro"),
        module("Antmicro.Renode"),
        module("Antmicro.Renode.Core", EmulationManager=manager),
        module("Antmicro.Renode.Time", TimeInterval=TimeInterval),
    ])


class Renode:
    """Renode with a machine, after `include exact-line.py`.

    `at_once` is Renode 1.16.1: a byte is delivered immediately by WriteChar. `resets_time` makes a reset of
    the machine set the emulation's time back to 0.
    """

    def __init__(self, at_once=True, resets_time=False):
        self.machine = Machine(at_once, resets_time)
        self.printed = []
        manager = types.SimpleNamespace(Instance=types.SimpleNamespace(CurrentEmulation=Emulation(self.machine)))
        path = RENODE / "exact-line.py"
        self.monitor = types.SimpleNamespace(Machine=self.machine)
        self.scope = {"monitor": self.monitor, "print": self.printed.append}
        with mock.patch.dict(sys.modules, _modules(manager)):
            exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), self.scope)

    def exact_line(self, port):
        """Runs the monitor's command."""
        assert self.scope["mc_exact_line"](port) is None

    @staticmethod
    def end():
        """Closes all sockets, and returns the exceptions that would have ended Renode."""
        for opened in TcpListener._opened:
            with contextlib.suppress(OSError):
                opened.shutdown(socket.SHUT_RDWR)
            opened.close()
        TcpListener._opened.clear()
        died = list(Thread._died)
        Thread._died.clear()
        return died
