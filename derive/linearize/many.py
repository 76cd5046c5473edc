"""Steady motions at many places that need not follow each other: all by Newton at once.

They start from one motion that is known, moved along straight lines for each value that differs;
many courses are straight, and then that is all. Those that bend are followed step by step, so that
none leaves the branch of that motion for another.
"""

from __future__ import annotations

import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.columns import columns_of
from derive.linearize.branch import bends, is_near
from derive.linearize.limits import HALVED, KEPT, RANK, STEPS, STRAIGHT
from derive.linearize.records import Steady
from derive.linearize.search import row_sizes, solved, with_inputs
from derive.linearize.steady import Problem
from derive.linearize.study import Columns, Study

ROUNDS = 12  # of Newton: more is no convergence from a start so near
AT_ONCE = 4096  # rows of Jacobians in memory


def steady_motions(study: Study, values: Columns) -> tuple[Steady, np.ndarray]:
    """A motion for each row of values (N), and which of them are steady; the others hold nothing of
    use.

    From the study's own motion y₀: y = y₀ + Σ ∂y/∂v_j (v_j − v_j₀), then Newton where that is not
    steady yet; step by step where this leads elsewhere, and to none where the branch ends on
    the way. What comes of a row does not depend on the other rows.
    """
    problem = study.problem
    p, s = study.values(values)
    own_p, own_s = study.values({})
    first = study.motions({})
    y0 = np.concatenate([first.x[0], first.u[0]])
    given, origin = np.hstack([p, s]), np.hstack([own_p[0], own_s[0]])
    y = y0 + (given - origin) @ _directions(study, y0, tuple(values)).T
    y = _with_inputs(problem, y, p, s)
    good = _worst(study, y, p, s) <= STRAIGHT * (1 + np.max(np.abs(y), axis=1))
    rest = np.flatnonzero(~good)
    if len(rest):
        rows = row_sizes(problem, _evaluated(problem, y0[None], own_p, own_s)[1][0])
        for part in np.array_split(rest, -(-len(rest) // AT_ONCE)):
            line = y[part]
            y[part], good[part] = _newton(study, line, p[part], s[part], rows)
            elsewhere = part[~(good[part] & is_near(problem, y[part], line, y0))]
            to = (p[elsewhere], s[elsewhere])
            y[elsewhere], good[elsewhere] = _followed(study, y0, (own_p, own_s), to, rows)
    nx = first.x.shape[1]
    return Steady(y[:, :nx], y[:, nx:], p, _worst(study, y, p, s)), good


def _followed(
    study: Study,
    y0: np.ndarray,
    own: tuple[np.ndarray, np.ndarray],
    to: tuple[np.ndarray, np.ndarray],
    rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The motions at values `to`, each followed from y0 at its `own` in steps of its own length,
    and which were reached. A step is half as long where it comes to another place than foreseen;
    the shortest go round bends, and no further where a row changes as much as no bend does."""
    problem, many = study.problem, len(to[0])
    y, at, step = np.tile(y0, (many, 1)), np.zeros(many), np.ones(many)
    going = np.arange(many)
    for _ in range(STEPS):
        if not len(going):
            break
        part = np.minimum(at[going] + step[going], 1.0)
        here, there = (_between(own, to, going, x) for x in (at[going], part))
        before = _with_inputs(problem, y[going], *there)
        slopes = _evaluated(problem, y[going], *here)[1]
        shifted = _shifts(problem, y[going], here, there)
        shifted += (slopes @ (before - y[going])[:, :, None])[:, :, 0]
        ahead = before + _step(study, shifted, slopes, there, rows)
        found, stands = _newton(study, ahead, *there, rows)
        shortest = step[going] <= 0.5**HALVED
        near = is_near(problem, found, ahead, before)
        back = np.flatnonzero(shortest & ~(stands & near))  # the branch may bend there
        if len(back):
            p, s = (x[back] for x in there)
            found[back], stands[back] = _newton(study, before[back], p, s, rows)
        goes_on = stands & (near | (shortest & bends(problem, found, before, y0)))
        y[going[goes_on]], at[going[goes_on]] = found[goes_on], part[goes_on]
        step[going] *= np.where(goes_on, 2.0, 0.5)
        going = going[(at[going] < 1.0) & (goes_on | ~shortest)]
    return y, at == 1.0


def _between(
    own: tuple[np.ndarray, np.ndarray],
    to: tuple[np.ndarray, np.ndarray],
    which: np.ndarray,
    part: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Values of p and s on the way, a part of it for each of those rows."""
    p, s = (x0 + part[:, None] * (x[which] - x0) for x0, x in zip(own, to))
    return p, s


def _directions(study: Study, y0: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """∂y/∂(p, s) along what varies, ny × (np + ns), from one further motion each; zero where there
    is none so near."""
    labels = (*study.equations.arguments[3].labels, *study.problem.motion.sweepable)
    directions = np.zeros((len(y0), len(labels)))
    for name in names:
        step = 0.01 * (abs(study.at[name]) or 1.0)
        p, s = study.values({name: [study.at[name] + step]})
        try:
            y = solved(study.problem, p[0], s[0], y0)
        except AssumptionError:
            continue
        directions[:, labels.index(name)] = (y - y0) / step
    return directions


def _newton(
    study: Study, y: np.ndarray, p: np.ndarray, s: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Undamped; a row that stands stays as it is."""
    D, y = study.problem.scale, y.copy()
    going, done = np.arange(len(y)), np.zeros(len(y), dtype=bool)
    for _ in range(ROUNDS):
        there = p[going], s[going]
        step = _step(study, *_evaluated(study.problem, y[going], *there), there, rows)
        finite = np.flatnonzero(np.isfinite(step.sum(axis=1)))
        going, step = going[finite], step[finite]
        y[going] += step
        size = 1 + np.max(np.abs(y[going] / D), axis=1)
        stands = np.max(np.abs(step / D), axis=1) <= KEPT * size
        done[going[stands]] = True
        going = going[~stands]
        if not len(going):
            break
    # a step that stands still is not yet a motion that is steady
    off = _worst(study, y, p, s) / (1 + np.max(np.abs(y), axis=1))
    return y, done & (off <= KEPT)


def _step(
    study: Study,
    residuals: np.ndarray,
    slopes: np.ndarray,
    at: tuple[np.ndarray, np.ndarray],
    rows: np.ndarray,
) -> np.ndarray:
    """Of Newton's method, by least squares in the model's own units; not finite where residuals or
    slopes are not."""
    D = study.problem.scale
    weights = _free(study.problem, *at) * D / rows[:, None]
    step = np.full((len(residuals), len(D)), np.nan)
    known = np.hstack([residuals, slopes.reshape(len(residuals), -1)])
    finite = np.isfinite(known.sum(axis=1))
    side = (residuals[finite] / rows)[:, :, None]
    step[finite] = -D * (np.linalg.pinv(slopes[finite] * weights, rcond=RANK) @ side)[:, :, 0]
    return step


def _free(problem: Problem, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Which unknowns are left to find, the same for all."""
    ny = len(problem.scale)
    return with_inputs(problem, np.zeros(ny), p[0], s[0])[1] if len(p) else np.ones(ny)


def _with_inputs(problem: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """y with inputs that are held at their values."""
    first = problem.equations.arguments[1].symbols.numel()
    held = columns_of(problem.held)(p.T, s.T)[0][:, 0].T
    result = y.copy()
    for k, name in enumerate(problem.equations.arguments[2].labels, start=first):
        if name in problem.names:
            result[:, k] = held[:, problem.names.index(name)]
    return result


def _evaluated(
    problem: Problem, y: np.ndarray, p: np.ndarray, s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    nx = problem.equations.arguments[1].symbols.numel()
    R, J = columns_of(problem.function)(y[:, :nx].T, y[:, nx:].T, p.T, s.T)
    return R[:, 0].T, J.transpose(2, 0, 1)


def _shifts(
    problem: Problem,
    y: np.ndarray,
    here: tuple[np.ndarray, np.ndarray],
    there: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """By how much the values that change shift the residuals, by their slopes here."""
    nx = problem.equations.arguments[1].symbols.numel()
    slopes = columns_of(problem.shifts)(y[:, :nx].T, y[:, nx:].T, here[0].T, here[1].T)[0]
    change = np.hstack([x - x0 for x0, x in zip(here, there)])
    return (slopes.transpose(2, 0, 1) @ change[:, :, None])[:, :, 0]


def _worst(study: Study, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The worst of each row; infinite where it is not finite."""
    R = study.residuals(y, p, s)
    return np.nan_to_num(np.max(np.abs(R), axis=1, initial=0.0), nan=np.inf)
