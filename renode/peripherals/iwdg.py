# The watchdog's registers as the firmware writes them, by half-words (RM0008 19.4): hands them on to
# Renode's model, iwdgCounter, which takes words only.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the
# emulation, and can save numbers and dictionaries only.

if request.IsRead or request.IsWrite:
    try:
        counter = self.GetMachine()["sysbus.iwdgCounter"]
    except AttributeError:
        # Not every version gives a model this way to the machine; all give the monitor's.
        counter = monitor.Machine["sysbus.iwdgCounter"]
    if request.IsRead:
        request.Value = counter.ReadDoubleWord(int(request.Offset))
    else:
        counter.WriteDoubleWord(int(request.Offset), int(request.Value) & 0xFFFF)
    # An object that cannot be saved.
    del counter
