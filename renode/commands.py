# Commands for Renode's monitor, in its IronPython 2; board.resc includes them.
#
#   modio_inputs DIP     drives every input pin until the next reset: SW01 to DIP, a number from 0 to 255,
#                        and the other inputs as with nothing connected. Every reset drives $dip again, so
#                        set $dip to move the switch.
#   modio_preset MODULE  stores that MODULE is in the slot, when nothing is stored yet
#   modio_log            shows the firmware's log, as much of it as its buffer holds
#   modio_quiet          keeps warnings that mean nothing out of Renode's log

# SW01, position 1 first: port and pin.
MODIO_SW01 = [
    ("A", 4), ("A", 5), ("A", 6), ("A", 7),
    ("B", 12), ("B", 13), ("B", 14), ("B", 15),
]

# Inputs that are high with nothing connected: the slot's lines, RX, and the radio's AUX.
MODIO_PULLED_UP = [("A", 0), ("A", 1), ("A", 2), ("A", 3), ("A", 10), ("B", 5)]

# The start of the store's first page, for each module: a sealed record of one setting, MODULE of port 5.
MODIO_PRESETS = {
    "none": "6f6b6d6f0101000000000000e9a2942e00000000",
    "4di": "6f6b6d6f0101000000000100140101006a52ca9500000000",
    "4do": "6f6b6d6f010100000000010014010200a901e7be00000000",
    "2relay": "6f6b6d6f010100000000010014010300e830fca700000000",
    "4ai": "6f6b6d6f0101000000000100140104002fa6bde800000000",
    "4ao": "6f6b6d6f0101000000000100140105006e97a6f100000000",
    "2ai2ao": "6f6b6d6f010100000000010014010600adc48bda00000000",
}

MODIO_STORE = 0x0800F800


def modio_drive(place, high):
    monitor.Machine["sysbus.gpioPort" + place[0]].OnGPIO(place[1], high)


def mc_modio_inputs(dip):
    for bit, place in enumerate(MODIO_SW01):
        # ON pulls the pin low.
        modio_drive(place, int(dip) >> bit & 1 == 0)
    for place in MODIO_PULLED_UP:
        modio_drive(place, True)


def mc_modio_preset(module):
    sysbus = monitor.Machine["sysbus"]
    record = MODIO_PRESETS.get(str(module))
    if record is None:
        raise ValueError("there is no module %s, but %s" % (module, ", ".join(sorted(MODIO_PRESETS))))
    if any(sysbus.ReadDoubleWord(MODIO_STORE + at) != 0xFFFFFFFF for at in range(0, 2048, 4)):
        return
    for at in range(len(record) // 2):
        sysbus.WriteByte(MODIO_STORE + at, int(record[2 * at:2 * at + 2], 16))


def mc_modio_quiet():
    # Versions of Renode after 1.16.1 have dma1 and wire the timers' updates to it. The firmware does not use
    # dma1, which then logs 500 warnings a second. No failure in here may stop board.resc.
    try:
        monitor.Machine["sysbus.dma1"]
        monitor.Parse("logLevel 3 sysbus.dma1")
    except Exception:
        pass


def mc_modio_log():
    sysbus = monitor.Machine["sysbus"]
    # RTT's control block: 24 bytes of header, then channel 0: name, buffer, size, written, read, flags.
    block = sysbus.GetSymbolAddress("_SEGGER_RTT")
    start, length, written = [sysbus.ReadDoubleWord(block + at) for at in (28, 32, 36)]
    if length > 4096 or written >= length:
        print("the firmware has not opened its log")
        return
    print("".join(chr(sysbus.ReadByte(start + at)) for at in range(written)))
