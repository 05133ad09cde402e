"""Frames of Modbus-RTU and what else the suites work out. Python 3, the standard library alone."""

ROBOT_LIBRARY_SCOPE = "GLOBAL"


def _crc(data):
    """CRC-16 of the serial-line standard, V1.02 6.2.2: low byte first on the line."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def frame(unit, pdu):
    """The frame of a PDU given in hexadecimal, in hexadecimal as well: `01 03 02 00 0A 38 43`."""
    data = bytes([int(unit)]) + bytes.fromhex(pdu)
    return (data + _crc(data)).hex(" ").upper()


def damaged(frame_hex):
    """The same frame with one bit of its CRC turned."""
    data = bytearray.fromhex(frame_hex)
    data[-1] ^= 0x01
    return data.hex(" ").upper()


def keys(frame_hex):
    """A frame's bytes as `Send Key To Uart` takes them."""
    return [f"0x{byte:02X}" for byte in bytes.fromhex(frame_hex)]


def part(frame_hex, begin, end=None):
    """The bytes of a frame from one index to another, in hexadecimal."""
    data = bytes.fromhex(frame_hex)
    return data[int(begin) : None if end is None else int(end)].hex(" ").upper()


def seconds_for(frame_hex, rest="0.1"):
    """How long a frame of 9600 8N2 takes on the line, with a rest for the silence and the reply."""
    return f"{len(bytes.fromhex(frame_hex)) * 11 / 9600 + float(rest):.4f}"


def path_token(path):
    """A path as Renode's monitor takes it on every system: with @, slashes, and spaces escaped."""
    return "@" + path.replace("\\", "/").replace(" ", "\\ ")


def number(text):
    """What a command of the monitor has printed, as a number."""
    return int(text.strip(), 0)


def text_of(words, length):
    """The text in the first `length` bytes of words as the monitor has printed them."""
    data = b"".join(number(word).to_bytes(4, "little") for word in words)
    return data[: int(length)].decode("utf-8")
