"""Errors of this package."""


class SimulatorError(Exception):
    """Base class of all errors of the simulator."""


class StartError(SimulatorError):
    """Error when the simulator does not start. The message is the simulator's."""


class UnreachableError(SimulatorError):
    """Error when there is no answer at the simulator's address, or not in time."""


class RefusedError(SimulatorError):
    """Error when the simulator refuses a request. The message is the simulator's."""

    def __init__(self, status: int, message: str):
        super().__init__(message)
        self.status = status
        """HTTP status, such as 409 when a module is changed while the power is on."""
