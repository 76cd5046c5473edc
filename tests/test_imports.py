"""Imports stand at the top of files; later only where the command line meets its verbs."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

HOME = Path(__file__).parents[1]
# `hamel --help` and a wrong option must not wait for CasADi, NumPy or rich
VERB_BOUNDARY = (
    "hamel/__main__.py",
    "hamel/api.py",
    "hamel/cli.py",
    "hamel/command.py",
    "hamel/engines.py",  # dask takes a second, and is not there for everybody
    "hamel/failures.py",
)


def late_imports(text: str) -> list[int]:
    """Lines of the imports inside functions."""
    return sorted({node.lineno for node in _inside_functions(ast.parse(text))})


def _inside_functions(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            for node in ast.walk(function):
                if isinstance(node, ast.Import | ast.ImportFrom):
                    yield node


@pytest.mark.parametrize("package", ["derive", "codegen", "hamel"])
def test_imports_stand_at_the_top(package: str) -> None:
    late = {
        str(path.relative_to(HOME)): lines
        for path in (HOME / package).rglob("*.py")
        if (lines := late_imports(path.read_text("utf-8")))
    }
    assert not late.keys() - set(VERB_BOUNDARY), late


def test_the_check_above_sees_an_import_in_a_function() -> None:
    assert late_imports("import os\n\ndef f():\n    from os import path\n    return path\n") == [4]
