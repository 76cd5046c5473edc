"""The walls of the house: who may import whom, what a mere `--help` may cost, and which test a
module has."""

import ast
import re
import subprocess
import sys

import pytest

from tests.conftest import LONG
from tests.scenes import ROOT

HEAVY = ("casadi", "sympy", "numpy", "pydantic", "jinja2", "yaml", "rich")


def modules_after(statement: str) -> set[str]:
    code = f"import sys\ntry:\n    {statement}\nexcept SystemExit:\n    pass\nprint('modules', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize(
    "statement",
    [
        "import hamel",
        "from hamel.cli import main; main(['--help'])",
        "from hamel.cli import main; main(['build', '--help'])",
        "from hamel.cli import main; main(['build', '--no-such-option'])",
    ],
)
def test_what_computes_nothing_imports_nothing_heavy(statement):
    assert not modules_after(statement) & set(HEAVY)


def test_the_check_above_sees_a_heavy_import():
    assert "numpy" in modules_after("import numpy")


def test_layers_hold():
    from importlinter.cli import lint_imports

    assert lint_imports(no_cache=True) == 0


def modules_named() -> set[str]:
    """What tests import, and what their heads list as `Of PACKAGE: a, b.`"""
    named: set[str] = set()
    for path in (ROOT / "tests").rglob("*.py"):
        text = path.read_text("utf-8")
        for package, imported in re.findall(r"from ([\w.]+) import (\([^)]*\)|.*)", text):
            named |= {package, *(f"{package}.{name}" for name in re.findall(r"\w+", imported))}
        for package, listed in re.findall(r"^Of ([\w.]+): ([^:]*?)\.$", text, re.MULTILINE):
            named |= {f"{package}.{name}" for name in re.findall(r"\w+", listed)}
        named |= set(re.findall(r"[a-z_]+(?:\.[a-z_0-9]+)+", text))
    return named


def test_each_module_has_a_test_that_names_it() -> None:
    named = modules_named()
    for package in ("derive", "codegen", "hamel"):
        for path in (ROOT / package).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            module = ".".join(parts).removesuffix(".__init__")
            if len(ast.parse(path.read_text("utf-8")).body) < 2:
                continue  # a docstring alone
            assert module in named, f"no test names {module}: list it in the head of its test"


def test_rooms_of_tests_are_rooms_of_the_packages() -> None:
    for package in ("derive", "codegen", "hamel"):
        for path in (ROOT / "tests" / package).rglob("test_*.py"):
            room = ROOT / path.relative_to(ROOT / "tests").parent
            assert room.is_dir(), f"{path.relative_to(ROOT)} tests no room"


def test_long_runs_are_those_of_tests() -> None:
    tests = "".join(path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    for name in LONG:
        assert not name or f"def {name}(" in tests, f"conftest.py: there is no {name}"
