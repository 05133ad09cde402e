# Reset and clock control (RM0008 7.3), as far as the firmware uses it: ready flags follow their ON bits, SWS
# follows SW, and CSR holds the reset flags. Clocks are not gated.
#
# Additional registers for scripts and tests:
#   0x3F0  reset flags of the next reset, in the format of CSR; a software reset when nothing is
#          written. The first start is a power-on.
#   0x3F4  0 removes the crystal: HSERDY stays 0 from then on. Kept across resets.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the emulation, and
# can only save numbers and dictionaries.

if request.IsInit:
    try:
        csr = next_csr
    except NameError:
        # Power-on, which also sets the pin's flag.
        csr = 0x0C000000
        crystal = 1
    # Software, and the pin's flag.
    next_csr = 0x14000000
    cr = 0x83
    cfgr = 0
    lsion = 0
    registers = {}
elif request.IsRead:
    offset = int(request.Offset)
    if offset == 0x00:
        # HSIRDY, HSERDY and PLLRDY, each next to its ON bit.
        hseon = (cr >> 16) & crystal
        pll_source = hseon if cfgr & 0x10000 else cr & 1
        ready = (cr & 1) << 1 | hseon << 17 | ((cr >> 24) & pll_source) << 25
        request.Value = cr & 0x010D00F9 | ready
    elif offset == 0x04:
        request.Value = cfgr & 0x07FFFFF3 | (cfgr & 3) << 2
    elif offset == 0x20:
        # LSE: ready when it is on.
        bdcr = registers.get(0x20, 0)
        request.Value = bdcr & 0x1FFFD | (bdcr & 1) << 1
    elif offset == 0x24:
        request.Value = csr | lsion | lsion << 1
    elif offset == 0x3F0:
        request.Value = next_csr
    elif offset == 0x3F4:
        request.Value = crystal
    else:
        request.Value = registers.get(offset, 0)
elif request.IsWrite:
    offset = int(request.Offset)
    value = int(request.Value) & 0xFFFFFFFF
    if offset == 0x00:
        # The internal oscillator cannot be stopped while the core runs on it.
        cr = value | 1 if cfgr & 3 == 0 else value
    elif offset == 0x04:
        cfgr = value
    elif offset == 0x24:
        lsion = value & 1
        # RMVF clears the flags.
        if value & 0x01000000:
            csr = 0
    elif offset == 0x3F0:
        next_csr = value & 0xFC000000
    elif offset == 0x3F4:
        crystal = value & 1
    else:
        registers[offset] = value
