# The flash controller (PM0075): keys, lock, and erase of a page. The memory itself is Renode's, which accepts a
# write with any value of PG: writes over programmed cells are not rejected, and no operation takes time.
#
# Additional registers for scripts and tests:
#   0x3F0  pages erased since power-on, including mass erases
#   0x3F4  KiB of flash, initially 128; with more, a page has 2 KiB instead of 1 (PM0075 2.1)
# Both are kept across resets.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the emulation, and
# can only save numbers and dictionaries.

if request.IsInit:
    try:
        erased = erased
    except NameError:
        erased = 0
        kib = 128
    acr = 0x30
    cr = 0x80
    sr = 0
    address = 0
    # Number of keys written; -1 after a wrong one, until the next reset.
    keys = 0
elif request.IsRead:
    offset = int(request.Offset)
    if offset == 0x00:
        request.Value = acr
    elif offset == 0x0C:
        # The write of a half-word does not pass through here. While PG is set, one was made and has ended before
        # the status is read.
        if cr & 0x01:
            sr |= 0x20
        request.Value = sr
    elif offset == 0x10:
        request.Value = cr
    elif offset == 0x1C:
        # No read protection; the option bytes as delivered.
        request.Value = 0x03FFFFFC
    elif offset == 0x20:
        # No page is write-protected.
        request.Value = 0xFFFFFFFF
    elif offset == 0x3F0:
        request.Value = erased
    elif offset == 0x3F4:
        request.Value = kib
    else:
        request.Value = 0
elif request.IsWrite:
    offset = int(request.Offset)
    value = int(request.Value) & 0xFFFFFFFF
    if offset == 0x00:
        # The prefetch buffer's status follows its enable.
        acr = value & 0x1F | (value & 0x10) << 1
    elif offset == 0x04:
        if keys == 0 and value == 0x45670123:
            keys = 1
        elif keys == 1 and value == 0xCDEF89AB:
            keys = 2
            cr &= ~0x80
        else:
            keys = -1
            cr |= 0x80
    elif offset == 0x0C:
        # Writing 1 clears EOP, WRPRTERR and PGERR.
        sr &= ~(value & 0x34)
    elif offset == 0x14:
        address = value
    elif offset == 0x3F4:
        kib = value
    elif offset == 0x10 and cr & 0x80:
        self.WarningLog("FLASH_CR is locked: 0x%X is ignored" % value)
    elif offset == 0x10:
        # PG, PER, MER, OPTPG, OPTER, OPTWRE and the interrupt enables are kept.
        cr = value & 0x1637
        if value & 0x40 and value & 0x06:
            count = 0x400
            if kib > 128:
                count = 0x800
            page = (address - 0x08000000) & ~(count - 1)
            if value & 0x04:
                page = 0
                count = kib * 1024
            if 0 <= page < kib * 1024:
                try:
                    memory = self.GetMachine()["sysbus.flash"]
                except AttributeError:
                    # Only some versions provide the machine to a model in this way; all provide the monitor's.
                    memory = monitor.Machine["sysbus.flash"]
                memory.SetRange(page, count, 0xFF)
                # An object that cannot be saved.
                del memory
                erased += 1
                sr |= 0x20
            else:
                self.WarningLog("there is no page of flash at 0x%08X" % address)
        if value & 0x80:
            cr |= 0x80
            keys = 0
