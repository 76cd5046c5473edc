"""Pivots that may lose digits give way to reflections.

Of derive.choices: pivots.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from derive.choices.named import carried_through, declared
from derive.choices.survey import survey_of
from derive.mechanics.elimination.pivoting import pivot_order
from derive.mechanics.elimination.solve import (
    Block,
    growth,
    reflected_solution,
    scalars,
    small_inverse,
)
from derive.mechanics.limits import COFACTORS
from derive.model import load
from derive.states import system
from derive.states.sampling import states

FINDINGS = Path(__file__).parents[2] / "findings"


@pytest.mark.parametrize("n", [4, 6, 9])
def test_reflections_solve_what_no_fixed_pivots_do(n: int) -> None:
    """Also where every leading entry is zero, with what tells how near they are to singular and the
    sign of the determinant."""
    A = ca.SX.sym("A", n, n)
    inverse, nearness = small_inverse(scalars(A))
    function = ca.Function("f", [A], [ca.vertcat(*[ca.horzcat(*x) for x in inverse]), nearness])
    rng = np.random.default_rng(n)
    for k in range(10):
        value = rng.normal(size=(n, n))
        if k > 5:
            value[: n // 2, : n // 2] = 0.0
        got, size = function(value)
        np.testing.assert_allclose(got.full() @ value, np.eye(n), atol=1e-11)
        assert np.sign(float(size)) == np.sign(np.linalg.det(value))
        least = np.linalg.svd(value, compute_uv=False)[-1]
        assert least <= abs(float(size)) * (1 + 1e-9) < 40 * least


def test_nearness_is_no_product() -> None:
    """The determinant of a regular matrix of small rows is nothing; what is left of its columns is
    as large as they are."""
    A = ca.SX.sym("A", 6, 6)
    _, nearness = small_inverse(scalars(A))
    value = 1e-3 * np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))[0]
    assert abs(float(ca.Function("f", [A], [nearness])(value))) == pytest.approx(1e-3)


def test_reflections_leave_structural_zeros_alone() -> None:
    """A matrix with entries in few places, in any order of rows and columns."""
    rng = np.random.default_rng(0)
    pattern = np.eye(7)[rng.permutation(7)] + np.eye(7)[rng.permutation(7)] > 0
    pattern[rng.integers(7), :] = True
    A = ca.SX(ca.Sparsity.triplet(7, 7, *map(list, np.nonzero(pattern))))
    symbols = ca.SX.sym("a", A.nnz())
    A = ca.SX(A.sparsity(), symbols)
    solution, nearness = reflected_solution(scalars(A), [[float(i)] for i in range(7)])
    function = ca.Function("f", [symbols], [ca.vertcat(*[x for (x,) in solution]), nearness, A])
    got, size, value = (x.full() for x in function(rng.normal(size=A.nnz())))
    np.testing.assert_allclose(value @ got.ravel(), np.arange(7.0), atol=1e-10)
    assert np.sign(size.item()) == np.sign(np.linalg.det(value))


def test_more_rows_than_unknowns_are_least_squares() -> None:
    A = ca.SX.sym("A", 6, 4)
    solution, _ = reflected_solution(scalars(A), [[float(i)] for i in range(6)])
    value = np.random.default_rng(1).normal(size=(6, 4))
    got = ca.Function("f", [A], [ca.vertcat(*[x for (x,) in solution])])(value).full().ravel()
    np.testing.assert_allclose(
        got, np.linalg.lstsq(value, np.arange(6.0), rcond=None)[0], rtol=1e-10
    )


def test_a_small_pivot_shows_as_growth_and_is_not_taken() -> None:
    values = np.random.default_rng(2).normal(size=(40, 5, 5))
    values[0, 0, 0] = 1e-6
    assert growth(values, Block((0,), (0,), 1e-6, 2.0, 2)) > 1e4
    every = np.ones((5, 5), dtype=bool)
    blocks = pivot_order(values, every, ~every)
    assert max(len(block.rows) for block in blocks) > COFACTORS


def test_stewart_platform_in_leg_speeds_keeps_its_digits() -> None:
    """S against the inverse by pivoting at run time, at states that pivots were not chosen at: with
    pivots chosen beforehand it was off by 1e-9 at a condition of 70."""
    mechanics = system(load(FINDINGS / "stewart.yaml"))
    survey = survey_of(mechanics)
    found = carried_through(survey, declared(mechanics, "legs"))
    s = states(mechanics, 60, seed=7)
    A = survey.solver.rows(s.t, s.q, s.p)[0][:, list(survey.kept)]
    S = survey.solver.values(found.reduction.S, s.t, s.q, s.p)
    B = ca.DM(found.reduction.B).full()
    for rows, got in zip(A, S):
        Y = np.vstack([rows, B])
        wanted = np.linalg.inv(Y)[:, -len(B) :]
        condition = np.linalg.cond(Y / np.linalg.norm(Y, axis=1, keepdims=True))
        assert np.abs(got - wanted).max() < 1e-14 * condition * np.abs(wanted).max()
    guards = ca.vertcat(*[guard.value / guard.tolerance for guard in found.reduction.guards])
    margins = np.abs(survey.solver.values(guards, s.t, s.q, s.p)).min(axis=1)
    assert margins.min() > 1.0  # by the determinant three of them are refused
    assert found.ranking.operations < 5575  # what those pivots took
