"""Generated C and its example have no warnings, of gcc nor of clang."""

from __future__ import annotations

import os
import shutil
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from codegen.emit import emit
from codegen.integrators import INTEGRATORS
from codegen.passes import program
from codegen.passes.folding.roll import ALWAYS, NEVER
from codegen.passes.precision import in_precision
from codegen.program import Program
from derive.enforcement import ENFORCEMENTS, Options, kept_equations
from derive.formulations import equations
from tests.scenes import derived, equations_of_text, mechanics
from tests.toy import toy
from tests.trees import equal_links, several

STRICT = (
    "-std=c99",
    "-O1",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
    "-fsyntax-only",
)
HEADERS = (sysconfig.get_paths()["include"], np.get_include())
EVERY = tuple(integrator.name for integrator in INTEGRATORS)


def _enforced(model: str, *names: str) -> Program:
    """With all integrators and the enforcements of those names, the first of which says what is
    integrated."""
    first = next(e for e in ENFORCEMENTS if e.name == names[0])
    return program(
        kept_equations(mechanics(model), None, "quasi_velocities", first, Options()),
        None,
        EVERY,
        names,
    )


def _rolled() -> Program:
    """Loops over links without inputs."""
    text = equal_links(3).partition("inputs:")[0]
    return program(equations_of_text(text), ("dynamics",), roll=ALWAYS)


def _timed() -> Program:
    """Long code in parts, of which only an early one needs the time."""
    spring = "type: spring, joint: j1, stiffness: 3"
    drive = 'type: expression, joint: j1, expression: "(2 N*m)*step(t - 1 s)"'
    text = several().replace(spring, drive)
    return program(equations_of_text(text), ("dynamics",), roll=NEVER)


PROGRAMS: dict[str, Callable[[], Program]] = {
    "toy": lambda: program(toy()),
    "float32": lambda: in_precision(program(toy()), "float32"),
    "four_bar": lambda: _enforced(
        "four_bar", "projection", "none", "partitioning", "selective", "tangent"
    ),
    "rolling_disk": lambda: _enforced("rolling_disk", "invariants", "projection", "none"),
    "charts": lambda: program(equations(mechanics("slider_crank"), "slider+crank", charts=True)),
    "rolled": _rolled,
    "rolled, float32": lambda: in_precision(_rolled(), "float32"),
    "timed": _timed,
    "long": lambda: program(derived("stanford_arm", formulation="udwadia_kalaba")),
}


@pytest.fixture(scope="module", params=PROGRAMS)
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp(request.param)
    for name, content in emit(PROGRAMS[request.param]()).items():
        (place / name).write_text(content, encoding="utf-8")
    return place


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_file_has_a_warning(folder: Path, compiler: str) -> None:
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed: its warnings were not looked at")
    for source in sorted(folder.glob("*.c")):
        binding = source.name.endswith("_module.c")
        includes = [f"-isystem{place}" for place in HEADERS] if binding else []
        command = [compiler, *STRICT, *includes, source.name]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "flags",
    ["-O2", "-O2 -g -fno-var-tracking-assignments -fsanitize=address,undefined"],
    ids=["fast", "checked"],  # long functions have more variables than a debugger is told of
)
def test_gcc_notes_nothing_while_it_makes_code(folder: Path, flags: str) -> None:
    """What it says of calls with vectors comes late, and as a note that is no error."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is not installed: its notes were not looked at")
    command = ["gcc", *STRICT[:-2], *flags.split(), "-c", "-o", os.devnull]
    for source in sorted(folder.glob("*.c")):
        if not source.name.endswith("_module.c"):
            call = [*command, source.name]
            done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
            assert done.returncode == 0 and not done.stderr, done.stderr
