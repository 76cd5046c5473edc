"""Loops that share links one after the other take a sweep from the tips to the base, in steps of
their number, and give what M, A and numpy give.

Of derive.choices: embedded, walk.
Of derive.mechanics.recursions: embedding.
Of derive.mechanics.elimination: quadratic.
Of derive.expressions: settled.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest

from derive.choices.embedded import by_embedding
from derive.choices.explicit import Explicit
from derive.choices.named import carried_through, declared
from derive.choices.reduction import Reduction, Task, Way
from derive.choices.resolution import speed_rows
from derive.choices.survey import Survey, survey_of
from derive.expressions.counting import operations
from derive.expressions.settled import settled
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from tests.loops import ladder, ladder_afloat, ladder_of_rods

Found = tuple[System, Survey, Reduction, Explicit]


@cache
def embedded(text: str, ways_tried: int | None = None) -> Found:
    """The named choice of a model by constraint embedding, whatever else needs fewer operations."""
    found = system(load_text(text))
    survey = survey_of(found)
    choice = declared(found, "left")
    usual = carried_through(survey, choice).reduction
    rows = speed_rows(found, choice)
    task = Task(usual.names, usual.B, survey.kept, survey.sampled_for(usual.B), survey.form_sizes)
    sizes = [*survey.form_sizes, *[1.0] * len(rows)]
    task = Task(task.names, task.B, task.kept, task.sampled, sizes)
    ways = [Way(found, forms, rows) for forms in survey.forms[:ways_tried]]
    result = by_embedding(survey, task, ways, usual)
    assert result is not None
    return found, survey, *result


@pytest.mark.parametrize("make", [ladder, ladder_of_rods])
@pytest.mark.parametrize("n", [2, 5])
def test_the_sweep_gives_what_the_matrices_give(make: Callable[[int], str], n: int) -> None:
    """v, v̇ and, where rows are written as the system has them, λ, at sampled states."""
    check(embedded(make(n)))


def test_speeds_of_joints_behind_links_that_rows_hold() -> None:
    """Of the rungs beside the links that carry them, not of their spins."""
    check(embedded(ladder(4, "e")), 1e-8)


def test_in_space_afloat_and_with_rotors() -> None:
    """Joints with several velocities, spins that rotors feel, axes that are not parallel."""
    check(embedded(ladder_afloat(2)), 1e-8)


def test_multipliers_of_rows_that_are_solved_one_after_the_other() -> None:
    """What waits has a share in what holds the joints before it."""
    found = embedded(ladder_afloat(2), 1)
    assert found[3].lam is not None
    check(found, 1e-8)


def check(found: Found, tolerance: float = 1e-9) -> None:
    of, survey, reduction, explicit = found
    w = reduction.w
    terms = [of.M, ca.densify(of.Q - of.h), of.A, of.beta, of.c]
    given = [of.t, of.q, of.v, of.u, of.p]
    matrices = ca.Function("matrices", given, [ca.densify(x) for x in terms])
    lam = ca.SX(0, 1) if explicit.lam is None else explicit.lam
    moved = ca.Function(
        "moved",
        [of.t, of.q, w, of.u, of.p],
        [ca.densify(x) for x in (reduction.v, explicit.vdot, explicit.wdot, lam, reduction.B)],
    )
    rng, s = np.random.default_rng(0), survey.sampled
    for k in range(6):
        fast = rng.normal(size=w.numel())
        here = moved(s.t[k], s.q[k], fast, s.u[k], s.p[k])
        v, vdot, wdot, forces, B = (np.array(x) for x in here)
        M, F, A, beta, c = (np.array(x) for x in matrices(s.t[k], s.q[k], v, s.u[k], s.p[k]))
        n, r = len(M), len(A)
        whole = np.block([[M, -A.T], [A, np.zeros((r, r))]])
        expected = np.linalg.solve(whole, np.concatenate([F, beta]))
        size = 1 + np.abs(expected).max()
        np.testing.assert_allclose(A @ v, c, atol=1e-10)
        np.testing.assert_allclose(B @ v, fast.reshape(-1, 1), atol=1e-12)
        np.testing.assert_allclose(vdot, expected[:n], rtol=0, atol=tolerance * size)
        np.testing.assert_allclose(wdot, B @ expected[:n], rtol=0, atol=tolerance * size)
        if forces.size:
            np.testing.assert_allclose(forces, expected[n:], rtol=0, atol=tolerance * size)


def test_multipliers_of_a_ladder_are_found_on_the_way() -> None:
    for text in (ladder(3), ladder_of_rods(3)):
        assert embedded(text)[3].lam is not None


@pytest.mark.parametrize(("make", "speed"), [(ladder, "p"), (ladder, "e"), (ladder_afloat, "")])
def test_the_nearest_step_is_that_of_the_bordered_matrix(
    make: Callable[..., str], speed: str
) -> None:
    """δ of A δ = b, least in the metric of M, whatever the choice: no pivot of it is in the way."""
    of, survey, _, explicit = embedded(make(3, speed) if speed else make(2), 1)
    assert explicit.nearest is not None
    b = ca.SX.sym("b", survey.rank)
    step = ca.vertcat(*explicit.nearest(ca.vertsplit(b)))
    kept = list(survey.kept)
    terms = [ca.densify(x) for x in (of.M, of.A[kept, :], step)]
    at = ca.Function("step", [of.t, of.q, of.p, b], terms)
    rng, s = np.random.default_rng(0), survey.sampled
    for k in range(5):
        side = rng.normal(size=survey.rank)
        M, A, found = (np.array(x) for x in at(s.t[k], s.q[k], s.p[k], side))
        bordered = np.block([[M, -A.T], [A, np.zeros((len(A), len(A)))]])
        expected = np.linalg.solve(bordered, np.concatenate([np.zeros(len(M)), side]))[: len(M)]
        np.testing.assert_allclose(
            found.ravel(), expected, atol=1e-9 * (1 + np.abs(expected).max())
        )


def test_project_of_a_ladder_takes_as_many_operations_for_each_rung() -> None:
    found = [equations(system(load_text(ladder(n)))).function("project") for n in (3, 4, 5)]
    first, second = np.diff([operations(x.result.value) for x in found])
    assert second <= 1.1 * first


@pytest.mark.parametrize(
    "make", [ladder, pytest.param(ladder_of_rods, marks=pytest.mark.slow)], ids=["rungs", "rods"]
)
def test_each_rung_takes_as_many_operations_as_the_one_before(make: Callable[[int], str]) -> None:
    """And v of all of them, which was quadratic."""
    found = [embedded(make(n)) for n in (4, 5, 6)]
    for counts in (
        [x.operations for *_, x in found],
        [operations(reduction.v) for *_, reduction, _ in found],
    ):
        first, second = np.diff(counts)
        assert second <= 1.02 * first


def test_each_rung_is_closed_by_its_own_joints() -> None:
    """A pivot that comes near zero does not wait for rows that speak of other loops: of a block
    triangular matrix each block is regular for itself. Pivots waited for the last rung."""
    of = system(load_text(ladder(9)))
    found = carried_through(survey_of(of), declared(of, "left"))
    for sentence in found.reduction.pivots:
        rows, _ = sentence.split(" give", 1)
        assert len({name.split(".")[0] for name in rows.split(" and ")}) == 1


def test_formulas_that_are_numbers_are_seen_and_others_are_not() -> None:
    x = ca.SX.sym("x")
    turned_back = ca.cos(x) ** 2 + ca.sin(x) ** 2
    values = [turned_back, turned_back - 1, -turned_back, ca.sqrt(x), 2 * turned_back, 0.5]
    found = settled(values)
    assert found[:3] == [1.0, 0.0, -1.0]
    assert found[3] is values[3] and found[4] is values[4] and found[5] == 0.5
    assert settled([]) == []
