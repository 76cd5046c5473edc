"""Functions of many results: each is stored as soon as it is known, zeros by fours, and everything
that is computed is looked at.

Of codegen.targets: c, c_functions.
"""

from __future__ import annotations

import re
import subprocess
import warnings
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen.emit import emit
from codegen.limits import MANY_RESULTS
from codegen.loader import load as load_module
from codegen.loader import part
from codegen.program import Program, Solving
from codegen.targets.c_functions import (
    APART,
    EIGHT,
    FOUR,
    _columns,
    _given,
    _in_side,
    _stretches,
)
from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from hamel.build.module import published
from hamel.build.stages import program_of

pytestmark = pytest.mark.optimised

ROOT = Path(__file__).parents[3]
N = 5
LONGER = 7
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only")


def chain(count: int = N) -> str:
    """Links about axes in turn, each of them with all ten parameters."""
    body = "{mass: 1 kg, com: [0.1, 0.02, 0.03], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]}"
    bodies = "\n".join(f"  b{k}: {body}" for k in range(count))
    joints = "\n".join(
        f"  J{k}: {{type: revolute, parent: {f'b{k - 1}' if k else 'ground'}, child: b{k}, "
        f"at: [0.3, 0, {0.1 * k}], axis: {'zyx'[k % 3]}, coordinate: q{k}}}"
        for k in range(count)
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


@cache
def with_slopes() -> Program:
    return program_of(equations(system(load_text(chain(LONGER)))), ("default", "derivatives"))


@pytest.fixture(scope="module")
def slopes(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    folder = tmp_path_factory.mktemp("slopes") / "many"
    published(with_slopes(), folder)
    return load_module(folder)


def drawn(rows: int) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(rows, 3 * N))


def test_each_result_is_stored_where_it_is_computed_and_zeros_by_fours():
    files = emit(written())
    assert written().kernel("regressor").size == 10 * N * N >= MANY_RESULTS
    text = files["many_regressor.c"]
    assert "int many_regressor(" not in files["many.c"]
    lines = [line.strip() for line in text.splitlines()]
    stored = [k for k, line in enumerate(lines) if re.match(r"out\[\d+\] = z\d+;", line)]
    assert sum(lines[k - 1].startswith("const double") for k in stored) > 0.8 * len(stored)
    cleared = {int(x) + k for x in re.findall(r"_zeros\(out \+ (\d+)\)", text) for k in range(FOUR)}
    # many in a row in a loop
    loops = re.findall(r"; i < (\d+); i \+= 4\)\n +many_zeros\(out \+ (?:(\d+) \+ )?i\);", text)
    cleared |= {int(first or 0) + k for count, first in loops for k in range(int(count))}
    assert loops
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


def test_what_differs_between_states_leaves_the_lanes_by_fours_and_nothing_else():
    kernel, text = with_slopes().kernel("derivatives"), emit(with_slopes())["many_batch.c"]
    text = text[text.index("many_derivatives_same(") :]
    stored = {int(i) for i in re.findall(r"out\[(\d+) \* LANES \+ lane\] =", text)}
    vary = {i for i, value in enumerate(kernel.outputs) if isinstance(value, (str, tuple))}
    handed = [int(i) for i in re.findall(r"hand\(out \+ (\d+) \* LANES, rows \+ \1,", text)]
    places = {first + k for first in handed for k in range(FOUR)}
    assert len(handed) == len(set(handed)) and vary <= places == stored
    assert len(places) < 0.75 * kernel.size


@pytest.mark.parametrize("less", [0, 1, 3])
@pytest.mark.parametrize("ends", [0.0, 1.0, "z1"])
def test_all_results_are_written_and_nothing_beyond_them(less: int, ends: float | str):
    """Where their number is no multiple of four, the last four begin within those before."""
    kernel = with_slopes().kernel("derivatives")
    outputs = (*kernel.outputs[: 208 - less - 6], *[ends] * 6)
    given = _given(replace(kernel, outputs=outputs, shape=(len(outputs),)))
    assert given is not None
    cleared = [
        i + k
        for first, n in given.zeros
        for i in range(first, first + n, FOUR)
        for k in range(FOUR)
    ]
    set_once = {first + k: x for first, values in given.constants for k, x in enumerate(values)}
    handed = {first + k for first in given.fours for k in range(FOUR)}
    assert {*cleared, *set_once, *handed} == set(range(len(outputs)))
    assert all(outputs[i] == 0.0 for i in cleared)
    assert all(float(x) == outputs[i] for i, x in set_once.items())


@pytest.mark.parametrize("rows", [1, 7, 8, 37])
def test_many_states_are_as_one_by_one(slopes: ModuleType, rows: int):
    x = np.random.default_rng(3).normal(size=(rows, 2 * LONGER))
    found = slopes.derivatives(0.0, x)
    alone = np.array([slopes.derivatives(0.0, row) for row in x])
    assert np.abs(found - alone).max() <= 1e-12 * np.abs(alone).max()
    fixed = np.array(
        [not isinstance(v, (str, tuple)) for v in with_slopes().kernel("derivatives").outputs]
    )
    flat = [rows.reshape(rows.shape[0], -1)[:, fixed] for rows in (found, alone)]
    assert np.array_equal(flat[0], flat[1]) and np.array_equal(
        flat[0], np.broadcast_to(flat[0][0], flat[0].shape)
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
@pytest.mark.parametrize("entry", [0, LONGER, 2 * LONGER - 1])
def test_a_state_among_many_that_is_no_number_stands_alone(
    slopes: ModuleType, entry: int, value: float
):
    x = np.random.default_rng(4).normal(size=(24, 2 * LONGER))
    good = slopes.derivatives(0.0, x)
    x[10, entry] = value
    alone = True
    try:
        slopes.derivatives(0.0, x[10])
    except FloatingPointError:
        alone = False
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        found = slopes.derivatives(0.0, x)
    assert np.isfinite(found[10]).all() if alone else np.isnan(found[10]).all()
    assert np.array_equal(np.delete(found, 10, 0), np.delete(good, 10, 0))


@pytest.mark.parametrize("lengths", [(29, 61), (1,), (8, 8, 8), (96,), (97,), (3, 5, 40)])
def test_columns_that_are_solved_for_have_places_of_their_own(lengths: tuple[int, ...]):
    edges = np.cumsum([2, *(n + 3 for n in lengths)])
    ranges = tuple((int(edge), int(edge) + n) for edge, n in zip(edges, lengths))
    size = ranges[-1][1] + 1
    of = Solving(size, (1, 0), ((0, 1),), (), 2, ranges, ())
    found, total = _columns(of), sum(lengths)
    assert found.wide >= total and found.wide % (found.abreast * EIGHT) == 0
    assert found.wide - total < found.abreast * EIGHT
    kernel = replace(with_slopes().kernel("derivatives"), outputs=(0.0,) * (4 * size), solving=of)
    places = [_in_side(kernel, i) for i in range(4 * size)]
    taken = [place for place in places if place is not None]
    assert len(taken) == len(set(taken)) == 2 * total and max(taken) < 2 * found.wide
    outside = {column for begin, end in found.left for column in range(begin, end)}
    assert all(
        (places[row * size + column] is None) == (row < 2 or column in outside)
        for row in range(4)
        for column in range(size)
    )
