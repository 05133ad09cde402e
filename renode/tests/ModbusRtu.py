"""Modbus-RTU frames and other computations for the suites. Python 3 with only the standard library."""

ROBOT_LIBRARY_SCOPE = "GLOBAL"


def _crc(data):
    """Returns the CRC-16 of the serial-line standard, V1.02 6.2.2, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def frame(unit, pdu):
    """Returns the frame of a PDU; both are in hexadecimal: `01 03 02 00 0A 38 43`."""
    data = bytes([int(unit)]) + bytes.fromhex(pdu)
    return (data + _crc(data)).hex(" ").upper()


def keys(frame_hex):
    """Returns a frame's bytes in the format of `Send Key To Uart`."""
    return [f"0x{byte:02X}" for byte in bytes.fromhex(frame_hex)]


def seconds_for(frame_hex, rest="0.1"):
    """Returns the duration of a frame at 9600 8N2, plus a rest for the silence and the reply."""
    return f"{len(bytes.fromhex(frame_hex)) * 11 / 9600 + float(rest):.4f}"


def path_token(path):
    """Returns a path in the format of Renode's monitor: with @, slashes, and escaped spaces."""
    return "@" + path.replace("\\", "/").replace(" ", "\\ ")


def number(text):
    """Returns the output of a monitor command as a number."""
    return int(text.strip(), 0)
