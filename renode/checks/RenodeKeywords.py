"""The keywords of Renode that the suites use, with the names and arguments of Renode's sources. For a dry run: they do
nothing."""

ROBOT_LIBRARY_SCOPE = "GLOBAL"


def setup():
    """The suite's default setup."""


def teardown():
    """The suite's default teardown."""


def test_teardown():
    """The tests' default teardown."""


def reset_emulation():
    """The tests' default setup."""


def create_terminal_tester(uart, timeout: float = None, machine=None, endLineOption=None,
                           defaultPauseEmulation: bool = None, defaultWaitForEcho: bool = None,
                           defaultMatchNextLine: bool = None, binaryMode: bool = False):
    """Attaches a tester to a UART."""


def send_key_to_uart(c, testerId: int = None):
    """Sends a byte."""


def wait_for_bytes_on_uart(content, timeout: float = None, testerId: int = None, treatAsRegex: bool = False,
                           pauseEmulation: bool = None, matchStart: bool = False):
    """Waits for bytes."""


def execute_command(command, machine=None):
    """Runs a command of Renode's monitor."""
