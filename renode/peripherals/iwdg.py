# The watchdog's registers, which the firmware writes by half-words (RM0008 19.4). Passes the values on to Renode's
# model, iwdgCounter, which accepts only words.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the emulation, and
# can only save numbers and dictionaries.

if request.IsRead or request.IsWrite:
    try:
        counter = self.GetMachine()["sysbus.iwdgCounter"]
    except AttributeError:
        # Only some versions provide the machine to a model in this way; all provide the monitor's.
        counter = monitor.Machine["sysbus.iwdgCounter"]
    if request.IsRead:
        request.Value = counter.ReadDoubleWord(int(request.Offset))
    else:
        counter.WriteDoubleWord(int(request.Offset), int(request.Value) & 0xFFFF)
    # An object that cannot be saved.
    del counter
