"""The pictures of the page for the documentation."""

import pathlib
import tempfile
import unittest

from PIL import Image
from screenshots import take_all

IN_DOCS = pathlib.Path(__file__).resolve().parents[4] / "docs" / "images"


class Screenshots(unittest.TestCase):
    def test_every_dark_picture_of_the_page_in_docs_is_taken_and_has_its_width(self):
        # The height depends on the fonts of the machine.
        widths = lambda directory: {file.name: Image.open(file).width for file in directory.glob("panel-*-dark.png")}
        with tempfile.TemporaryDirectory() as directory:
            taken = pathlib.Path(directory)
            take_all(taken, ["dark"])
            self.assertEqual(widths(taken), widths(IN_DOCS))
