"""Rows of many loops without their zeros: the same states and the same initial state as with all
entries, in memory that grows as the loops do.

Of derive.states: sparse, views, sampling, closing, initial, axes.
"""

from __future__ import annotations

import tracemalloc

import casadi as ca
import numpy as np
import pytest

from derive.choices.survey import survey_of
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.sampling import states
from derive.states.sparse import Sparse, clearly_independent, squares, stacked, with_zeros
from tests.loops import four_bars


def few_entries(k: int, m: int, n: int) -> Sparse:
    """k random matrices m × n with two entries in a row, one of them its own."""
    rng = np.random.default_rng(0)
    rows = [*range(m), *range(m)]
    columns = [*range(m), *(m + i % (n - m) for i in range(m))]
    pattern = ca.Sparsity.triplet(m, n, rows, columns)
    return Sparse(pattern, rng.normal(size=(k, pattern.nnz())) + 2.0)


def test_products_and_solutions_are_those_of_the_full_matrices() -> None:
    J = few_entries(3, 7, 10)
    full, rng = J.full(), np.random.default_rng(1)
    x, y = rng.normal(size=(3, 10)), rng.normal(size=(3, 7))
    np.testing.assert_allclose(J.applied(x), np.einsum("kij,kj->ki", full, x))
    np.testing.assert_allclose(J.transposed(y), np.einsum("kij,ki->kj", full, y))
    np.testing.assert_allclose(J.lengths(), np.linalg.norm(full, axis=2))
    shortest = np.einsum("kij,kj->ki", np.linalg.pinv(full), y)
    np.testing.assert_allclose(squares(J.pattern).shortest(J, y), shortest, atol=1e-12)
    both = stacked(J, J.scaled(np.full(7, 2.0)))
    np.testing.assert_allclose(both.full(), np.concatenate([full, 2 * full], axis=1))
    np.testing.assert_allclose(J.of_rows([4, 1]).full(), full[:, [4, 1]])
    np.testing.assert_allclose(with_zeros(full[0]).full()[0], full[0])


def test_singular_values_are_those_of_the_full_matrices() -> None:
    J = few_entries(3, 7, 10)
    values = np.linalg.svd(J.full(), compute_uv=False)
    least, largest = squares(J.pattern).extremes(J)
    np.testing.assert_allclose(least, values[:, -1], rtol=1e-2)
    np.testing.assert_allclose(largest, values[:, 0], rtol=1e-2)
    twice = stacked(J, J.of_rows([2]))  # squares alone would say 1e-7
    assert np.all(squares(twice.pattern).extremes(twice)[0] < 1e-12 * values[:, 0])
    strength = squares(J.pattern).strength(J)
    np.testing.assert_allclose(strength, np.sum(values**-2, axis=1) ** -0.5, rtol=1e-9)


def test_rows_that_repeat_others_are_not_clearly_independent() -> None:
    J = few_entries(3, 7, 10)
    assert clearly_independent(J)
    assert not clearly_independent(stacked(J, J.of_rows([2])))
    near = J.of_rows([2]).scaled(np.full(1, 3.0))
    assert not clearly_independent(stacked(J, Sparse(near.pattern, near.entries + 1e-9)))


@pytest.fixture
def row() -> System:
    return system(load_text(four_bars(12)))


def test_states_are_those_found_with_all_entries(
    row: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    dense = states(row, 5), initial_state(row), survey_of(row).kept
    monkeypatch.setattr("derive.states.closing.MANY_ROWS", 1)
    found = states(row, 5)
    for name in ("t", "q", "v", "u", "p"):
        np.testing.assert_allclose(getattr(found, name), getattr(dense[0], name), atol=1e-9)
    start = initial_state(row)
    np.testing.assert_allclose(start.q, dense[1].q, atol=1e-12)
    np.testing.assert_allclose(start.v, dense[1].v, atol=1e-12)
    survey = survey_of(row)
    assert survey.without_zeros is not None and survey.kept == dense[2]


def test_rows_that_repeat_others_are_looked_at_with_all_entries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A second joint at the place of one that is there: each loop stays, two rows go."""
    text = four_bars(5).replace(
        "closures:\n",
        "closures:\n  D0: {type: revolute, between: [c0, r1], at: [[l, 0], [l, 0]]}\n",
    )
    doubled = system(load_text(text))
    kept = survey_of(doubled).kept
    monkeypatch.setattr("derive.states.closing.MANY_ROWS", 1)
    survey = survey_of(doubled)
    assert survey.without_zeros is None and survey.kept == kept and len(kept) == 10


def test_memory_grows_as_the_loops_do() -> None:
    """Matrices with all entries would take nine times as much for three times the loops."""
    peaks = []
    for loops in (62, 186):
        mechanism = system(load_text(four_bars(loops)))
        tracemalloc.start()
        survey = survey_of(mechanism)
        assert survey.kept == tuple(range(2 * loops)) and len(survey.sampled.t)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 4 * peaks[0]
