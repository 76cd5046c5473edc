"""The walls of the house: who may import whom, and what a mere `--help` may cost."""

import subprocess
import sys

import pytest

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
