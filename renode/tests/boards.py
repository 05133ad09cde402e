"""Differences between the boards for the suites, as Robot Framework's variables. Addresses and values have four
hexadecimal digits, as in a request. P has the first three digits of the addresses of the first slot's points, so
that ${P}2 is its third point."""

# Register BOARD, first port with a slot, and saves that write through both pages of the store.
BOARDS = {
    "modio-02": (1, 5, 10),
    "modio-08": (2, 1, 18),
}


def get_variables(board):
    code, port, saves = BOARDS[board]
    point = (port - 1) * 4

    def word(value):
        return f"{value:04X}"

    return {
        "BOARD_CODE": word(code),
        "PORT": port,
        "P": word(point)[:3],
        # Registers of the first slot: its module as set and in force, and the module's state.
        "MODULE": word(0x0110 + port - 1),
        "IN_FORCE": word(0x0210 + port - 1),
        "MODULE_STATE": word(0x0218 + port - 1),
        # The pulses of its second point.
        "PULSES_2": word(0x0300 + 2 * (point + 1)),
        "SAVES": saves,
        "SAVES_WORD": word(saves),
    }
