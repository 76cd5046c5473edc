"""Rows of loops in C, where statements that come again and again are written once: against NumPy,
where all are written out, for one state and for many.

Of codegen.passes: repeats, tables, split, lanes.
Of codegen.targets: c_functions, repeated.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from codegen.passes import program
from codegen.passes.lanes import is_batched
from codegen.program import Program
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states
from hamel.build.module import module_in, published
from tests.loops import four_bars

N = 60
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


@pytest.fixture(scope="module")
def module(row: tuple[System, Program], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("repeated") / "four_bars"
    published(row[1], folder)
    return module_in(str(folder))


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


@pytest.mark.parametrize("name", NAMES[:-1])
def test_c_agrees_with_what_is_written_out(
    name: str, row: tuple[System, Program], module: Any
) -> None:
    sampled = states(row[0], 12)
    numpy = importlib.import_module(f"{module.__name__}._numpy")
    qv = np.hstack([sampled.q, sampled.v])
    x = module.state(sampled.t, qv, sampled.u, sampled.p)
    many = getattr(module, name)(sampled.t, x, sampled.u, sampled.p)
    expected = getattr(numpy, name)(sampled.t, x, sampled.u, sampled.p)
    size = np.max(np.abs(expected), initial=1.0)
    assert np.max(np.abs(many - expected)) <= 1e-11 * size
    for k, found in enumerate(many):
        alone = getattr(module, name)(sampled.t[k], x[k], sampled.u[k], sampled.p[k])
        assert np.max(np.abs(alone - found)) <= 1e-11 * size
