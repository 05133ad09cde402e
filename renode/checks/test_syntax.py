"""The models and commands are written in what Python 2.7 and Python 3 have in common: Renode runs them in
IronPython 2, and these tests in Python 3."""

import ast
import unittest

from renode_fake import RENODE

# What Python 2.7 does not have, or has otherwise.
REFUSED = {
    "JoinedStr": "f-strings",
    "NamedExpr": ":=",
    "AnnAssign": "annotations",
    "AsyncFunctionDef": "async",
    "Await": "await",
    "YieldFrom": "yield from",
    "Nonlocal": "nonlocal",
    "Starred": "* outside calls",
    "MatMult": "@",
    "Match": "match",
    "TryStar": "except*",
}


def files():
    return sorted(RENODE.glob("peripherals/*.py")) + [RENODE / "commands.py"]


def problems(tree):
    """What in a file would not do in IronPython 2, or at a peripheral's access."""
    for node in ast.walk(tree):
        name = type(node).__name__
        if name in REFUSED:
            yield f"line {node.lineno}: {REFUSED[name]}"
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "print" and len(node.args) != 1:
            yield f"line {node.lineno}: print shows a tuple"
        if isinstance(node, ast.arguments) and node.kwonlyargs:
            yield "keyword-only arguments"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            yield f"line {node.lineno}: / drops the fraction there"
        if isinstance(node, ast.Raise) and node.cause:
            yield f"line {node.lineno}: raise from"


class Syntax(unittest.TestCase):
    def test_the_files_have_nothing_that_python_2_lacks(self):
        self.assertGreater(len(files()), 5)
        for file in files():
            text = file.read_text(encoding="utf-8")
            self.assertTrue(text.isascii(), f"{file}: a declaration of the encoding would be needed")
            self.assertNotIn("\t", text, file)
            self.assertEqual(list(problems(ast.parse(text))), [], file)

    def test_models_have_no_functions_and_no_imports(self):
        for file in RENODE.glob("peripherals/*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                kinds = (ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom, ast.Lambda)
                self.assertNotIsInstance(node, kinds, file)

    def test_each_of_these_is_found(self):
        for text in ("f'{x}'", "x: int = 1", "print('a', 'b')", "a / b", "def f(*, a): pass", "(x := 1)"):
            self.assertTrue(list(problems(ast.parse(text))), text)


if __name__ == "__main__":
    unittest.main()
