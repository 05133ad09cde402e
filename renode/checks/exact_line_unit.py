"""A small Modbus-RTU unit on Renode's UART, and its virtual time. Both are as simple as
the tests of exact-line.py allow: the firmware's own behaviour is tested elsewhere."""

import heapq
import sys

from renode_fake import RENODE

sys.path.append(str(RENODE / "tests"))
from ModbusRtu import frame  # noqa: E402

# Virtual time is counted in steps of 1/8 us, as Renode reports it.
STEPS = 8

# The unit receives this long after a start.
START_US = 120_000
# End of a frame, 3.5 characters of 9600 8N2, and the unit's own time after it.
SILENCE_US, THINKING_US = 4010.5, 108.625
# Time from the delivery of the request's last byte to a reply's first byte.
REPLY_US = SILENCE_US + THINKING_US
# Renode's UART sends all bytes of a reply within microseconds.
BETWEEN_BYTES_US = 3.25
# Time from the delivery of a byte until the firmware reads it.
READING_US = 2

POWER_ON_FLAGS, PIN_FLAG, SOFTWARE_FLAGS = 0x0C000000, 0x04000000, 0x14000000
# Registers: every reset clears CLEARED, IN_RAM is part of the RAM, and FLAGS holds the last reset's flags.
CLEARED, IN_RAM, FLAGS = 0, 1, 2


class VirtualTime:
    """Virtual time in steps, with scheduled actions."""

    def __init__(self):
        self.now = 0
        self._actions = []
        self._count = 0

    def after(self, us, action):
        """Runs an action later, unless the machine is reset before."""
        self._count += 1
        heapq.heappush(self._actions, (self.now + round(us * STEPS), self._count, action))

    def clear(self):
        self._actions = []

    def run_for(self, us):
        end = self.now + round(us * STEPS)
        while self._actions and self._actions[0][0] <= end:
            self.now, _, action = heapq.heappop(self._actions)
            action()
        self.now = end


class Unit:
    """Unit 1: reads a register with function 03 and writes one with 06. It answers nothing else."""

    def __init__(self, time, send):
        self.time = time
        self.send = send
        self.next_flags = POWER_ON_FLAGS
        self.registers = {IN_RAM: 0}
        # The bytes that the unit received, with their times.
        self.delivered = []
        self.reset()

    def reset(self):
        """Starts the unit. Its RAM keeps its content."""
        self.time.clear()
        self.frame = bytearray()
        self.last_byte = 0
        self.receiving = self.unread = False
        self.registers[CLEARED] = 0
        self.registers[FLAGS] = self.next_flags >> 16
        self.next_flags = SOFTWARE_FLAGS
        self.time.after(START_US, self._listen)

    def zero_ram(self):
        self.registers[IN_RAM] = 0

    def deliver(self, byte):
        """Gives the UART a byte; the byte is lost while the receiver is off."""
        if not self.receiving:
            return
        self.delivered.append((self.time.now, byte))
        self.frame.append(byte)
        self.unread = True
        self.last_byte += 1
        this = self.last_byte
        self.time.after(READING_US, self._read)
        self.time.after(SILENCE_US, lambda: self._end_frame(this))

    def _listen(self):
        self.receiving = True

    def _read(self):
        self.unread = False

    def _end_frame(self, byte):
        if byte != self.last_byte:
            return
        request, self.frame = bytes(self.frame), bytearray()
        reply = self._reply(request)
        for at, value in enumerate(reply):
            self.time.after(THINKING_US + at * BETWEEN_BYTES_US, lambda value=value: self.send(value))

    def _reply(self, request):
        if len(request) != 8 or request != bytes.fromhex(frame(1, request[1:6].hex())):
            return b""
        function, address, value = request[1], int.from_bytes(request[2:4], "big"), request[4:6]
        if address not in self.registers:
            return b""
        if function == 3:
            pdu = b"\x03\x02" + self.registers[address].to_bytes(2, "big")
            return bytes.fromhex(frame(1, pdu.hex()))
        if function == 6:
            self.registers[address] = int.from_bytes(value, "big")
            return request
        return b""
