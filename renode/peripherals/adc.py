# ADC1 (RM0008 11.12): one conversion at a time, started by software, which ends immediately.
#
# Additional registers for scripts and tests:
#   0x100 + 4 n  the code that channel n converts to, 0-4095; kept across resets
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the emulation, and
# can only save numbers and dictionaries.

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
        # RSTCAL, CAL, SWSTART and JSWSTART have always ended.
        request.Value = cr2
    elif offset == 0x4C:
        request.Value = data
        # Reading the result clears EOC.
        sr &= ~0x02
    elif 0x100 <= offset < 0x148:
        request.Value = codes.get(offset, 0)
    else:
        request.Value = registers.get(offset, 0)
elif request.IsWrite:
    offset = int(request.Offset)
    value = int(request.Value) & 0xFFFFFFFF
    if offset == 0x00:
        # rc_w0: writing 0 clears a flag.
        sr &= value
    elif offset == 0x08:
        powered = cr2 & 0x01
        cr2 = value & 0x009EF903
        # SWSTART has an effect when EXTSEL and EXTTRIG select it, and ADON was set before.
        if value & 0x00400000 and value & 0x001E0000 == 0x001E0000 and powered and value & 0x01:
            data = codes.get(0x100 + 4 * (registers.get(0x34, 0) & 0x1F), 0) & 0xFFF
            # EOC and STRT.
            sr |= 0x12
    elif 0x100 <= offset < 0x148:
        codes[offset] = value & 0xFFF
    else:
        registers[offset] = value
