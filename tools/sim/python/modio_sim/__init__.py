"""Starts and operates virtual modio boards.

The program `modio-sim` runs the firmware of a modio board on an emulated microcontroller. This package starts it, or
attaches to a running one, and operates and observes the board through its HTTP interface:

    import modio_sim

    with modio_sim.Simulator.start(module="4di") as sim:
        sim.set_channel(1, energised=True)
        print(sim.pty)  # the serial port for a Modbus master
        for frame in sim.frames():
            print(frame.summary)

The package only needs Python's standard library. All errors are of the class `SimulatorError`.
"""

from .board import Board
from .errors import RefusedError, SimulatorError, StartError, UnreachableError
from .events import Events
from .simulator import Simulator
from .model import BoardInfo, Channel, Faults, Finding, Frame, Leds, Line, Lost, Radio, Slot, State, Terminal

__all__ = [
    "Board", "BoardInfo", "Channel", "Events", "Faults", "Finding", "Frame", "Leds", "Line", "Lost", "Radio",
    "RefusedError", "Simulator", "SimulatorError", "Slot", "StartError", "State", "Terminal", "UnreachableError",
]
