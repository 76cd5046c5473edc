"""The walls of the house: who may import whom, and what a mere `--help` may cost."""

import subprocess
import sys
from pathlib import Path

import pytest

MODELS = Path(__file__).parent.parent / "models"
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


@pytest.mark.parametrize(
    "model", ["four_bar", "free_body", "spatial_four_bar", "snakeboard", "screw_press"]
)
def test_a_build_reads_its_model_without_what_derives(model):
    """So that one process can read while the other imports CasADi."""
    found = modules_after(
        f"import hamel.making; from derive.robots import load; load('{MODELS}/{model}.yaml')"
    )
    assert "pydantic" in found and not found & {"casadi", "sympy", "jinja2"}


def test_the_check_above_sees_a_heavy_import():
    assert "numpy" in modules_after("import numpy")


def test_layers_hold():
    from importlinter.cli import lint_imports

    assert lint_imports(no_cache=True) == 0
