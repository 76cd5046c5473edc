"""Rows of loops written out: as many operations and as much text a loop, however many there are.

Of derive.choices: elimination, survey; of derive.mechanics: pivoting.
"""

from __future__ import annotations

import numpy as np
import pytest

from codegen.emit import emit
from codegen.passes import program
from codegen.program import Program
from derive.formulations import equations
from derive.mechanics.pivoting import sparse_pivot_order
from derive.model import load_text
from derive.states import system
from tests.loops import four_bars

FEW, MANY = 40, 130


@pytest.fixture(scope="module")
def programs() -> dict[int, Program]:
    return {n: _program(n) for n in (FEW, MANY)}


def _program(n: int) -> Program:
    return program(equations(system(load_text(four_bars(n)), "all")), ("dynamics", "bias"))


def test_operations_a_loop_do_not_grow(programs: dict[int, Program]) -> None:
    for name in ("dynamics", "bias"):
        few, many = (programs[n].kernel(name).operations["total"] / n for n in (FEW, MANY))
        assert many <= 1.05 * few
    assert programs[MANY].kernel("dynamics").operations["total"] <= 72 * MANY


def test_texts_grow_as_the_loops_do(programs: dict[int, Program]) -> None:
    sizes = [sum(map(len, emit(programs[n]).values())) for n in (FEW, MANY)]
    assert sizes[1] <= sizes[0] * MANY / FEW


def test_pivots_of_a_band_are_found_without_looking_at_all_of_it() -> None:
    """Each row and each column once, and every block regular in what is left of it."""
    n, rng = 600, np.random.default_rng(0)
    rows = np.concatenate([np.arange(n), np.arange(n - 1), np.arange(1, n)])
    columns = np.concatenate([np.arange(n), np.arange(1, n), np.arange(n - 1)])
    values = rng.uniform(0.1, 1.0, (5, len(rows)))
    blocks = sparse_pivot_order(n, (rows, columns), values, np.zeros(len(rows), dtype=bool))
    assert sorted(i for x in blocks for i in x.rows) == list(range(n))
    assert sorted(j for x in blocks for j in x.columns) == list(range(n))
    assert all(x.largest > 0.0 for x in blocks)
