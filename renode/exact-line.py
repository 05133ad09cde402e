# Serves the unit's RS-485 line by the exact-line protocol (docs/conformance.md). Virtual time passes only while
# a request asks for it, so the results do not depend on how busy the machine is.
#
#   exact_line PORT   a command of the monitor: listens on TCP port PORT of 127.0.0.1
#
# Include this file after board.resc, and do not `start` the emulation. line-exact.resc does both.
#
# A byte reaches the unit when its last stop bit ends. Renode 1.16.1 delivers a byte immediately in WriteChar; later
# versions deliver it 10 bits later, for every format. LineUnit detects which version runs.
#
# Runs in Renode's IronPython 2, in the monitor's scope. All names begin with `line`, so that they do not replace
# names of other scripts. All calls were tested in Renode 1.16.1 and in later versions, except TcpClient.Close,
# whose failure does no harm. Therefore ReadLine reads the requests, with two consequences: a carriage return alone
# also ends a line, and the last line of a client that disconnects counts even without a line end.
import clr
clr.AddReference("System.Net.Sockets")
clr.AddReference("System.Net.Primitives")
from System import Byte
from System.IO import StreamReader, StreamWriter
from System.Net import IPAddress
from System.Net.Sockets import TcpListener
from System.Threading import Thread, ThreadStart
from Antmicro.Renode.Core import EmulationManager
from Antmicro.Renode.Time import TimeInterval

# Longest request line in characters, without the line end.
LINE_LONGEST = 1048576
# Longest virtual time that one request may take.
LINE_MOST_NS = 600000000000
# Virtual time of the first start of all, in which the loader verifies the image and resets, and of every other start
# until the unit answers.
LINE_FIRST_START_NS = 1500000000
LINE_START_NS = 500000000

# Bits per character of each format. Renode's UART has no parity, so 8E1 and 8O1 are missing.
LINE_FORMATS = {"8N1": 10, "8N2": 11}
# Bits between WriteChar and the delivery in versions after 1.16.1.
LINE_DELIVERY_BITS = 10

# USART1 (RM0008 27.6): status register with RXNE, control register 1 with UE and RE.
LINE_UART_SR = 0x40013800
LINE_UART_RXNE = 1 << 5
LINE_UART_CR1 = 0x4001380C
LINE_UART_RECEIVING = 1 << 13 | 1 << 2

# Flags of the next reset, a register of peripherals/rcc.py: power-on and pin, or only the pin.
LINE_RESET_FLAGS = 0x400213F0
LINE_POWER_ON = 0x0C000000
LINE_PIN = 0x04000000

# Abilities that this server does not have, by the piece or request that needs them.
LINE_MISSING = {
    "parity": "faults",
    "stop": "faults",
    "break": "faults",
    "glitch": "faults",
    "echo": "echo",
    "findings": "findings",
}


class LineError(Exception):
    """Error when a request cannot be executed; its text is the reason."""


