"""Steady motions at many places that need not follow each other: all by Newton at once.

They start from one motion that is known, moved along straight lines for each value that differs;
many courses are straight, and then that is all.
"""

from __future__ import annotations

import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions.columns import columns_of
from derive.linearize.limits import KEPT, RANK, STRAIGHT
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
    steady yet. What comes of a row does not depend on the other rows.
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
            y[part], good[part] = _newton(study, y[part], p[part], s[part], rows)
    nx = first.x.shape[1]
    return Steady(y[:, :nx], y[:, nx:], p, _worst(study, y, p, s)), good


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
    """Undamped, by least squares, in the model's own units; a row that stands stays as it is."""
    problem = study.problem
    D, y = problem.scale, y.copy()
    weights = _free(problem, p, s) * D / rows[:, None]
    going, done = np.arange(len(y)), np.zeros(len(y), dtype=bool)
    for _ in range(ROUNDS):
        residuals, slopes = _evaluated(problem, y[going], p[going], s[going])
        known = np.hstack([residuals, slopes.reshape(len(going), -1)])
        finite = np.flatnonzero(np.isfinite(known.sum(axis=1)))
        going, slopes = going[finite], slopes[finite]
        side = (residuals[finite] / rows)[:, :, None]
        step = -D * (np.linalg.pinv(slopes * weights, rcond=RANK) @ side)[:, :, 0]
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


def _worst(study: Study, y: np.ndarray, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The worst of each row; infinite where it is not finite."""
    R = study.residuals(y, p, s)
    return np.nan_to_num(np.max(np.abs(R), axis=1, initial=0.0), nan=np.inf)
