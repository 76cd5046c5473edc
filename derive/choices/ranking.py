"""How good a candidate for quasi-velocities is, and why it is better than the next.

`auto` ranks by five criteria, in this order: [A; B] regular where the motion begins, pivots that
are numbers or parameters alone (they can never vanish), light bodies that are not told by heavy
ones, the conditioning of [A; B] over sampled consistent states, and the operations of ẋ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log10

import casadi as ca
import numpy as np

from derive.choices.explicit import Explicit
from derive.choices.limits import HEAVY, LIGHT, REGULAR, ROUNDOFF
from derive.choices.reduction import Reduction
from derive.choices.survey import Survey, even_rows, evened
from derive.diagnostics import NAMES, listed
from derive.numerics import NONZERO
from derive.states.sparse import Sparse, squares, stacked

Score = tuple[tuple[int, bool, bool, int], int, int, int]


@dataclass(frozen=True)
class Ranking:
    """One candidate: how it was judged. `condition` is the median, `worst` the largest cond [A; B]
    over the sampled states; `lost` tells by decades what Sᵀ M S loses of light bodies."""

    name: str
    kind: str
    rows: tuple[str, ...]
    constant_pivots: bool
    condition: float
    worst: float
    operations: int
    pivots: tuple[str, ...]
    verdict: str
    followers: int = 0  # speeds that a coupling gives by another coordinate
    driven: int = 0  # speeds that an input acts on
    lost: int = 0
    singular_at_start: bool = False


def numeric_rows(survey: Survey, B: ca.SX) -> np.ndarray:
    """The speed rows at the sampled states."""
    if B.is_constant():
        return np.tile(ca.DM(B).full(), (len(survey.sampled.t), 1, 1))
    s = survey.sampled
    return survey.solver.values(B, s.t, s.q, s.p)


def judged(
    survey: Survey,
    name: str,
    kind: str,
    rows: tuple[str, ...],
    reduction: Reduction,
    equations: Explicit,
) -> Ranking:
    """The ranking of one candidate: conditioning of [A; B] over the sampled states, operations of
    its equations, and its pivots.

    B is written at the frame of the choice, if it has one, before it becomes numbers. Two counts at
    the end tell how many of its rows are velocities that follow others, and how many are driven.
    """
    B, lost = reduction.at_frame(reduction.B), 0
    if survey.without_zeros is None:
        numeric = numeric_rows(survey, B)
        found, lost = conditions(survey, numeric), inertia_lost(survey, numeric)
    else:
        found = _conditions_without_zeros(survey, survey.without_zeros, B)
    count, pivots = equations.operations, reduction.pivots
    return Ranking(
        name,
        kind,
        rows,
        reduction.constant_pivots,
        *found,
        count,
        pivots,
        equations.gathered,
        len(survey.followers & set(rows)),
        len(survey.driven & set(rows)),
        lost,
        survey.is_singular_at_start(B),
    )


def inertia_lost(survey: Survey, B: np.ndarray) -> int:
    """How many times LIGHT decades Sᵀ M S, with its diagonal scaled to one, is worse conditioned
    than it may be: a light body whose motion is told by that of a heavy one loses its inertia."""
    if survey.masses is None or not survey.rank or not survey.freedom:
        return 0
    Y = np.concatenate([survey.rows[:, list(survey.kept)], even_rows(B)], axis=1)
    values = np.linalg.svd(Y, compute_uv=False)
    regular = values[:, -1] > REGULAR * values[:, 0]
    S = np.linalg.inv(Y[regular])[:, :, survey.rank :]
    reduced = S.transpose(0, 2, 1) @ survey.masses[regular] @ S
    sizes = np.sqrt(np.maximum(np.diagonal(reduced, axis1=1, axis2=2), NONZERO))
    least = np.linalg.eigvalsh(reduced / sizes[:, :, None] / sizes[:, None, :])[:, 0]
    worst = max(float(np.min(least, initial=1.0)), ROUNDOFF)
    return max(0, ceil((-log10(worst) - HEAVY) / LIGHT))


def conditions(survey: Survey, B: np.ndarray) -> tuple[float, float]:
    """Median and largest condition number of [A; B], rows scaled to length one."""
    nv = survey.system.v.numel()
    values = np.linalg.svd(np.concatenate([survey.rows, even_rows(B)], axis=1), compute_uv=False)
    if not values.size or values.shape[1] < nv:
        return (1.0, 1.0) if not nv else (np.inf, np.inf)
    ratios = values[:, 0] / np.maximum(values[:, nv - 1], NONZERO)
    return float(np.median(ratios)), float(np.max(ratios))


def _conditions_without_zeros(survey: Survey, A: Sparse, B: ca.SX) -> tuple[float, float]:
    """The same, to some digits."""
    s = survey.sampled
    Y = stacked(A, evened(survey.solver.value_rows(B, s.t, s.q, s.p)))
    least, largest = squares(Y.pattern).extremes(Y)
    ratios = largest / np.maximum(least, NONZERO)
    return float(np.median(ratios)), float(np.max(ratios))


def score(ranking: Ranking) -> Score:
    """Least is best. A follower is no choice while its leader is one, nor is what loses the inertia
    of light bodies; of what is alike in all else an actuated speed comes first.

    Conditions count by decades and a half: a ratio below about 30 is no reason to prefer a
    partition that needs more operations.
    """
    pivots = (ranking.singular_at_start, not ranking.constant_pivots)
    safety = (ranking.followers, *pivots, ranking.lost)
    condition = round(float(np.log10(ranking.worst)) / 1.5)
    return safety, condition, ranking.operations, -ranking.driven


def reason_of(best: Ranking, others: Sequence[Ranking]) -> str:
    """Why the best one was taken, beside the next."""
    speeds = listed(best.rows, NAMES)
    if not best.rows:
        return "the constraints leave nothing to choose"
    text = f"w = ({speeds}): " + _qualities(best)
    if others:
        text += f"; next was {_against(best, others[0])}: {_qualities(others[0])}"
    return text


def _against(best: Ranking, other: Ranking) -> str:
    """The other's speeds; of many only those that differ."""
    if len(other.rows) <= NAMES:
        return f"({', '.join(other.rows)})"
    enters, leaves = set(other.rows) - set(best.rows), set(best.rows) - set(other.rows)
    entering = listed((row for row in other.rows if row in enters), NAMES)
    leaving = listed((row for row in best.rows if row in leaves), NAMES)
    return f"({entering}) in place of ({leaving})"


def _qualities(ranking: Ranking) -> str:
    safe = (
        "no pivot can vanish"
        if ranking.constant_pivots
        else "a pivot varies with the configuration"
    )
    cost = f", about {ranking.operations} operations" if ranking.operations else ""
    lost = ", light bodies are told by heavy ones" if ranking.lost else ""
    return f"{safe}, cond [A; B] at most {ranking.worst:.3g} over the sampled states{lost}{cost}"
