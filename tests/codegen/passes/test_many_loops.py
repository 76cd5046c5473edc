"""Rows of loops written out: as many operations and as much text a loop, however many there are.

Of derive.choices: elimination, survey; of derive.mechanics: pivoting.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from codegen.emit import emit
from codegen.passes import program
from codegen.passes.pipeline import _roots
from codegen.passes.rewriting.improve import improve
from codegen.passes.rewriting.trace import record
from codegen.passes.selection import selection
from codegen.program import Program
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.elimination.pivoting import sparse_pivot_order
from derive.model import load_text
from derive.states import system
from tests.loops import four_bars

FEW, MANY = 40, 90
BESIDE = 6  # rows of FEW: more operations and nodes than any limit of the passes


@pytest.fixture(scope="module")
def derived() -> dict[int, Equations]:
    return {n: equations(system(load_text(four_bars(n)), "all")) for n in (FEW, MANY)}


@pytest.fixture(scope="module")
def programs(derived: dict[int, Equations]) -> dict[int, Program]:
    return {n: program(derived[n], ("dynamics", "bias")) for n in derived}


def test_operations_a_loop_do_not_grow(programs: dict[int, Program]) -> None:
    for name in ("dynamics", "bias"):
        few, many = (programs[n].kernel(name).operations["total"] / n for n in (FEW, MANY))
        assert many <= 1.05 * few
    assert programs[MANY].kernel("dynamics").operations["total"] <= 62 * MANY


def test_a_large_mass_matrix_has_to_be_asked_for(
    derived: dict[int, Equations],
) -> None:
    few, many = ({f.name for f in selection(derived[n], None)} for n in (FEW, MANY))
    assert few - many == {"mass"}
    assert "mass" in {f.name for f in selection(derived[MANY], ("default", "mass"))}


def test_operations_a_loop_do_not_grow_with_the_length_of_a_function(
    derived: dict[int, Equations],
) -> None:
    """Rows beside each other in one function take as many as each alone: nothing that saves some is
    left out of a long function."""
    one, many = (_operations(derived[FEW], rows) for rows in (1, BESIDE))
    assert many <= 1.01 * BESIDE * one


def _operations(found: Equations, rows: int) -> int:
    """Of the dynamics of so many rows, each with its own arguments."""
    slots = [(slot.name, slot.symbols) for slot in found.arguments]
    dynamics = next(function for function in found.functions if function.name == "dynamics")
    row = ca.Function("row", [symbols for _, symbols in slots], [ca.vertcat(*_roots(dynamics))])
    arguments = [(name, ca.SX.sym(name, symbols.numel(), rows)) for name, symbols in slots]
    results = [row(*(columns[:, k] for _, columns in arguments)) for k in range(rows)]
    best, _ = improve("rows", record(arguments, results), range(0))
    return best.total


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
