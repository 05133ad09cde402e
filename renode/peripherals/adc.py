# ADC1 (RM0008 11.12): one conversion at a time, started by software, that is over at once.
#
# Beside the part's registers, for scripts and tests:
#   0x100 + 4 n  the code that channel n converts to, 0-4095; it stays across resets
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the
# emulation, and can save numbers and dictionaries only.

if request.IsInit:
    try:
        codes = codes
    except NameError:
        codes = {}
    registers = {}
    cr2 = 0
    sr = 0
    data = 0
elif request.IsRead:
    offset = int(request.Offset)
    if offset == 0x00:
        request.Value = sr
    elif offset == 0x08:
        # RSTCAL, CAL, SWSTART and JSWSTART are over when anybody looks.
        request.Value = cr2
    elif offset == 0x4C:
        request.Value = data
        # EOC goes with the result.
        sr &= ~0x02
    elif 0x100 <= offset < 0x148:
        request.Value = codes.get(offset, 0)
    else:
        request.Value = registers.get(offset, 0)
elif request.IsWrite:
    offset = int(request.Offset)
    value = int(request.Value) & 0xFFFFFFFF
    if offset == 0x00:
        # rc_w0: a 0 takes a flag back.
        sr &= value
    elif offset == 0x08:
        powered = cr2 & 0x01
        cr2 = value & 0x009EF903
        # SWSTART counts when it is what EXTSEL and EXTTRIG ask for, and ADON was set before.
        if value & 0x00400000 and value & 0x001E0000 == 0x001E0000 and powered and value & 0x01:
            data = codes.get(0x100 + 4 * (registers.get(0x34, 0) & 0x1F), 0) & 0xFFF
            # EOC and STRT.
            sr |= 0x12
    elif 0x100 <= offset < 0x148:
        codes[offset] = value & 0xFFF
    else:
        registers[offset] = value
