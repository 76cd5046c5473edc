"""The branch of steady motions through one of them, as values change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic
from derive.linearize.limits import (
    HALF_KNOWN,
    HALVED,
    LEAP,
    LEAPS,
    LITTLE,
    ROUNDED_AWAY,
    SMOOTH,
    STEPS,
    STRAIGHT,
)
from derive.linearize.nearest import settled
from derive.linearize.records import Steady
from derive.linearize.search import foreseen, solved
from derive.linearize.steady import Problem, residuals_of


@dataclass(frozen=True)
class Place:
    """One motion y = (x, u), and the values of parameters and free names that it belongs to."""

    p: np.ndarray
    s: np.ndarray
    y: np.ndarray

    def at(self, p: np.ndarray, s: np.ndarray) -> bool:
        """Whether it belongs to these values."""
        return np.array_equal(self.p, p) and np.array_equal(self.s, s)


def family(found: Problem, origin: Place, p: np.ndarray, s: np.ndarray) -> Steady:
    """The steady motions for rows of p (N × np) and s (N × ns), on the branch through `origin`.

    It is continued to the row nearest to the origin, and from there to both ends, row by row, with
    straight lines where those will do. Where the branch ends, another one is followed, and `breaks`
    says so; where none is found, a row has no motion, and `absent` says so. Raises AssumptionError
    where no row has one.
    """
    rows, nx = np.hstack([p, s]), found.equations.arguments[1].symbols.numel()
    y = np.full((len(p), len(origin.y)), np.nan)
    nearest = _nearest(rows, np.concatenate([origin.p, origin.s]))
    problem = None
    try:
        y[nearest] = _reached(found, origin, p[nearest], s[nearest])
    except AssumptionError as error:
        problem = error
    down = range(nearest, -1, -1)
    up = range(nearest, len(p))
    broken = {k + 1 for k in _followed(found, p, s, y, down)}
    broken |= {*_followed(found, p, s, y, up)}
    broken = _filled(found, (p, s, y), nearest, broken)
    absent = np.flatnonzero(np.isnan(y[:, :1]).any(axis=1)).tolist()
    if problem and len(absent) == len(p):
        raise problem
    R = residuals_of(found, y, p, s)
    worst = np.max(np.abs(R), axis=1, initial=0.0)
    return Steady(y[:, :nx], y[:, nx:], p, worst, tuple(sorted(broken)), tuple(absent))


def is_near(found: Problem, y: np.ndarray, ahead: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Whether y is near where it was foreseen when the branch goes on from `before`: then it is on
    it. One motion, or rows of them."""
    change, off = _moved(found, before, y), _moved(found, ahead, y)
    nq = found.equations.system.q.numel()
    size = np.max(np.abs(before / found.scale)[..., :nq], axis=-1, keepdims=True, initial=0.0)
    leaps = np.any(change[..., :nq] > LEAP * (1.0 + size), axis=-1)
    return np.all(off <= SMOOTH * _roomy(change), axis=-1) & ~leaps


