"""Does to a suite what renode-test does before it runs it: Renode's keywords are there, and the fixtures
that a suite does not name are Renode's (robot_tests_provider.py). To be given to robot as
`--prerunmodifier`, with the library of the keywords in place of Renode's server."""

from pathlib import Path

from robot.api import SuiteVisitor

KEYWORDS = Path(__file__).with_name("RenodeOnSimulator.py")


class AsRenodeTest(SuiteVisitor):
    """The modifier."""

    def start_suite(self, suite):
        # Directories have no tests of their own, and no fixtures.
        if not suite.tests:
            return
        suite.resource.imports.library(KEYWORDS.as_posix())
        if not suite.setup:
            suite.setup.config(name="Setup")
        if not suite.teardown:
            suite.teardown.config(name="Teardown")
        for test in suite.tests:
            if not test.setup:
                test.setup.config(name="Reset Emulation")
            if not test.teardown:
                test.teardown.config(name="Test Teardown")
