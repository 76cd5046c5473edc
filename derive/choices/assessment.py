"""Choices of quasi-velocities compared: how near to singular, how much violation, how many
operations.

The criteria are those of Mirtaheri & Zohoor, in their order: avoid singularity (pivots that cannot
vanish, then cond [A; B]), reduce the violation of the constraints, efficiency. A v = c holds to
roundoff whatever the choice, at about 2⁻⁵² cond [A; B]. What is left is that positions drift, since
q̇ = N (S w + R c) is followed in steps: so the violation predicted is the |φ| that one classical
Runge–Kutta step from a closed position leaves, in which no coordinate moves by more than about 0.1
(rad or m).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.choices.limits import LEAST_VIOLATION, MOST_VIOLATION, ROUNDOFF, SHORT_TIME, STEP
from derive.choices.named import carried_through, declared
from derive.choices.ranking import Ranking, score
from derive.choices.resolution import Resolved, ranked_partitions
from derive.choices.survey import Survey, survey_of
from derive.diagnostics import HamelError
from derive.mechanics.records import System
from derive.model.records import CHOICE_KINDS
from derive.numerics import NONZERO, refuses_numerically

Slope = Callable[[float, np.ndarray], np.ndarray]  # f of x' = f(t, x)


@dataclass(frozen=True)
class Assessed:
    """`least_pivot`: the smallest |pivot| over the sampled states, relative to its largest;
    `violation`: see above."""

    ranking: Ranking
    least_pivot: float
    violation: float


@dataclass(frozen=True)
class Comparison:
    """Best first; `refused` says why the others are no choice."""

    assessed: tuple[Assessed, ...]
    refused: dict[str, str]


@refuses_numerically("the choices of quasi-velocities")
def comparison(system: System) -> Comparison:
    """The best partitions, the declared choices, and every kind that needs no rows, best first;
    what is no choice of this system stands under `refused` with the reason. Raises HamelError
    where no admissible state can be found."""
    survey = survey_of(system)
    refused: dict[str, str] = {}
    partitions = {x.ranking.name: x for x in ranked_partitions(survey)}
    for choice in system.model.choices:  # under the name that the file has for it
        same = next(
            (
                name
                for name, x in partitions.items()
                if x.ranking.rows == tuple(row for row, _ in choice.rows)
            ),
            "",
        )
        if same and choice.name not in partitions:
            partitions[choice.name] = replace(
                partitions[same], ranking=replace(partitions[same].ranking, name=choice.name)
            )
            del partitions[same]
    for name in _further(system, partitions):
        try:
            partitions[name] = carried_through(survey, declared(system, name))
        except HamelError as error:
            refused[name] = str(error)
    assessed = [assessment(survey, x) for x in partitions.values()]
    return Comparison(tuple(sorted(assessed, key=_score)), refused)


def _further(system: System, found: dict[str, Resolved]) -> Iterator[str]:
    """Choices of the file, and kinds that the file has not: `auto` is the first of the ranking."""
    kinds = {choice.kind for choice in system.model.choices}
    names = [choice.name for choice in system.model.choices if choice.kind != "auto"]
    yield from (name for name in names if name not in found)
    yield from (
        name for name in CHOICE_KINDS if name != "auto" and name not in kinds and name not in names
    )


def _score(x: Assessed) -> tuple[object, ...]:
    """As `auto` has it; among what is alike there, the smaller violation first."""
    varies, condition, *costs = score(x.ranking)
    size = min(max(x.violation, LEAST_VIOLATION), MOST_VIOLATION)
    return varies, condition, round(float(np.log10(size))), *costs


def assessment(survey: Survey, found: Resolved) -> Assessed:
    """One choice, judged at the sampled states."""
    return Assessed(found.ranking, least_pivot(survey, found), violation(survey, found))


def least_pivot(survey: Survey, found: Resolved) -> float:
    """The smallest pivot of a choice over the sampled states, as a ratio: 1 where nothing is
    divided by a quantity that moves.

    A choice that was carried through by elimination knows the quality of each pivot block.
    Otherwise each guard is compared with its own largest value over the sample, which makes the
    number free of units: near 0, some sampled state is near a singular position of this choice.
    """
    reduction = found.reduction
    if reduction.walked is not None:
        return min((step.block.quality for step in reduction.walked.steps), default=1.0)
    if not reduction.guards:
        return 1.0
    s = survey.sampled
    sizes = np.abs(
        survey.solver.values(
            ca.vertcat(*[guard.value for guard in reduction.guards]), s.t, s.q, s.p
        )
    )[:, :, 0]
    return float(np.min(np.min(sizes, axis=0) / np.maximum(np.max(sizes, axis=0), NONZERO)))


def violation(survey: Survey, found: Resolved) -> float:
    """The |φ| that one Runge–Kutta step from a closed position leaves, the worst over the sampled
    states, and never less than 2⁻⁵² cond [A; B]; infinite where a step meets a singular position.

    The step is as long as the fastest coordinate takes for 0.1 (rad or m): choices are compared at
    the same distance and not at the same time.
    """
    system, s = survey.system, survey.sampled
    roundoff = ROUNDOFF * found.ranking.worst if system.rows else 0.0
    if not system.phi.numel() or not len(s.t):
        return roundoff
    x = ca.vertcat(system.q, found.reduction.w)
    rate = ca.Function(
        "rate",
        [system.t, x, system.u, system.p],
        [ca.vertcat(found.explicit.qdot, found.explicit.wdot)],
    )
    phi = ca.Function("phi", [system.t, system.q, system.p], [ca.densify(system.phi)])
    w = (survey.solver.values(found.reduction.B, s.t, s.q, s.p) @ s.v[:, :, None])[:, :, 0]
    left = [_growth(rate, phi, *row) for row in zip(s.t, np.hstack([s.q, w]), s.u, s.p)]
    return max(roundoff, float(np.max(left)))


def _growth(
    rate: ca.Function, phi: ca.Function, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> float:
    """|φ| after one step, less what it was before."""
    nq = phi.numel_in(1)

    def xdot(time: float, y: np.ndarray) -> np.ndarray:
        """ẋ as an ODE integrator wants it: f(t, y), flat, with inputs and parameters held fixed."""
        return rate(time, y, u, p).full().ravel()

    here = xdot(t, x)
    rates = np.abs(here[:nq])
    # q̈ by a difference: it only says how long the step may be
    later = np.abs(xdot(t + SHORT_TIME, x + SHORT_TIME * here)[:nq] - here[:nq]) * (1 / SHORT_TIME)
    h = min(
        1.0,
        STEP
        / max(
            NONZERO,
            np.max(rates, initial=0.0),
            float(np.sqrt(STEP * np.max(later, initial=0.0) / 2)),
        ),
    )
    end = _stepped(xdot, t, x, h)
    after, before = (
        np.abs(phi(time, y[:nq], p).full()).max() for time, y in ((t + h, end), (t, x))
    )
    return max(0.0, float(after - before)) if np.isfinite(after) else np.inf


def _stepped(f: Slope, t: float, x: np.ndarray, h: float) -> np.ndarray:
    """The classical Runge–Kutta step."""
    a = f(t, x)
    b = f(t + h / 2, x + h / 2 * a)
    c = f(t + h / 2, x + h / 2 * b)
    d = f(t + h, x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)


@refuses_numerically("cond [A; B] along the motion")
def conditions_along(
    system: System, names: list[str], t: np.ndarray, q: np.ndarray
) -> dict[str, np.ndarray]:
    """cond [A; B] of the named choices at many states (k,), rows scaled to length one there.

    t is (k,), q is (k, nq); parameters are the defaults. It shows where along a motion one choice
    comes near a singular position and another does not. Raises ModelError for an unknown name.
    """
    survey, p = (
        survey_of(system),
        np.tile(system.parameters, (len(t), 1)).reshape(len(t), system.p.numel()),
    )
    A = survey.solver.rows(t, q, p)[0][:, list(survey.kept)]
    conditions: dict[str, np.ndarray] = {}
    for name in names:
        B = carried_through(survey, declared(system, name)).reduction.B
        values = (
            ca.DM(B).full()[None].repeat(len(t), axis=0)
            if B.is_constant()
            else survey.solver.values(B, t, q, p)
        )
        Y = np.concatenate([A, values], axis=1)
        lengths = np.linalg.norm(Y, axis=2, keepdims=True)
        conditions[name] = np.linalg.cond(Y / np.where(lengths > 0, lengths, 1.0))
    return conditions