def line_text(ns):
    """Returns a time in the protocol's format, in microseconds with three decimals."""
    return "%d.%03d" % (ns // 1000, ns % 1000)


def line_shown(text):
    """Returns the beginning of a text that may be very long."""
    return '"%s"' % text[:40]


def line_reason(error):
    """Returns the text of an error as one short line of ASCII."""
    text = " ".join(("%s" % error).split())[:200]
    return "".join(c if " " <= c <= "~" else "?" for c in text) or "no reason is known"


def line_number(text, most):
    """Returns the number from a text of decimal digits, or None above `most`."""
    # Check the length first, because converting very many digits takes very long.
    if not text.isdigit() or len(text) > 12 or int(text) > most:
        return None
    return int(text)


def line_time(text):
    """Returns a time in ns from a text in microseconds with at most three decimals."""
    whole, point, decimals = text.partition(".")
    if not whole.isdigit() or point and (not decimals.isdigit() or len(decimals) > 3):
        raise LineError("%s is not a time in microseconds, such as 4010 or 4010.417" % line_shown(text))
    us = line_number(whole, LINE_MOST_NS // 1000)
    ns = None if us is None else us * 1000 + int((decimals + "000")[:3])
    if ns is None or ns > LINE_MOST_NS:
        raise LineError("%s us is more than %d us" % (line_shown(text), LINE_MOST_NS // 1000))
    return ns


def line_bytes(text):
    """Returns the bytes from a text of hexadecimal digits."""
    if len(text) % 2 or any(c not in "0123456789abcdefABCDEF" for c in text):
        raise LineError("%s is not an even number of hexadecimal digits" % line_shown(text))
    return [int(text[at:at + 2], 16) for at in range(0, len(text), 2)]


def line_piece(word):
    """Returns a piece of `send` as its bytes and the silence after them in ns."""
    kind, colon, value = word.partition(":")
    if not colon:
        return line_bytes(word), 0
    if kind == "gap":
        return [], line_time(value)
    if kind in LINE_MISSING:
        raise LineError("%s needs the ability %s, which Renode does not have" % (kind, LINE_MISSING[kind]))
    raise LineError("%s is not a piece: use hexadecimal bytes or gap" % line_shown(kind))


class LineClock(object):
    """The line's time in ns: the emulation's time, and the time that passed while the power was off."""

    def __init__(self, machine):
        self.machine = machine
        self.emulation = EmulationManager.Instance.CurrentEmulation
        self.powered = True
        self.offset = 0
        self.now = self.emulated()
        # End of the time span that is passing.
        self.target = self.now

    def emulated(self):
        """Returns the emulation's time in ns. Renode counts in steps of 1/8 us, so the result is exact."""
        return int(self.machine.ElapsedVirtualTime.TimeElapsed.TotalMicroseconds * 1000 + 0.5)

    def instant(self):
        """Returns the time of an event that occurs while time passes."""
        return min(max(self.emulated() + self.offset, self.now), self.target)

    def catch_up(self):
        """Adds the time that a command of the monitor let pass."""
        if self.powered:
            self.now = max(self.now, self.emulated() + self.offset)

    def run_until(self, target):
        """Lets time pass. The emulation runs for whole microseconds, so it stops less than one microsecond before
        `target`; the next run compensates for that."""
        self.target = target
        if self.powered:
            self.run_emulation_until(target - self.offset)
        else:
            self.offset += target - self.now
        self.now = target

    def run_emulation_until(self, target):
        while True:
            before = self.emulated()
            us = (target - before) // 1000
            if us <= 0:
                return
            # Returns when the emulation has stopped again. int() converts a long to a plain number.
            self.emulation.RunFor(TimeInterval.FromMicroseconds(int(us)))
            if self.emulated() <= before:
                raise LineError("the emulation does not run")

    def reset(self):
        """Resets the machine. The line's time continues, even when the reset sets the emulation's time back."""
        before = self.emulated()
        self.machine.Reset()
        self.offset += before - self.emulated()


class LineUnit(object):
    """The unit: its power and reset pin, and the bytes to and from its UART."""

    def __init__(self, machine):
        self.clock = LineClock(machine)
        self.sysbus = machine["sysbus"]
        self.sram = machine["sysbus.sram"]
        self.uart = machine["sysbus.usart1"]
        self.rate = 9600
        self.format = "8N2"
        # Whether WriteChar delivers a byte immediately; None until the first byte shows it.
        self.at_once = None
        self.events = []

    def listen(self):
        """Collects everything that the unit sends from now on."""
        uart = self.uart
        uart.CharReceived += lambda byte: self.keep(byte)

    def keep(self, byte):
        # The emulation calls this, and an exception would end it.
        try:
            at = line_text(self.clock.instant())
            # Renode's UART sends a byte without duration: its start is its end.
            self.events.append("%02X@%s-%s" % (int(byte), at, at))
        except:
            pass

    def take_events(self):
        """Returns the events since the last call."""
        events = list(self.events)
        del self.events[:]
        return events

    def bits(self, count):
        """Returns the duration of `count` bits in ns."""
        return count * 1000000000 // self.rate

    def duration(self, pieces):
        """Returns how long the pieces take on the line, in ns."""
        characters = sum(len(data) for data, _ in pieces)
        return self.bits(characters * LINE_FORMATS[self.format]) + sum(gap for _, gap in pieces)

    def send(self, pieces):
        """Sends pieces on the line, and lets time pass until the last one has ended."""
        clock = self.clock
        # The bits of the characters are summed up separately, so that rounding errors do not add up.
        rest = clock.now
        bits = 0
        for data, gap in pieces:
            for byte in data:
                bits += LINE_FORMATS[self.format]
                rest += self.deliver(byte, rest + self.bits(bits))
            rest += gap
        clock.run_until(rest + self.bits(bits))

    def deliver(self, byte, end):
        """Delivers the byte whose last stop bit ends at `end`. Returns the delay of its end in ns."""
        clock = self.clock
        lead = self.bits(LINE_DELIVERY_BITS)
        clock.run_until(end - lead if self.at_once is False else end)
        if not clock.powered:
            return 0
        shows = self.at_once is None and self.receives()
        self.uart.WriteChar(Byte(byte))
        if not shows:
            return 0
        self.at_once = self.has_byte()
        if self.at_once:
            return 0
        # The delivery of the first byte takes 10 more bits. The line waits for it, so that the times after it are
        # exact in this version, too.
        clock.run_until(end + lead)
        return lead

    def receives(self):
        """Returns whether the receiver is on and empty, so that a byte shows the kind of delivery."""
        on = self.sysbus.ReadDoubleWord(LINE_UART_CR1) & LINE_UART_RECEIVING == LINE_UART_RECEIVING
        return on and not self.has_byte()

    def has_byte(self):
        return self.sysbus.ReadDoubleWord(LINE_UART_SR) & LINE_UART_RXNE != 0

    def power_on(self):
        if not self.clock.powered:
            self.clock.powered = True
            self.sysbus.WriteDoubleWord(LINE_RESET_FLAGS, LINE_POWER_ON)
            self.sram.ZeroAll()
            self.clock.reset()

    def power_off(self):
        self.clock.powered = False

    def reset(self):
        if self.clock.powered:
            self.sysbus.WriteDoubleWord(LINE_RESET_FLAGS, LINE_PIN)
            self.clock.reset()


class LineRequests(object):
    """Executes request lines on a unit."""

    def __init__(self, unit):
        self.unit = unit

    def answer(self, text):
        """Returns the reply to a request line, both without the line end."""
        try:
            return "ok " + self.reply(text)
        except Exception as error:
            return "error " + line_reason(error)

    def reply(self, text):
        if len(text) > LINE_LONGEST:
            raise LineError("the line is longer than %d characters" % LINE_LONGEST)
        if any(not " " <= c <= "~" for c in text):
            raise LineError("the line is not ASCII text")
        words = [word for word in text.split(" ") if word]
        if not words:
            raise LineError("the line is empty: a request such as hello 1 is expected")
        clock = self.unit.clock
        clock.catch_up()
        rest = self.carry_out(words[0], words[1:])
        return " ".join([line_text(clock.now)] + rest)

    def carry_out(self, name, words):
        """Executes a request. Returns the words of the reply after the time."""
        if name == "hello":
            return self.hello(words)
        if name == "send":
            return self.send(words)
        if name == "run":
            return self.run(words)
        if name == "line":
            return self.line(words)
        if name == "power":
            return self.power(words)
        if name == "reset":
            return self.reset(words)
        if name in ("echo", "findings"):
            raise LineError("%s needs the ability %s, which Renode does not have" % (name, LINE_MISSING[name]))
        raise LineError("%s is not a request: use hello, send, run, line, power or reset" % line_shown(name))

    def hello(self, words):
        if len(words) != 1:
            raise LineError("hello takes the newest version that the client knows")
        if not line_number(words[0], 999999999999):
            raise LineError("%s is not a version of the protocol, such as 1" % line_shown(words[0]))
        settings = "line=%d,%s" % (self.unit.rate, self.unit.format)
        return ["version=1", settings, "abilities=line,power,reset", "name=modio in Renode"]

    def send(self, words):
        if not words:
            raise LineError("send takes at least one piece")
        pieces = [line_piece(word) for word in words]
        if self.unit.duration(pieces) > LINE_MOST_NS:
            raise LineError("the pieces take more than %d us" % (LINE_MOST_NS // 1000))
        self.unit.send(pieces)
        return self.unit.take_events()

    def run(self, words):
        if len(words) != 1:
            raise LineError("run takes a time in microseconds")
        clock = self.unit.clock
        clock.run_until(clock.now + line_time(words[0]))
        return self.unit.take_events()

    def line(self, words):
        if len(words) != 2:
            raise LineError("line takes a rate and a format, such as 9600 8N2")
        rate = line_number(words[0], 4000000)
        if rate is None or rate < 300:
            raise LineError("%s is not a rate from 300 to 4000000 bit/s" % line_shown(words[0]))
        if words[1] not in LINE_FORMATS:
            raise LineError("format %s is not supported: Renode's UART has no parity; use 8N1 or 8N2"
                            % line_shown(words[1]))
        self.unit.rate = rate
        self.unit.format = words[1]
        return []

    def power(self, words):
        if words == ["on"]:
            self.unit.power_on()
        elif words == ["off"]:
            self.unit.power_off()
        else:
            raise LineError("power takes on or off")
        return []

    def reset(self, words):
        if words:
            raise LineError("reset takes no arguments")
        self.unit.reset()
        return []


def line_thread(work):
    """Starts a thread that does not prevent Renode from ending. `work` must not raise an exception, because
    that would end Renode's process."""
    thread = Thread(ThreadStart(work))
    thread.IsBackground = True
    thread.Start()


class LineServer(object):
    """Serves one TCP client at a time."""

    # The machine that is served.
    machine = None

    def __init__(self, listener, unit):
        self.listener = listener
        self.unit = unit
        self.requests = LineRequests(unit)
        self.busy = False

    def serve(self):
        """Lets the unit start, then accepts clients. Ends after ten failures to accept in a row."""
        try:
            clock = self.unit.clock
            clock.run_until(clock.now + LINE_FIRST_START_NS)
            # A client meets a unit that has been switched on, not one that has reset itself.
            self.unit.power_off()
            self.unit.power_on()
            clock.run_until(clock.now + LINE_START_NS)
        except:
            # Every request that lets time pass fails for the same reason and reports it.
            pass
        failures = 0
        while failures < 10:
            try:
                client = self.listener.AcceptTcpClient()
                failures = 0
                self.greet(client)
            except:
                failures += 1

    def greet(self, client):
        if self.busy:
            writer = StreamWriter(client.GetStream())
            writer.AutoFlush = True
            writer.WriteLine("error the line is in use by another client")
            client.Close()
        else:
            self.busy = True
            line_thread(lambda: self.handle(client))

    def handle(self, client):
        """Serves a client until it disconnects."""
        try:
            self.answer_lines(client.GetStream())
        except:
            # The connection is lost. The board keeps its state, and the next client is served.
            pass
        self.busy = False
        try:
            client.Close()
        except:
            pass

    def answer_lines(self, stream):
        reader, writer = StreamReader(stream), StreamWriter(stream)
        writer.AutoFlush = True
        while True:
            text = reader.ReadLine()
            if text is None:
                return
            writer.WriteLine(self.requests.answer(text))
            if len(text) > LINE_LONGEST:
                return


def mc_exact_line(port):
    number = int(port)
    if not 1 <= number <= 65535:
        raise ValueError("%d is not a TCP port from 1 to 65535" % number)
    machine = monitor.Machine
    if machine is None:
        raise ValueError("there is no machine: include board.resc first")
    if machine is LineServer.machine:
        raise ValueError("exact_line serves this machine already")
    unit = LineUnit(machine)
    listener = TcpListener(IPAddress.Loopback, number)
    try:
        listener.Start()
    except Exception as error:
        raise ValueError("cannot listen on 127.0.0.1:%d: %s" % (number, line_reason(error)))
    LineServer.machine = machine
    unit.listen()
    server = LineServer(listener, unit)
    line_thread(lambda: server.serve())
    print("exact-line: 127.0.0.1:%d" % number)