def bends(found: Problem, y: np.ndarray, before: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Whether the shortest step came no further than round a bend, as into a fork: it changes
    little against the way from the first motion. One that changes as much is on another branch."""
    way = np.maximum(_moved(found, before, first), _moved(found, y, first))
    return np.all(_moved(found, before, y) <= np.maximum(LEAPS * _roomy(way), HALF_KNOWN), axis=-1)


def _nearest(rows: np.ndarray, origin: np.ndarray) -> int:
    """The row nearest to the origin, each value that varies against the span of its column."""
    span = np.ptp(rows, axis=0)
    away = np.abs(rows - origin)[:, span > 0] / span[span > 0]
    return int(np.argmin(np.max(away, axis=1, initial=0.0)))


def _moved(found: Problem, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """By how much each unknown differs, in the model's own units; of a motion, or of rows."""
    return np.abs(one - other) / found.scale


def _roomy(change: np.ndarray) -> np.ndarray:
    """Each change, and a little of the largest for those that happen to be none; more than what
    rounding makes."""
    return change + LITTLE * np.max(change, axis=-1, keepdims=True, initial=ROUNDED_AWAY)


def _reached(found: Problem, origin: Place, p: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The motion on the branch of the origin; where that ends before, the one near the guess."""
    if origin.at(p, s):
        return origin.y
    try:
        y, leapt = _way(found, origin, (p, s))
    except AssumptionError:
        return _anew(found, p, s, origin)
    return _anew(found, p, s, origin) if leapt else y


def _anew(found: Problem, p: np.ndarray, s: np.ndarray, before: Place) -> np.ndarray:
    """A motion on any branch. Raises AssumptionError, with the values that differ from those
    before."""
    try:
        return settled(found, p, s)
    except AssumptionError as error:
        names = (*found.equations.arguments[3].labels, *found.motion.sweepable)
        values = zip(names, np.append(p, s), np.append(before.p, before.s))
        where = {name: f"{name} = {x:.6g}" for name, x, known in values if x != known}
        raise AssumptionError([_placed(d, where) for d in error.diagnostics]) from error


def _placed(problem: Diagnostic, where: Mapping[str, str]) -> Diagnostic:
    """The problem with the values that it has not said."""
    left = [text for name, text in where.items() if f" {name} = " not in problem.message]
    return replace(problem, message=f"at {', '.join(left)}: {problem.message}") if left else problem


def _followed(
    found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray, rows: Sequence[int]
) -> list[int]:
    """Fill the rows after the first of `rows`, where they have a motion; those that are on another
    branch than the one before them."""
    if len(rows) < 2 or _straight(found, p, s, y, rows):
        return []
    broken, met = list[int](), False
    for before, k in pairwise(rows):
        met |= not np.isnan(y[before]).any()
        place, leapt = Place(p[before], s[before], y[before]), True
        with suppress(AssumptionError):
            y[k], leapt = _next_row(found, place, (p[k], s[k]))
        broken += [k] if leapt and met and not np.isnan(y[k]).any() else []
    return broken


def _filled(
    found: Problem,
    motions: tuple[np.ndarray, np.ndarray, np.ndarray],
    nearest: int,
    broken: set[int],
) -> set[int]:
    """Fill rows without a motion from one further out that has one: its branch may come there from
    the other side. The rows on another branch than the one before them, now."""
    p, s, y = motions
    for rows in (range(len(p) - 1, nearest - 1, -1), range(nearest + 1)):
        for before, k in pairwise(rows):
            if not np.isnan(y[k]).any() or np.isnan(y[before]).any():
                continue
            with suppress(AssumptionError):
                motion, leapt = _way(found, Place(p[before], s[before], y[before]), (p[k], s[k]))
                if leapt:
                    continue
                y[k] = motion
                beyond = 2 * k - before
                broken = broken - {max(before, k)}
                if 0 <= beyond < len(p) and not np.isnan(y[beyond]).any():
                    broken = broken | {max(k, beyond)}
    return broken


def _next_row(
    found: Problem, before: Place, to: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, bool]:
    """The motion of a row, and whether it is on another branch than the one before. Raises
    AssumptionError where it has none."""
    if not np.isnan(before.y).any():
        with suppress(AssumptionError):
            return _way(found, before, to)
    return _anew(found, *to, before), True


def _straight(
    found: Problem, p: np.ndarray, s: np.ndarray, y: np.ndarray, rows: Sequence[int]
) -> bool:
    """Fill the rows by the chord to the last of them, where every motion on it is steady; else
    none."""
    first, last, inner = rows[0], rows[-1], list(rows[1:-1])
    if np.isnan(y[first]).any():
        return False
    try:
        end = solved(found, p[last], s[last], y[first])
    except AssumptionError:  # too far at once
        return False
    parts = _parts(np.hstack([p, s]), first, last, inner)
    chord = y[first] + np.append(parts, 0.5)[:, np.newaxis] * (end - y[first])
    values = [np.vstack([x[inner], (x[first] + x[last]) / 2]) for x in (p, s)]
    off = np.max(np.abs(residuals_of(found, chord, *values)))
    if not off <= STRAIGHT * (1 + np.max(np.abs(chord))):
        return False
    y[inner], y[last] = chord[:-1], end
    return True


def _way(
    found: Problem, place: Place, to: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, bool]:
    """The motion at other values, and whether the branch ended before. A step is half as long
    where Newton's method comes to another place than foreseen; the shortest go round bends.
    Raises AssumptionError where there is no motion."""
    here, at, step, leapt = place, 0.0, 1.0, False
    for _ in range(STEPS):
        part = min(at + step, 1.0)
        p, s = place.p + part * (to[0] - place.p), place.s + part * (to[1] - place.s)
        shortest = step <= 0.5**HALVED
        try:
            y, goes_on = _next(found, here, p, s)
        except AssumptionError:
            if shortest:
                raise
            step /= 2
            continue
        if not (goes_on or shortest):
            step /= 2
            continue
        leapt |= not (goes_on or bool(bends(found, y, here.y, place.y)))
        here, at, step = Place(p, s, y), part, 2 * step
        if at == 1.0:
            return y, leapt
    return solved(found, *to, here.y), True


def _next(found: Problem, here: Place, p: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, bool]:
    """The motion where the branch leads, and whether it is one near there; else the one that
    Newton's method finds from here. Raises AssumptionError where it finds none."""
    with suppress(AssumptionError):
        ahead = foreseen(found, (here.p, here.s, here.y), p, s)
        y = solved(found, p, s, ahead)
        if is_near(found, y, ahead, here.y):
            return y, True
    return solved(found, p, s, here.y), False


def _parts(values: np.ndarray, first: int, last: int, inner: Sequence[int]) -> np.ndarray:
    """How far each row between is on the way from the first to the last."""
    way = values[last] - values[first]
    length = float(way @ way)
    if not length > 0:
        return np.zeros(len(inner))
    return (values[inner] - values[first]) @ way / length
