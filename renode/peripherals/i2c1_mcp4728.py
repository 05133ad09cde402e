# I2C1 as a master (RM0008 26.6), with the DACs of the analog-output modules: an MCP4728 (Microchip DS22187E) at
# each of the addresses 0x60 to 0x63. Bytes take no time. The outputs follow Multi-Write and Fast Write; writes to
# the EEPROM are not modelled, and a read is not acknowledged.
#
# Additional registers for scripts and tests, with d = 0 to 3 for the DAC at address 0x60 + d:
#   0x100 + 0x20 d + 4 n  the code at output n, 0 = A to 3 = D
#   0x110 + 0x20 d        whether that module is plugged in: with 0 the address is not acknowledged.
#                         Initially 1 for the first DAC and 0 for the others
#   0x114                 number of transfers to all DACs that ended with a stop or a repeated start
# All of them are kept across resets, like the state of the DACs.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the emulation, and
# can only save numbers and dictionaries.

if request.IsInit:
    try:
        outputs = outputs
    except NameError:
        # By the offset of the register.
        outputs = {}
        plugged = {0: 1}
        transfers = 0
    registers = {}
    cr1 = 0
    sr1 = 0
    sr2 = 0
    # 0 idle, 1 waiting for the address, 2 waiting for data for the DAC.
    state = 0
    # The current transfer: number of bytes, the command, and the first byte of a pair.
    count = 0
    command = 0
    first = 0
    # The addressed DAC.
    dac = 0
elif request.IsRead:
    offset = int(request.Offset)
    if offset == 0x00:
        request.Value = cr1
    elif offset == 0x10:
        request.Value = 0
    elif offset == 0x14:
        request.Value = sr1
    elif offset == 0x18:
        request.Value = sr2
        # Reading SR2 after SR1 clears ADDR.
        sr1 &= ~0x02
    elif offset == 0x114:
        request.Value = transfers
    elif 0x100 <= offset < 0x180 and offset & 0x10:
        request.Value = plugged.get((offset - 0x100) // 0x20, 0)
    elif 0x100 <= offset < 0x180:
        request.Value = outputs.get(offset, 0)
    else:
        request.Value = registers.get(offset, 0)
elif request.IsWrite:
    offset = int(request.Offset)
    value = int(request.Value) & 0xFFFF
    if offset == 0x00:
        # STOP and START end immediately; SWRST and PE = 0 take the peripheral off the bus.
        cr1 = value & ~0x0300
        if value & 0x8000 or not value & 0x0001:
            sr1 = 0
            sr2 = 0
            state = 0
            if value & 0x8000:
                registers = {}
        elif value & 0x0300:
            if state == 2:
                transfers += 1
            sr1 &= ~0x87
            sr2 = 0
            state = 0
            if value & 0x0100:
                # SB; MSL and BUSY.
                sr1 |= 0x01
                sr2 = 0x03
                state = 1
    elif offset == 0x10 and state == 1:
        sr1 &= ~0x01
        dac = value >> 1 & 3
        if value & 0xF9 == 0xC0 and plugged.get(dac, 0):
            # ADDR and TXE; TRA.
            sr1 |= 0x82
            sr2 |= 0x04
            state = 2
            count = 0
            command = 0
        else:
            # AF. The master keeps the bus until its stop condition.
            sr1 |= 0x0400
            state = 0
    elif offset == 0x10 and state == 2:
        value &= 0xFF
        # TXE and BTF: the byte was already sent.
        sr1 |= 0x84
        if command & 0xC0 == 0x00 and count:
            # Fast Write: two bytes per channel, starting with A.
            if count & 1:
                outputs[0x100 + 0x20 * dac + 4 * (count // 2 & 3)] = (first & 0x0F) << 8 | value
            first = value
        elif count % 3 == 0:
            # The command byte of Multi-Write, which precedes every channel, or the only one of other commands.
            if not count or command & 0xF8 == 0x40:
                command = value
            first = value
        elif command & 0xF8 == 0x40:
            # UDAC = 0: the output changes at the last byte.
            if count % 3 == 2 and not command & 0x01:
                outputs[0x100 + 0x20 * dac + 4 * (command >> 1 & 3)] = (first & 0x0F) << 8 | value
            first = value
        count += 1
    elif offset == 0x14:
        # rc_w0: writing 0 clears an error.
        sr1 &= value | ~0xDF00
    elif 0x100 <= offset < 0x180 and offset & 0x10:
        plugged[(offset - 0x100) // 0x20] = value & 1
    elif 0x100 <= offset < 0x180:
        outputs[offset] = value & 0xFFF
    else:
        registers[offset] = value
