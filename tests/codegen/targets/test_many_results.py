"""Functions of many results: each is stored as soon as it is known, zeros by fours, and everything
that is computed is looked at.

Of codegen.targets: c.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen.emit import emit
from codegen.loader import load as load_module
from codegen.loader import part
from codegen.program import Program
from codegen.targets.c import APART, FOUR, MANY, _stretches
from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from hamel.build.module import published
from hamel.build.stages import program_of

ROOT = Path(__file__).parents[3]
N = 5
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only")


def chain() -> str:
    """N links about axes in turn, each of them with all ten parameters."""
    body = "{mass: 1 kg, com: [0.1, 0.02, 0.03], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]}"
    bodies = "\n".join(f"  b{k}: {body}" for k in range(N))
    joints = "\n".join(
        f"  J{k}: {{type: revolute, parent: {f'b{k - 1}' if k else 'ground'}, child: b{k}, "
        f"at: [0.3, 0, {0.1 * k}], axis: {'zyx'[k % 3]}, coordinate: q{k}}}"
        for k in range(N)
    )
    return f"model: many\ngravity: [0, 0, -9.81 m/s^2]\nbodies:\n{bodies}\njoints:\n{joints}\n"


@cache
def written() -> Program:
    return program_of(equations(system(load_text(chain()))), ("default", "regressor"))


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    folder = tmp_path_factory.mktemp("many") / "many"
    published(written(), folder)
    return load_module(folder)


def drawn(rows: int) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(rows, 3 * N))


def test_each_result_is_stored_where_it_is_computed_and_zeros_by_fours():
    files = emit(written())
    assert written().kernel("regressor").size == 10 * N * N >= MANY
    text = files["many_regressor.c"]
    assert "int many_regressor(" not in files["many.c"]
    lines = [line.strip() for line in text.splitlines()]
    stored = [k for k, line in enumerate(lines) if re.match(r"out\[\d+\] = z\d+;", line)]
    assert sum(lines[k - 1].startswith("const double") for k in stored) > 0.8 * len(stored)
    cleared = {int(x) + k for x in re.findall(r"_zeros\(out \+ (\d+)\)", text) for k in range(FOUR)}
    single = {int(x) for x in re.findall(r"out\[(\d+)\] = 0\.0;", text)}
    assert not cleared & single
    zeros = cleared | single
    assert zeros == {i for i, x in enumerate(written().kernel("regressor").outputs) if x == 0.0}
    assert not any({i, i + 1, i + 2, i + 3} <= single for i in single)


def test_every_computed_result_is_looked_at():
    text = emit(written())["many_regressor.c"]
    calls = re.findall(r"_stray\(out(?: \+ (\d+))?, (\d+)\)", text)
    looked = {int(first or 0) + k for first, count in calls for k in range(int(count))}
    assert len(calls) > 1 and {*written().kernel("regressor").results} <= looked


def test_it_compiles_without_a_warning(tmp_path: Path):
    for name, text in emit(written()).items():
        if name in ("many.h", "many_regressor.c"):
            (tmp_path / name).write_text(text, "utf-8")
    done = subprocess.run(
        ["gcc", *STRICT, "many_regressor.c"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_c_is_numpy(module: ModuleType):
    for x in drawn(5):
        found, wanted = module.regressor(0.0, x), part(module, "_numpy").regressor(0.0, x)
        assert found.shape == (N, 10 * N)
        assert np.abs(found - wanted).max() <= 1e-13 * np.abs(wanted).max()


@pytest.mark.parametrize("entry", range(3 * N))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_nothing_that_is_no_number_passes(module: ModuleType, entry: int, value: float):
    """In any argument: those of the last links show in the last rows and columns alone."""
    x = drawn(1)[0]
    x[entry] = value
    with pytest.raises(FloatingPointError, match="not finite"):
        module.regressor(0.0, x)


@pytest.mark.parametrize("link", range(N))
def test_an_overflow_in_the_columns_of_one_link_is_seen(module: ModuleType, link: int):
    x = drawn(1)[0]
    x[N + link] = 1e200  # its square is infinite
    with pytest.raises(FloatingPointError, match="not finite"):
        module.regressor(0.0, x)


def test_zeros_by_fours_where_parameters_are_precomputed_apart():
    """What is computed of parameters alone leaves a function whose zeros only the rest writes."""
    found = equations(system(load(ROOT / "models/stanford_arm.yaml")))
    text = emit(program_of(found, ("dynamics", "derivatives")))["stanford_arm.c"]
    assert "stanford_arm_zeros(out" in text
    assert "static inline void stanford_arm_zeros(" in text


@pytest.mark.parametrize("apart", [1, APART])
def test_stretches_cover_all_places_and_stand_apart(apart: int):
    rng = np.random.default_rng(2)
    for count in (0, 1, 7, 60):
        places = sorted(rng.choice(300, count, replace=False).tolist())
        found = _stretches(places, apart)
        within = [first + k for first, n in found for k in range(n)]
        assert set(places) <= set(within) and len(within) == len(set(within))
        assert all(first in places and first + n - 1 in places for first, n in found)
        ends = [(a + n - 1, b) for (a, n), (b, _) in pairwise(found)]
        assert all(b - a > apart for a, b in ends)
