"""Every example.c compiles by the command in its first comment, without warnings, and prints what
the module computes at the model's initial state.

Of codegen.targets: example.
"""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import program
from codegen.program import Program
from derive.diagnostics import HamelError
from derive.formulations import equations
from derive.states.initial import initial_state
from tests.scenes import MODELS, ROOT, derived, mechanics
from tests.toy import toy

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
NAMES = sorted(path.stem for path in MODELS.glob("*.yaml"))


def printed(folder: Path, place: Path) -> str:
    """What example.c of the folder prints, compiled by the command that it names."""
    text = (folder / "example.c").read_text("utf-8")
    written = re.search(r"^ +cc (.*?) -o example", text, re.MULTILINE)
    assert written
    found = compiler.find_compiler()
    assert found
    command = [*found, *shlex.split(written[1]), *STRICT, "-o", str(place / "example")]
    subprocess.run(command, cwd=folder, check=True)
    run = subprocess.run([place / "example"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def emitted(made: Program, place: Path) -> Path:
    for name, content in emit(made).items():
        (place / name).write_text(content, encoding="utf-8")
    return place


def values(said: str) -> dict[str, float]:
    """By name, up to the first line that has none."""
    rows = (line.rsplit(" = ", 1) for line in said.split("\nin chart")[0].splitlines())
    return {name: float(value) for name, value in rows}


def test_without_an_initial_state_it_says_so(tmp_path: Path) -> None:
    folder = emitted(program(toy()), tmp_path)
    assert "at a state of arbitrary numbers" in (folder / "example.c").read_text("utf-8")
    assert set(values(printed(folder, tmp_path))) == {"q1", "q2", "der(q1)", "der(q2)"}


@pytest.mark.parametrize("name", ["four_bar", "snake3"])
def test_a_committed_module_runs_from_the_initial_state(name: str, tmp_path: Path) -> None:
    said = values(printed(ROOT / "generated" / name, tmp_path))
    text = (ROOT / "generated" / name / "example.c").read_text("utf-8")
    assert "at the model's initial state" in text
    system, start = mechanics(name), initial_state(mechanics(name))
    assert len(said) == len(derived(name).arguments[1].labels)
    given = re.findall(r"^ {8}(\S+?),? /\*", text, re.MULTILINE)
    q = np.array([float(value) for value in given[: system.q.numel()]])
    np.testing.assert_allclose(q, start.q, rtol=1e-11, atol=1e-13)


def test_charts_are_shown(tmp_path: Path) -> None:
    made = program(equations(mechanics("slider_crank"), "slider+crank", charts=True))
    assert "in chart " in printed(emitted(made, tmp_path), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_model_has_an_example_that_runs(name: str, tmp_path: Path) -> None:
    try:
        made = program(derived(name))
    except HamelError as error:
        pytest.skip(str(error))
    assert values(printed(emitted(made, tmp_path), tmp_path))
