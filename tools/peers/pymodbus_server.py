"""The serial server of pymodbus, as in its documentation. The only argument is the serial port.

Prints "ready" when it serves.
"""

import sys

from pymodbus import FramerType, ModbusDeviceIdentification
from pymodbus.server import StartSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

UNIT = 1
BITS = 2096
WORDS = 200


def main(port):
    def bits():
        return [SimData(0, count=BITS, values=False, datatype=DataType.BITS)]

    def words():
        return [SimData(0, count=WORDS, values=0, datatype=DataType.REGISTERS)]

    StartSerialServer(
        SimDevice(UNIT, simdata=(bits(), bits(), words(), words())),
        framer=FramerType.RTU,
        identity=ModbusDeviceIdentification(info_name={
            "VendorName": "Pymodbus",
            "ProductCode": "PM",
            "MajorMinorRevision": "1",
        }),
        port=port,
        baudrate=19200,
        bytesize=8,
        parity="N",
        stopbits=2,
        # A unit on a line does not answer requests for others, and executes broadcasts.
        ignore_missing_devices=True,
        broadcast_enable=True,
        trace_connect=lambda connected: connected and print("ready", flush=True),
    )


main(sys.argv[1])
