"""Prepares a suite as renode-test does before it runs the suite: adds Renode's keywords, and Renode's default
fixtures where the suite names none (robot_tests_provider.py). Pass this file to robot as `--prerunmodifier`.
The keywords come from a library that does nothing: for a dry run."""

from pathlib import Path

from robot.api import SuiteVisitor

KEYWORDS = Path(__file__).with_name("RenodeKeywords.py")


class AsRenodeTest(SuiteVisitor):
    """The modifier."""

    def start_suite(self, suite):
        # Directories have no tests and no fixtures.
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
