# The watchdog's registers as the firmware writes them, by half-words (RM0008 19.4): hands them on to
# Renode's model, iwdgCounter, which takes words only.
#
# Runs in Renode's IronPython 2 at every access. No functions: Renode saves the variables with the
# emulation, and can save numbers and dictionaries only.

if request.IsRead:
    request.Value = self.GetMachine()["sysbus.iwdgCounter"].ReadDoubleWord(int(request.Offset))
elif request.IsWrite:
    self.GetMachine()["sysbus.iwdgCounter"].WriteDoubleWord(int(request.Offset), int(request.Value) & 0xFFFF)
