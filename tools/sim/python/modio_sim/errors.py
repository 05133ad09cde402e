"""What can go wrong."""


class SimulatorError(Exception):
    """Anything that goes wrong with the simulator."""


class StartError(SimulatorError):
    """The simulator does not start; the message is what it says itself."""


class UnreachableError(SimulatorError):
    """Nothing answers at the simulator's address, or not in time."""


class RefusedError(SimulatorError):
    """The simulator refuses a request; the message is its own."""

    def __init__(self, status: int, message: str):
        super().__init__(message)
        self.status = status
        """The HTTP status, such as 409 when a module is changed while the power is on."""
