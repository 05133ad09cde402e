"""Checks that the scripts for Renode use only what Python 2.7 and Python 3 share: Renode runs them in
IronPython 2, and these tests parse them in Python 3."""

import ast
import unittest
from pathlib import Path

RENODE = Path(__file__).resolve().parent.parent

# Syntax that Python 2.7 does not have, or interprets differently.
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

# Methods of texts, bytes and numbers that Python 2.7 does not have.
NEWER_METHODS = {
    "casefold", "fromhex", "from_bytes", "isascii", "isdecimal", "isidentifier", "isnumeric", "removeprefix",
    "removesuffix", "to_bytes", "with_traceback",
}

# Names of .NET and Renode that exact-line.py may import: these were tested there.
IMPORTS = {
    "clr", "System.Byte", "System.IO.StreamReader", "System.IO.StreamWriter", "System.Net.IPAddress",
    "System.Net.Sockets.TcpListener", "System.Threading.Thread", "System.Threading.ThreadStart",
    "Antmicro.Renode.Core.EmulationManager", "Antmicro.Renode.Time.TimeInterval",
}


def files():
    return [*sorted(RENODE.glob("peripherals/*.py")), RENODE / "commands.py", RENODE / "exact-line.py"]


def tree_of(file):
    return ast.parse(file.read_text(encoding="utf-8"))


def problems(tree):
    """Yields what IronPython 2 cannot run, or runs differently."""
    for node in ast.walk(tree):
        name = type(node).__name__
        if name in REFUSED:
            yield f"line {node.lineno}: {REFUSED[name]}"
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "print" and len(node.args) != 1:
            yield f"line {node.lineno}: print shows a tuple"
        if isinstance(node, ast.arguments) and node.kwonlyargs:
            yield "keyword-only arguments"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            yield f"line {node.lineno}: / drops the fraction in Python 2"
        if isinstance(node, ast.Raise) and node.cause:
            yield f"line {node.lineno}: raise from"
        if isinstance(node, ast.Attribute) and node.attr in NEWER_METHODS:
            yield f"line {node.lineno}: {node.attr}"
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "super" and not node.args:
            yield f"line {node.lineno}: super() without arguments"
        if isinstance(node, ast.ClassDef) and not node.bases:
            yield f"line {node.lineno}: a class without a base is an old-style class"


class Syntax(unittest.TestCase):
    def test_the_files_use_only_what_python_2_has(self):
        self.assertGreater(len(files()), 5)
        for file in files():
            text = file.read_text(encoding="utf-8")
            self.assertTrue(text.isascii(), f"{file}: a declaration of the encoding would be needed")
            self.assertNotIn("\t", text, file)
            self.assertEqual(list(problems(ast.parse(text))), [], file)

    def test_models_have_no_functions_and_no_imports(self):
        for file in RENODE.glob("peripherals/*.py"):
            for node in ast.walk(tree_of(file)):
                kinds = (ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom, ast.Lambda)
                self.assertNotIsInstance(node, kinds, file)

    def test_commands_import_nothing(self):
        for node in ast.walk(tree_of(RENODE / "commands.py")):
            self.assertNotIsInstance(node, (ast.Import, ast.ImportFrom))

    def test_exact_line_imports_only_tested_names(self):
        imported = set()
        for node in ast.walk(tree_of(RENODE / "exact-line.py")):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported |= {f"{node.module}.{alias.name}" for alias in node.names}
        self.assertEqual(imported, IMPORTS)

    def test_exact_line_defines_only_names_that_begin_with_line(self):
        defined = set()
        for node in tree_of(RENODE / "exact-line.py").body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                defined.add(node.name)
            elif isinstance(node, ast.Assign):
                defined |= {target.id for target in node.targets}
        self.assertIn("mc_exact_line", defined)
        for name in defined - {"mc_exact_line"}:
            self.assertTrue(name.lower().startswith("line"), name)

    def test_every_kind_of_problem_is_found(self):
        for text in (
            "f'{x}'", "x: int = 1", "print('a', 'b')", "a / b", "def f(*, a): pass", "(x := 1)", "class A: pass",
            "bytes.fromhex(x)", "super().f()", "raise A() from b",
        ):
            self.assertTrue(list(problems(ast.parse(text))), text)


if __name__ == "__main__":
    unittest.main()
