"""Rows of loops in C and NumPy, where statements that come again and again are written once: against
NumPy with all of them written out, for one state and for many.

Of codegen.passes.folding: repeats, tables, split.
Of codegen.passes: lanes.
Of codegen.targets: c_functions, numpy, repeated.
"""

from __future__ import annotations

import ctypes
import importlib
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import program
from codegen.passes.folding.split import Part, split
from codegen.passes.folding.tables import Column, Repeat
from codegen.passes.lanes import WIDEST, is_batched
from codegen.program import Program
from codegen.targets.repeated import SHORT, again
from codegen.targets.turns import angles_of
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states
from hamel.build.module import loaded, module_in, published
from tests.arrays import address, aligned
from tests.loops import four_bars

N = 60
STRICT = ("-std=c99", "-O3", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
NAMES = ("dynamics", "constraints", "energy", "velocity", "state")


def _uneven(n: int) -> str:
    """Every loop with a mass and a length of its own: its numbers stand in a table."""
    text = four_bars(n)
    for i in range(n):
        own = f"c{i}: {{mass: {1 + i / n}, com: [{0.5 + i / (4 * n)}, 0], inertia: 0.1}}"
        text = text.replace(f"c{i}: {{mass: m, com: [l/2, 0], inertia: m*l^2/12}}", own)
    return text


@pytest.fixture(scope="module")
def row() -> tuple[System, Program]:
    of = system(load_text(_uneven(N)), "all")
    return of, program(equations(of), NAMES)


@pytest.fixture(scope="module", params=["gcc", "clang"])
def command(request: pytest.FixtureRequest) -> str:
    if not shutil.which(request.param):
        pytest.skip(f"{request.param} is not installed: repeats were not compiled with it")
    return request.param


@pytest.fixture(scope="module")
def module(
    command: str, row: tuple[System, Program], tmp_path_factory: pytest.TempPathFactory
) -> Any:
    folder = tmp_path_factory.mktemp(command) / "four_bars"
    assert published(row[1], folder, compiler=[command]).compiled
    return module_in(str(folder))


@pytest.fixture(scope="module")
def written_out(row: tuple[System, Program], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The NumPy text of the same without repeats."""
    folder = tmp_path_factory.mktemp("written_out") / "four_bars"
    folder.mkdir()
    for name, text in emit(program(equations(row[0]), NAMES, roll="never")).items():
        (folder / name).write_text(text, encoding="utf-8")
    return importlib.import_module(f"{loaded(folder).__name__}._numpy")


def test_bodies_are_what_is_left_to_compile(row: tuple[System, Program]) -> None:
    of, made = row
    assert dict(made.rolling)["dynamics"].startswith("rolled: ")
    kernel = made.kernel("dynamics")
    assert kernel.repeats is not None
    assert kernel.repeats.statements < 0.3 * sum(len(x.statements) for x in kernel.sections)
    assert is_batched(kernel)
    assert not is_batched(replace(kernel, repeats=None))  # too long for lanes as it was
    written_out = program(equations(of), ("dynamics",), roll="never")
    assert written_out.kernel("dynamics") == replace(kernel, repeats=None)


@pytest.mark.parametrize("n", [45, 50, 52, 56])
def test_rows_of_every_length_have_lanes(n: int) -> None:
    """What is too wide for lanes as it is written out is written once, however short it is."""
    made = program(equations(system(load_text(four_bars(n)), "all")), ("dynamics",))
    assert is_batched(made.kernel("dynamics"))
    assert "void four_bars_dynamics_lanes(" in emit(made)["four_bars_batch.c"]


def test_sums_over_very_many_loops_have_no_lanes(row: tuple[System, Program]) -> None:
    """Of a thousand loops two thousand statements are left, and compilers take as long for their
    lanes as for all else."""
    kernel = row[1].kernel("dynamics")
    assert kernel.repeats is not None
    for left, lanes in ((WIDEST, True), (WIDEST + 1, False)):
        some = replace(kernel, repeats=replace(kernel.repeats, statements=left))
        assert is_batched(some) == lanes


def test_sine_and_cosine_of_an_angle_are_computed_once(row: tuple[System, Program]) -> None:
    """They are in the same block, wherever both are read."""
    for part in split(row[1].kernel("dynamics")).parts:
        for section in part.sections:
            for pair in angles_of(section).values():
                assert "sin" not in pair or "cos" in pair


def test_what_is_finite_is_looked_at_in_loops(row: tuple[System, Program]) -> None:
    """An expression of all results takes compilers long."""
    text = emit(row[1])["four_bars_batch.c"]
    assert f"    look({2 * N + 1}, out + 1 * LANES, stray);\n" in text
    assert max(map(len, text.splitlines())) < 1_000


def test_the_compiler_has_no_warning(
    command: str, row: tuple[System, Program], tmp_path: Path
) -> None:
    """Nor where loops over lanes, which are separate, become vectors."""
    texts = emit(row[1])
    for name, content in texts.items():
        if name.endswith((".c", ".h")):
            (tmp_path / name).write_text(content, encoding="utf-8")
    assert "    SEPARATE\n" in texts["four_bars_batch.c"]
    for name in ("four_bars_batch.c", "four_bars_dynamics.c"):
        asked = [command, *STRICT, "-c", name]
        done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_places_that_are_far_away_are_no_short_numbers() -> None:
    makes = (("a",), ("b",), ("c",))
    for last, kind in ((SHORT - 1, "short"), (SHORT, "int")):
        repeat = Repeat(3, makes, {"x": Column((0, 5, last))}, reads={"x": ("x", "y", "z")})
        assert again(Part(repeat=repeat), repeat, {}).kind == kind


@pytest.mark.parametrize("name", NAMES[:-1])
def test_both_agree_with_what_is_written_out(
    name: str, row: tuple[System, Program], module: Any, written_out: Any
) -> None:
    given = _somewhere(row[0], module)
    numpy = importlib.import_module(f"{module.__name__}._numpy")
    many = getattr(module, name)(*given)
    expected = getattr(written_out, name)(*given)
    size = np.max(np.abs(expected), initial=1.0)
    assert np.max(np.abs(getattr(numpy, name)(*given) - expected)) <= 1e-11 * size
    one = getattr(numpy, name)(*(each[0] for each in given))
    assert np.max(np.abs(one - expected[0])) <= 1e-11 * size
    assert np.max(np.abs(many - expected)) <= 1e-11 * size
    for k, found in enumerate(many):
        alone = getattr(module, name)(*(each[k] for each in given))
        assert np.max(np.abs(alone - found)) <= 1e-11 * size


@pytest.mark.slow
def test_the_numpy_text_does_not_grow_with_the_row() -> None:
    texts = [emit(program(equations(system(load_text(four_bars(n)), "all")))) for n in (40, 120)]
    first, longer = (len(text["_numpy.py"]) for text in texts)
    assert longer < 1.2 * first


def test_no_lane_has_to_be_done_again(
    row: tuple[System, Program], module: Any, command: str
) -> None:
    """The function for several states by itself: behind a call what is wrong there, as values that
    nobody has made, could go to the function for one state and be right."""
    lanes = 8 if "__AVX512F__" in compiler.probe((command,))[1] else 4
    t, x, u, p = (aligned(each[:lanes].T) for each in _somewhere(row[0], module))
    out, stray = aligned(np.full(x.shape, np.nan)), aligned(np.full(lanes, np.nan))
    folder = Path(module.__file__).parent
    library = ctypes.CDLL(str(folder / compiler.shared_library("four_bars")))
    library.four_bars_dynamics_lanes(*map(address, (t, x, u, p, out, stray)))
    assert not stray.any()
    for k in range(lanes):
        alone = module.dynamics(t[k], *(np.ascontiguousarray(each[:, k]) for each in (x, u, p)))
        assert np.max(np.abs(out[:, k] - alone)) <= 1e-11 * np.max(np.abs(alone), initial=1.0)


@pytest.mark.parametrize("loop", [0, 31, N - 1])
def test_a_pivot_of_any_loop_is_looked_at(
    loop: int, row: tuple[System, Program], module: Any
) -> None:
    t, x, u, p = _somewhere(row[0], module)
    x[3, N + 1 + loop] = x[3, loop + 1] - x[3, loop] + 1e-8  # the rocker along its coupler
    with pytest.raises(FloatingPointError):
        module.dynamics(t[3], x[3], u[3], p[3])
    with pytest.warns(RuntimeWarning, match="row 3: singular"):
        many = module.dynamics(t, x, u, p)
    assert np.isnan(many).any(axis=1).nonzero()[0].tolist() == [3]


def _somewhere(of: System, module: Any) -> tuple[np.ndarray, ...]:
    """t, x, u and p of 12 states off the constraints: closed loops are parallelograms with the same
    angles, and what is read of another loop would be right."""
    found = states(of, 12)
    x = module.state(found.t, np.hstack([found.q, found.v]), found.u, found.p)
    off = np.random.default_rng(0).uniform(-0.1, 0.1, x.shape)
    return found.t, x + off, found.u, found.p
