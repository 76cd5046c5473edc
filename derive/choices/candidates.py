"""Sets of generalized velocities that may be the quasi-velocities, best conditioned first."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb, log10

import casadi as ca
import numpy as np

from derive.choices.limits import MOST_SUBSETS, RANK, REGULAR
from derive.choices.ranking import conditions, inertia_lost
from derive.choices.survey import Survey, even_rows, speed_name
from derive.mechanics.records import RowForm
from derive.numerics import NONZERO


def candidates(survey: Survey) -> list[tuple[tuple[float, ...], str, tuple[RowForm, ...]]]:
    """Partitions with the worst condition number each: all of them while they are few, else the
    pivoted ones."""
    nv, nw = survey.system.v.numel(), survey.freedom
    subsets = combinations(range(nv), nw) if comb(nv, nw) <= MOST_SUBSETS else _pivoted(survey)
    result: list[tuple[tuple[float, ...], str, tuple[RowForm, ...]]] = []
    for subset in subsets:
        rows = tuple(_alone(survey, j) for j in subset)
        usual, worst, lost, singular = 1.0, 1.0, 0, False
        if survey.system.rows:
            B = np.tile(np.eye(nv)[list(subset)], (len(survey.rows), 1, 1))
            usual, worst = conditions(survey, B)
            lost = inertia_lost(survey, B)
            singular = survey.is_singular_at_start(_matrix(nv, subset))
        names = {row.name for row in rows}
        # what is singular everywhere loses no inertia anywhere; followers before it and what is
        # singular at the start, then by condition; of equals the actuated ones, then the first of
        # the tree
        order = (
            usual * RANK > 1.0,
            len(names & survey.followers),
            singular,
            lost,
            round(np.log10(worst), 1),
            -len(names & survey.driven),
            subset[0] if subset else 0,
        )
        result.append((order, " ".join(row.name for row in rows), rows))
    return result


def _pivoted(survey: Survey) -> list[tuple[int, ...]]:
    """Greedy: columns of the sampled A with the largest smallest remainder become dependent, the
    others stay free.

    Three preferences: with all columns equal, and with the first velocities of the tree kept free,
    less and more. Each of them twice where an input acts: without a look at it, and with actuated
    speeds kept free among columns that are about as good.
    """
    nv = survey.system.v.numel()
    driven = frozenset(j for j in range(nv) if speed_name(survey.system, j) in survey.driven)
    weights = [1.0 + slope * np.arange(nv) / nv for slope in (0.0, 1.0, 10.0)]

    def partitions(rows: np.ndarray) -> list[tuple[int, ...]]:
        return [
            _greedy(survey, weight, spared, rows)
            for spared in (frozenset[int](), driven)
            for weight in weights
        ]

    usual = survey.rows[:, list(survey.kept)]
    found = list(dict.fromkeys(partitions(usual)))
    start = survey.initial
    if start is None or not all(survey.is_singular_at_start(_matrix(nv, x)) for x in found):
        return found
    # it is no random state: what is singular just there may be well conditioned at all of these
    there = survey.solver.rows(start.t, start.q, start.p)[0][:, list(survey.kept)]
    return list(dict.fromkeys([*found, *partitions(np.concatenate([usual, even_rows(there)]))]))


def _matrix(nv: int, subset: Sequence[int]) -> ca.SX:
    """B of a partition."""
    return ca.SX(ca.sparsify(ca.DM(np.eye(nv)[list(subset)])))


def suited(survey: Survey, k: int) -> tuple[str, tuple[RowForm, ...]]:
    """The partition whose pivots are the largest at one of the `many` states."""
    s, one = survey.many, slice(k, k + 1)
    rows_there = survey.solver.rows(s.t[one], s.q[one], s.p[one])[0][:, list(survey.kept)]
    lengths = np.linalg.norm(rows_there, axis=2, keepdims=True)
    free = _greedy(
        survey,
        np.ones(survey.system.v.numel()),
        frozenset(),
        rows_there / np.maximum(lengths, NONZERO),
    )
    rows = tuple(_alone(survey, j) for j in free)
    return " ".join(row.name for row in rows), rows


def _alone(survey: Survey, j: int) -> RowForm:
    return RowForm(speed_name(survey.system, j), (), ((j, 1.0),))


def _greedy(
    survey: Survey, weight: np.ndarray, spared: frozenset[int], matrices: np.ndarray
) -> tuple[int, ...]:
    """The free columns, increasing, by the rows at some states. Of columns in one tenth of a decade
    the `spared` ones become dependent last."""
    free = list(range(survey.system.v.numel()))
    followers = {j for j in free if speed_name(survey.system, j) in survey.followers}
    for _ in range(survey.rank):
        lengths: np.ndarray = np.min(np.linalg.norm(matrices, axis=1), axis=0)
        sizes = [round(float(x), 6) for x in lengths * weight]
        tenths = [round(log10(max(x, NONZERO)), 1) for x in sizes]
        following = {k for k in followers if sizes[k] > REGULAR}  # dependent first
        j = max(free, key=lambda k: (k in following, tenths[k], k not in spared, sizes[k], k))
        free.remove(j)
        matrices = _deflated(matrices, j)
    return tuple(free)


def _deflated(A: np.ndarray, j: int) -> np.ndarray:
    """Column j taken out of all columns."""
    length = np.linalg.norm(A[:, :, j], axis=1)
    unit = A[:, :, j] / np.where(length > 0, length, 1.0)[:, None]
    return A - unit[:, :, None] * (unit[:, None, :] @ A)
