# Commands for Renode's monitor, in IronPython 2; board.resc includes this file.
#
#   modio_inputs DIP     drives every input pin until the next reset: SW01 to DIP, a number from 0 to 255,
#                        and the other inputs as with nothing connected. Every reset drives $dip again, so
#                        set $dip to move the switch.
#   modio_board NAME     selects the board: modio-02 or modio-08
#   modio_load PLAIN     loads $image into slot A; with true nothing, because $elf runs without a loader. Settings
#                        are stored where that image has them
#   modio_input PORT CHANNEL LEVEL
#                        drives a line of a slot: false energises an input of a 4DI
#   modio_preset MODULE  stores MODULE for the first slot, if nothing is stored yet; several slots as
#                        "1=4di,3=4ao"
#   modio_log            prints the part of the firmware's log that is in its buffer
#   modio_quiet          disables meaningless warnings in Renode's log

# Differences between the boards. sw01: port and pin, position 1 first. lines: those of the slots, by port. ram: its
# bytes. store: address of the configuration's first page behind a loader and without one, and bytes of both pages.
MODIO_BOARDS = {
    "modio-02": {
        "sw01": [("A", 4), ("A", 5), ("A", 6), ("A", 7), ("B", 12), ("B", 13), ("B", 14), ("B", 15)],
        "lines": {5: [("A", 0), ("A", 1), ("A", 2), ("A", 3)]},
        "aux": ("B", 5),
        "ram": 0x5000,
        "store": (0x0801F800, 0x0800F800, 2048),
    },
    "modio-08": {
        "sw01": [("C", 6), ("C", 7), ("C", 8), ("C", 9), ("B", 12), ("B", 13), ("B", 14), ("B", 15)],
        "lines": {
            1: [("A", 0), ("A", 1), ("A", 2), ("A", 3)],
            2: [("A", 4), ("A", 5), ("A", 6), ("A", 7)],
            3: [("C", 0), ("C", 1), ("C", 2), ("C", 3)],
            4: [("B", 0), ("B", 1), ("C", 4), ("C", 5)],
        },
        "aux": ("C", 12),
        "ram": 0xC000,
        "store": (0x0803F000, 0x0803F000, 4096),
    },
}

# The modules in the order of their codes. `cargo xtask docs` writes the list.
MODIO_MODULES = ["none", "4di", "4do", "2relay", "4ai", "4ao", "2ai2ao"]

# The board of the machine, and whether its image runs without a loader.
MODIO_MACHINE = {"board": "modio-02", "plain": False}


def modio_board():
    return MODIO_BOARDS[MODIO_MACHINE["board"]]


def mc_modio_board(board):
    if str(board) not in MODIO_BOARDS:
        raise ValueError("there is no board %s; use %s" % (board, ", ".join(sorted(MODIO_BOARDS))))
    MODIO_MACHINE["board"] = str(board)


def modio_is_true(value):
    # The monitor has its own truth values.
    return str(value).lower() == "true"


def mc_modio_load(plain):
    MODIO_MACHINE["plain"] = modio_is_true(plain)
    if not MODIO_MACHINE["plain"] and not monitor.Parse("sysbus LoadBinary $image 0x08004000"):
        raise ValueError("the image of slot A cannot be loaded")


def modio_drive(place, high):
    monitor.Machine["sysbus.gpioPort" + place[0]].OnGPIO(place[1], high)


def mc_modio_inputs(dip):
    board = modio_board()
    for bit, place in enumerate(board["sw01"]):
        # ON pulls the pin low.
        modio_drive(place, int(dip) >> bit & 1 == 0)
    # These pins are high with nothing connected: RX, the radio's AUX, the lines of the slots.
    modio_drive(("A", 10), True)
    modio_drive(board["aux"], True)
    for lines in board["lines"].values():
        for place in lines:
            modio_drive(place, True)


def mc_modio_input(port, channel, high):
    lines = modio_board()["lines"]
    if int(port) not in lines or not 1 <= int(channel) <= 4:
        raise ValueError("there is no channel %s of port %s" % (channel, port))
    modio_drive(lines[int(port)][int(channel) - 1], modio_is_true(high))


def modio_slots(modules):
    # Modules by port: a single module for the first slot, or each as PORT=MODULE.
    ports = sorted(modio_board()["lines"])
    slots = {}
    for part in str(modules).split(","):
        port, module = (part.split("=") if "=" in part else (ports[0], part))
        if module not in MODIO_MODULES:
            raise ValueError("there is no module %s; use %s" % (module, ", ".join(MODIO_MODULES)))
        if int(port) not in ports:
            raise ValueError("there is no slot at port %s" % port)
        slots[int(port)] = MODIO_MODULES.index(module)
    return slots


def modio_crc32(values):
    crc = 0xFFFFFFFF
    for value in values:
        crc ^= value
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def modio_halves(values):
    # Bytes of half-words, low byte first.
    return [value >> shift & 0xFF for value in values for shift in (0, 8)]


def mc_modio_preset(modules):
    # A sealed record of the settings MODULE (register-map/src/record). An empty slot is the default.
    slots = modio_slots(modules)
    pairs = [(0x010F + port, slots[port]) for port in sorted(slots) if slots[port]]
    record = modio_halves([0x6F6D, 0x0101, 0, 0, len(pairs)] + [half for pair in pairs for half in pair])
    crc = modio_crc32(record)
    page = modio_halves([0x6B6F]) + record + modio_halves([crc & 0xFFFF, crc >> 16, 0, 0])
    sysbus = monitor.Machine["sysbus"]
    slots_store, plain_store, size = modio_board()["store"]
    store = plain_store if MODIO_MACHINE["plain"] else slots_store
    if any(sysbus.ReadDoubleWord(store + at) != 0xFFFFFFFF for at in range(0, size, 4)):
        return
    for at in range(len(page)):
        sysbus.WriteByte(store + at, int(page[at]))


def mc_modio_quiet():
    # Renode versions after 1.16.1 have dma1 and connect the timers' updates to it. The firmware does not use dma1,
    # which then logs 500 warnings per second. A failure here must not stop board.resc.
    try:
        monitor.Machine["sysbus.dma1"]
        monitor.Parse("logLevel 3 sysbus.dma1")
    except Exception:
        pass


def mc_modio_log():
    sysbus = monitor.Machine["sysbus"]
    # RTT's control block, found by its mark "SEGGER RTT" as other viewers do: no symbols of the image in a slot are
    # loaded. After 24 bytes follows channel 0: name, buffer, size, written, read, flags.
    for block in range(0x20000000, 0x20000000 + modio_board()["ram"] - 40, 4):
        if [sysbus.ReadDoubleWord(block + at) for at in (0, 4, 8)] == [0x47474553, 0x52205245, 0x00005454]:
            start, length, written = [sysbus.ReadDoubleWord(block + at) for at in (28, 32, 36)]
            print("".join(chr(sysbus.ReadByte(start + at)) for at in range(written)))
            return
    print("the firmware has not opened its log")
